#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Looks into a built library: what it needs from outside, and whether it holds writable data.

usage: symbols.py NM LIBRARY

The library may need the memory and string functions that compilers call themselves, and nothing
else: no heap, no stdio, no mathematics. It has no writable data, so two filters can live side by
side and it needs nothing in RAM. It defines no name outside plr_.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass

ALLOWED = {"memcpy", "memmove", "memset", "memcmp", "bcmp", "strcmp", "strlen"}
# Put there by the compiler or linker, not by a source.
MACHINERY = {"_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
# Constants that hold addresses, in position-independent code: read-only once the loader has run.
RELOCATED_CONSTANTS = ".data.rel.ro"


@dataclass(frozen=True)
class Symbol:
    """One line of nm."""

    name: str
    letter: str
    section: str


def symbols(nm: str, library: str) -> list[Symbol]:
    """Every symbol of the library."""
    lines = subprocess.run(
        [nm, "--format=sysv", library], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    rows = [[cell.strip() for cell in line.split("|")] for line in lines]
    return [Symbol(row[0], row[2], row[6]) for row in rows if len(row) == 7]


def breaches(found: list[Symbol]) -> list[str]:
    """A sentence for every symbol that should not be there."""
    defined = {symbol.name for symbol in found if symbol.letter not in "Uw"}
    texts = set()
    for symbol in found:
        name, letter = symbol.name, symbol.letter
        if letter in "Uw" and name not in defined | ALLOWED | MACHINERY:
            texts.add(f"needs {name} from outside")
        if letter in "dDbBCsSgG" and not symbol.section.startswith(RELOCATED_CONSTANTS):
            texts.add(f"{name} is writable data (section {symbol.section})")
        if letter in "TRDBVWC" and not name.startswith("plr_"):
            texts.add(f"defines {name}, which does not begin with plr_")
    return sorted(texts)


def main() -> int:
    """Looks at one library; the exit status."""
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    found = symbols(sys.argv[1], sys.argv[2])
    texts = breaches(found)
    for text in texts:
        print(f"{sys.argv[2]}: {text}")
    functions = sum(symbol.letter == "T" for symbol in found)
    print(f"{functions} functions, {len(texts)} breaches")
    return 1 if texts or functions == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
