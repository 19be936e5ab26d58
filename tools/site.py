#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Makes the page that replays recordings in a browser: one file, which needs no server.

usage: site.py [--out FOLDER]

docs/site has its parts. Beside them it holds the replay as WebAssembly, once with relaxed SIMD and
once for any browser, a simulated drive of a minute, and the SHA-256 of the trajectory that
build/bin/pelorus-replay makes of it.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import subprocess
import sys
import tempfile
from pathlib import Path

import cross

PARTS = cross.ROOT / "docs/site"
PROGRAMS = {"RELAXED": "wasi-relaxed", "PORTABLE": "wasi"}


def sample(folder: Path) -> tuple[bytes, str]:
    """A recording, and the sum that the desk gives it."""
    drive, path = folder / "drive.plr", folder / "path.tum"
    command = [sys.executable, "-m", "pelorus", "simulate", str(drive)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    replay = [str(cross.NATIVE), str(drive), "--quiet", "--trajectory", str(path)]
    subprocess.run(replay, check=True, stdout=subprocess.DEVNULL)
    return drive.read_bytes(), hashlib.sha256(path.read_bytes()).hexdigest()


def page(programs: dict[str, bytes], drive: bytes, desk: str) -> str:
    """The whole page."""
    text = (PARTS / "index.html").read_text(encoding="utf-8")
    worker = "".join((PARTS / name).read_text("utf-8") for name in ("replay.js", "worker.js"))
    packed = {**programs, "SAMPLE": drive}
    for name, content in packed.items():
        text = text.replace(f"@{name}@", base64.b64encode(content).decode())
    return text.replace("@DESK@", desk).replace("@WORKER@", worker)


def main() -> int:
    """Builds it; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=cross.ROOT / "build/site", help="its folder")
    out = parser.parse_args().out
    if not cross.NATIVE.is_file():
        print(f"{cross.NATIVE} is not there: tools/demo.sh builds it", file=sys.stderr)
        return 1
    programs = {
        name: cross.build(cross.TARGETS[target], out / target).read_bytes()
        for name, target in PROGRAMS.items()
    }
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        text = page(programs, *sample(Path(folder)))
    (out / "index.html").write_text(text, encoding="utf-8")
    print(f"{out / 'index.html'}: {len(text) // 1024} KB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
