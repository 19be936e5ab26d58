#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares the tables that the library is built from with what is said of them elsewhere.

schema.json, which the Python tools read, and the tables of docs/, each between
`<!-- table: NAME -->` and `<!-- end -->`, are printed by the program pelorus-schema.
Limits and defaults in settings.h come from settings.def.

usage: schema.py PROJECT_ROOT PELORUS_SCHEMA [--write]

With --write it puts in order what differs.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from settings import faults_of, header_from

SCHEMA = "tools/pelorus/schema.json"
TABLE_OF_SETTINGS = "src/record/settings.def"
SETTINGS = "include/pelorus/settings.h"
PAGES = ("docs/REPLAY-FORMAT.md", "docs/STATE-FORMAT.md", "docs/SUPERVISION.md")
TABLE = re.compile(r"(?<=<!-- table: )(\w+) -->\n(.*?)(?=<!-- end -->)", re.DOTALL)


def printed(program: str, *arguments: str) -> str:
    """What the program prints."""
    return subprocess.run([program, *arguments], capture_output=True, text=True, check=True).stdout


def expected(root: Path, program: str) -> dict[Path, str]:
    """Each file as it should be."""
    files = {root / SCHEMA: printed(program, "json")}
    for page in (root / name for name in PAGES):
        text = page.read_text(encoding="utf-8")
        if not TABLE.search(text):
            raise SystemExit(f"{page}: holds no <!-- table: NAME --> any more")
        files[page] = TABLE.sub(
            lambda found: f"{found[1]} -->\n{printed(program, 'markdown', found[1])}", text
        )
    rows, header = (
        (root / name).read_text(encoding="utf-8") for name in (TABLE_OF_SETTINGS, SETTINGS)
    )
    files[root / SETTINGS] = header_from(rows, header)
    return files


def tables_without_a_place(files: dict[Path, str]) -> list[str]:
    """Messages whose table no page shows."""
    shown = {found[1] for text in files.values() for found in TABLE.finditer(text)}
    schema = next(text for path, text in files.items() if path.suffix == ".json")
    named = re.findall(r'"kind": \d+, "name": "(\w+)"', schema)
    wanted = {
        *named,
        "kinds",
        "settings",
        "statuses",
        "reasons",
        "sensors",
        "state",
        "slot",
        "bounds",
        "imu_faults",
    }
    return sorted(wanted - shown)


def main() -> int:
    """Compares, or writes; the exit status."""
    if len(sys.argv) not in (3, 4) or sys.argv[3:] not in ([], ["--write"]):
        print(__doc__, file=sys.stderr)
        return 2
    root = Path(sys.argv[1]).resolve()
    files = expected(root, sys.argv[2])
    wrong = 0
    for path, text in files.items():
        if path.is_file() and path.read_text(encoding="utf-8") == text:
            continue
        if sys.argv[3:]:
            path.write_text(text, encoding="utf-8")
            print(f"{path}: written")
        else:
            wrong += 1
            print(f"{path}: is not what the tables say; {sys.argv[0]} ... --write does it")
    for fault in faults_of(
        (root / TABLE_OF_SETTINGS).read_text(encoding="utf-8"), files[root / SETTINGS]
    ):
        wrong += 1
        print(fault)
    for name in tables_without_a_place(files):
        wrong += 1
        print(f"no page has the table {name}: <!-- table: {name} --> and <!-- end --> make one")
    print(f"{len(files)} files, {wrong} differences")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
