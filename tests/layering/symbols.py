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

ALLOWED = {"memcpy", "memmove", "memset", "memcmp", "strcmp", "strlen"}
# Put there by the compiler or linker, not by a source.
MACHINERY = {"_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}


def symbols(nm: str, library: str) -> list[tuple[str, str]]:
    """(type letter, name) of every symbol."""
    lines = subprocess.run(
        [nm, library], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    words = [line.split() for line in lines if line.strip() and not line.endswith(":")]
    return [(word[-2], word[-1]) for word in words if len(word) >= 2]


def breaches(found: list[tuple[str, str]]) -> list[str]:
    """A sentence for every symbol that should not be there."""
    defined = {name for letter, name in found if letter not in "Uw"}
    texts = []
    for letter, name in sorted(set(found)):
        if letter in "Uw" and name not in defined | ALLOWED | MACHINERY:
            texts.append(f"needs {name} from outside")
        if letter in "dDbBCsSgG":
            texts.append(f"{name} is writable data (nm: {letter})")
        if letter in "TRDBVW" and not name.startswith("plr_"):
            texts.append(f"defines {name}, which does not begin with plr_")
    return texts


def main() -> int:
    """Looks at one library; the exit status."""
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    found = symbols(sys.argv[1], sys.argv[2])
    texts = breaches(found)
    for text in texts:
        print(f"{sys.argv[2]}: {text}")
    functions = sum(letter == "T" for letter, _ in found)
    print(f"{functions} functions, {len(texts)} breaches")
    return 1 if texts or functions == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
