#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Builds the Python package's wheels for other systems than this one.

usage: wheels.py [--out FOLDER] [SYSTEM...]

pip builds this machine's wheel; in a copy of it for each system the two libraries and the two
replays are exchanged for those that the compiler of the package ziglang makes (cross.py), and the
tag; README gets its picture. Nothing of a wheel depends on the version of Python.
"""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import sys
import tempfile
from base64 import b64encode
from pathlib import Path

import amalgamate
from cross import ROOT, X86_64_V3, Target, asked_for, build, compile_to, port_flags
from PIL import Image

NATIVE = "pelorus/native"
PICTURE_PX = 800  # of README's picture in the wheel
WHEELS = {
    "manylinux_2_17_x86_64": Target("x86_64-linux-gnu.2.17", X86_64_V3),
    "manylinux_2_17_aarch64": Target("aarch64-linux-gnu.2.17"),
    "win_amd64": Target("x86_64-windows-gnu", X86_64_V3, "pelorus-replay.exe"),
    "macosx_11_0_x86_64": Target("x86_64-macos.11.0", X86_64_V3),
    "macosx_11_0_arm64": Target("aarch64-macos.11.0"),
}


def suffix(target: Target) -> str:
    """Returns the suffix of a library, as tools/pelorus/native/binding.py looks for it."""
    if target.windows:
        return ".dll"
    return ".dylib" if "macos" in target.triple else ".so"


def build_binding(target: Target, folder: Path, bits: int) -> Path:
    """Builds the library as Python loads it, after `build`."""
    sources = [ROOT / "port/python/binding.c", ROOT / "port/posix/processor.c"]
    (folder / "binding.c").write_text(amalgamate.program(ROOT, sources), encoding="utf-8")
    made = folder / f"pelorus-filter{'-f64' if bits == 64 else ''}{suffix(target)}"
    pic = [] if target.windows else ["-fPIC", "-lm"]
    link = ["-shared", *pic, str(folder / f"pelorus-{bits}.o"), "-s"]
    compile_to(made, folder / "binding.c", target, [*port_flags(target, bits), *link])
    return made


def pip_wheel(folder: Path) -> Path:
    """Builds this machine's wheel."""
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    command += ["--no-build-isolation", "--wheel-dir", str(folder), str(ROOT)]
    subprocess.run(command, check=True)
    (made,) = folder.glob("pelorus_slam-*.whl")
    return made


def run_wheel(*words: str | Path) -> None:
    """Runs the package `wheel`, which unpacks wheels and packs them with their list of contents."""
    command = [sys.executable, "-m", "wheel", *map(str, words)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def standalone(readme: str) -> str:
    """Returns the README for use without its checkout.

    Its pictures are embedded and still; a link to another file becomes its words.
    """

    def packed(picture: re.Match[str]) -> str:
        moving = Image.open(ROOT / picture[2])
        moving.seek(getattr(moving, "n_frames", 1) - 1)
        last = moving.convert("RGB")
        last.thumbnail((PICTURE_PX, PICTURE_PX))
        made = io.BytesIO()
        last.save(made, "WEBP", quality=50)
        return f"![{picture[1]}](data:image/webp;base64,{b64encode(made.getvalue()).decode()})"

    elsewhere = r"(?!https?:|data:)"
    readme = re.sub(rf"!\[([^]]*)\]\({elsewhere}([^)]+)\)", packed, readme)
    return re.sub(rf"(?<!!)\[([^]]*)\]\({elsewhere}[^)]+\)", r"\1", readme)


def make(tag: str, target: Target, own: Path, work: Path, out: Path) -> Path:
    """Makes the wheel for the system of the tag from this machine's own."""
    run_wheel("unpack", own, "--dest", work / "unpacked")
    (content,) = (work / "unpacked").iterdir()
    shutil.rmtree(content / NATIVE)
    (content / NATIVE).mkdir()
    for bits in (32, 64):
        replay = build(target, work / "built", bits)
        for made in (replay, build_binding(target, work / "built", bits)):
            shutil.copy(made, content / NATIVE)
            (content / NATIVE / made.name).chmod(0o755)
    (about,) = content.glob("*.dist-info/WHEEL")
    text = re.sub(r"^Tag: .*$", f"Tag: py3-none-{tag}", about.read_text(), flags=re.M)
    about.write_text(text)
    (metadata,) = content.glob("*.dist-info/METADATA")
    metadata.write_text(standalone(metadata.read_text("utf-8")), "utf-8")
    run_wheel("pack", content, "--dest-dir", out)
    (made,) = out.glob(f"pelorus_slam-*-py3-none-{tag}.whl")
    return made


def main() -> int:
    """Builds the wheels; returns the exit status."""
    given = asked_for(__doc__, WHEELS, "build/wheels")
    with tempfile.TemporaryDirectory(prefix="pelorus-") as temporary:
        folder = Path(temporary)
        own = pip_wheel(folder)
        for tag in given.systems:
            (work := folder / tag).mkdir()
            made = make(tag, WHEELS[tag], own, work, given.out)
            print(f"{made}: {made.stat().st_size // 1024} KB", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
