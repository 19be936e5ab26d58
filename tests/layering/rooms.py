#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Holds the Python package in its rooms: who may import whom, and what stands in its root.

usage: rooms.py PROJECT_ROOT

A room is a folder of tools/pelorus, or a module of its root. Imports inside functions and those for
types alone count too. Prints every breach as file:line: what. Exit status 1 if there is any.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from sources import Breach

# The rooms from the lowest to the highest. Each may import those named here, which stand above it:
# so no way leads back. Everybody may ask `pelorus` for its version and its arithmetic.
ROOMS: dict[str, str] = {
    "errors": "",
    "program": "errors",
    "wire": "errors program",
    "math": "wire",
    "io": "errors wire math",
    "evaluate": "errors program wire math io",
    "tracking": "errors program wire math io",
    "rig": "errors program wire math io",
    "native": "errors program wire",
    "filter": "errors wire rig native",
    "tracker": "errors wire math rig native filter",
    "simulate": "errors program wire math io",
    "robot": "errors wire",
    "faults": "program wire math io evaluate tracking",
    "eyes": "errors program wire math io tracking rig native tracker",
    "converters": "errors program wire math io evaluate tracking rig tracker eyes faults",
    "online": "errors wire math io evaluate tracking rig native filter eyes faults converters",
    "live": "errors program wire math io evaluate tracking rig native robot eyes converters online",
    "check": "errors program wire math io evaluate tracking native faults converters",
    "explain": "errors wire math io evaluate tracking check",
    "flight": "errors wire native robot",
    "grid": "errors program wire math io",
    "view": "errors program wire math io evaluate",
    "report": "errors program wire math io evaluate tracking native converters check explain grid",
    "fleet": "errors program wire math io evaluate native check explain report",
    "commands": "errors program wire math io evaluate tracking rig native simulate robot eyes "
    "faults converters online live check explain flight grid view report fleet",
}
ROOT = {"__init__.py", "__main__.py", "errors.py", "filter.py", "tracker.py"}
VERSIONS = {"__version__", "ARITHMETIC"}


def rooms_imported(path: Path) -> Iterator[tuple[int, str]]:
    """Yields line and room of each import of the package."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == "pelorus":
            yield from ((node.lineno, a.name) for a in node.names if a.name not in VERSIONS)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pelorus."):
            yield node.lineno, str(node.module).split(".")[1]
        elif isinstance(node, ast.Import):
            found = (a.name.split(".") for a in node.names if a.name.startswith("pelorus."))
            yield from ((node.lineno, name[1]) for name in found)


def check_rooms(package: Path) -> Iterator[Breach]:
    """A room imports those that ROOMS allows it, and ROOMS allows none that it does not import."""
    for room, words in ROOMS.items():
        allowed, found = set(words.split()), set[str]()
        folder = package / room
        paths = sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]
        for path in paths:
            for line, name in rooms_imported(path):
                found.add(name)
                if name not in allowed | {room}:
                    yield Breach(path, line, f"{room} may not import {name}")
        for name in sorted(allowed - found):
            yield Breach(folder, 1, f"{room} is allowed {name}, and does not import it")


def check_table(package: Path) -> Iterator[Breach]:
    """Every room stands in ROOMS, above those that import it, and the root has the public API."""
    order = list(ROOMS)
    for k, (room, words) in enumerate(ROOMS.items()):
        for name in set(words.split()) - set(order[:k]):
            yield Breach(package / room, 1, f"{room} is allowed {name}, which is not above it")
    folders = {path.parent.name for path in package.glob("*/__init__.py")}
    for name in sorted(folders - set(order)):
        yield Breach(package / name, 1, "a room that stands in no table: ROOMS in rooms.py")
    for path in sorted(package.glob("*.py")):
        if path.name not in ROOT:
            yield Breach(path, 1, "the root is for the public API: put it into a room")


def main() -> int:
    """Runs all checks; the exit status."""
    package = Path(sys.argv[1]).resolve() / "tools/pelorus" if len(sys.argv) == 2 else None
    if package is None or not package.is_dir():
        print(__doc__, file=sys.stderr)
        return 2
    breaches = [*check_table(package), *check_rooms(package)]
    for breach in breaches:
        print(f"{breach.path.relative_to(package)}:{breach.line}: {breach.text}")
    print(f"{len(ROOMS)} rooms, {len(breaches)} breaches")
    return 1 if breaches else 0


if __name__ == "__main__":
    sys.exit(main())
