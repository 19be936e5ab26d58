#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Makes the site: the documentation, and the page that replays recordings in a browser. It needs no
server: open index.html.

usage: site.py [--out FOLDER] [--only docs|replay]

The documentation is README, docs and the public headers, laid out as in the repository and built by
zensical; a link that leads nowhere is an error. docs/site has the parts of the page. Beside them
replay.html holds the replay as WebAssembly, once with relaxed SIMD and once for any browser, and
two drives with the SHA-256 of their trajectories: a simulated one of a minute, as
build/bin/pelorus-replay finds it here, and tests/golden/drive.plr, as the boards find it, too.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import cross

ROOT = cross.ROOT
PARTS = ROOT / "docs/site"
PROGRAMS = {"RELAXED": "wasi-relaxed", "PORTABLE": "wasi"}
DRIVE, DRIVE_SUM = ROOT / "tests/golden/drive.plr", ROOT / "tests/golden/drive.sha256"
DRIVE_WORDS = ("--slots", "32")  # options of the boards' drive
PICTURES = ("*.png", "*.webp")
Known = dict[str, Sequence[str] | dict[str, str]]
SOURCE_LINK = re.compile(r"\]\(((?:\.\./)?([\w./-]+\.(h|c|py)))\)")
LANGUAGES = {"h": "c", "c": "c", "py": "python"}


def trajectory_sum(recording: Path, words: tuple[str, ...], folder: Path) -> str:
    """Returns SHA-256 of the trajectory on the desk."""
    path = folder / f"{recording.stem}.tum"
    command = [str(cross.NATIVE), str(recording), *words, "--quiet", "--trajectory", str(path)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return hashlib.sha256(path.read_bytes()).hexdigest()


def drives(folder: Path) -> tuple[dict[str, bytes], dict[str, Known]]:
    """Returns the recordings of the page, with the sums of their trajectories by options."""
    minute = folder / "minute.plr"
    command = [sys.executable, "-m", "pelorus", "simulate", str(minute)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    golden = DRIVE_SUM.read_text("ascii").strip()
    if trajectory_sum(DRIVE, DRIVE_WORDS, folder) != golden:
        sys.exit(f"{cross.NATIVE} finds another path of {DRIVE} than {DRIVE_SUM} says")
    sums = {"a desk (x86-64 Linux)": golden, "a board (Cortex-M, emulated)": golden}
    known: dict[str, Known] = {
        "sample": {
            "words": [],
            "sums": {"a desk (x86-64 Linux)": trajectory_sum(minute, (), folder)},
        },
        "drive": {"words": DRIVE_WORDS, "sums": sums},
    }
    return {"SAMPLE": minute.read_bytes(), "DRIVE": DRIVE.read_bytes()}, known


def replay_page(out: Path) -> Path:
    """Builds the page in one file."""
    if not cross.NATIVE.is_file():
        sys.exit(f"{cross.NATIVE} is not there: tools/demo.sh builds it")
    packed = {
        name: cross.build(cross.TARGETS[target], out / "programs" / target).read_bytes()
        for name, target in PROGRAMS.items()
    }
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        recordings, known = drives(Path(folder))
    text = (PARTS / "index.html").read_text(encoding="utf-8")
    worker = "".join((PARTS / name).read_text("utf-8") for name in ("replay.js", "worker.js"))
    for name, content in {**packed, **recordings}.items():
        text = text.replace(f"@{name}@", base64.b64encode(content).decode())
    text = text.replace("@KNOWN@", json.dumps(known)).replace("@WORKER@", worker)
    page = out / "replay.html"
    page.write_text(text, encoding="utf-8")
    return page


def copied(source: Path, target: Path) -> set[str]:
    """Copies a page, with links to sources changed to their pages; returns these sources."""
    target.parent.mkdir(parents=True, exist_ok=True)
    text = source.read_text("utf-8")
    target.write_text(SOURCE_LINK.sub(r"](\1.md)", text), encoding="utf-8")
    return {match[2] for match in SOURCE_LINK.finditer(text)}


def stage(folder: Path, replay: Path | None) -> None:
    """Prepares what zensical builds: its settings, and `pages`, laid out as the repository is."""
    pages = folder / "pages"
    headers = [one.relative_to(ROOT).as_posix() for one in (ROOT / "include/pelorus").glob("*.h")]
    sources = set(headers)
    for page in (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")):
        sources |= copied(page, pages / page.relative_to(ROOT))
    for name in sources:
        page = pages / f"{name}.md"
        page.parent.mkdir(parents=True, exist_ok=True)
        source, language = (ROOT / name).read_text("utf-8"), LANGUAGES[name.rpartition(".")[2]]
        page.write_text(f"# {Path(name).name}\n\n```{language}\n{source}```\n", "utf-8")
    (pages / "docs/images").mkdir(exist_ok=True)
    for picture in (one for kind in PICTURES for one in (ROOT / "docs/images").glob(kind)):
        shutil.copy(picture, pages / "docs/images")
    shutil.copy(PARTS / "wide.css", pages)
    if replay is None:
        (pages / "replay.html").write_text("left out: tools/site.py makes it\n", "utf-8")
    else:
        shutil.copy(replay, pages / "replay.html")
    settings = (PARTS / "zensical.yml").read_text("utf-8")
    entries = "\n".join(f"      - {Path(name).name}: {name}.md" for name in sorted(headers))
    settings = settings.replace("      - HEADERS", entries)
    (folder / "zensical.yml").write_text(settings, encoding="utf-8")


def built(folder: Path) -> Path:
    """Builds the site of what is staged there."""
    command = [
        sys.executable,
        "-m",
        "zensical",
        "build",
        "--strict",
        "--config-file",
        "zensical.yml",
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = (done.stdout + done.stderr).partition("Traceback")[0]
        sys.exit(f"{said}the documentation cannot be built: the lines above say why")
    return folder / "site"


def documentation(out: Path, replay: Path | None) -> Path:
    """Builds the whole site, with the replay page in it."""
    if importlib.util.find_spec("zensical") is None:
        sys.exit("zensical is not there: pip install --requirement tools/requirements.lock")
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        stage(Path(folder), replay)
        shutil.copytree(built(Path(folder)), out, dirs_exist_ok=True)
    return out / "index.html"


def main() -> int:
    """Builds it; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "build/site", help="its folder")
    parser.add_argument("--only", choices=("docs", "replay"), help="a part of it")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    made = None if given.only == "docs" else replay_page(given.out)
    if given.only != "replay":
        made = documentation(given.out, made)
    print(made)
    return 0


if __name__ == "__main__":
    sys.exit(main())
