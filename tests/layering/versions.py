#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The version stands in several places, of which each is the first that somebody reads: CMake's,
the library's, the Python package's, and what other build systems are told; the number of the
arithmetic in two. They must agree.

usage: versions.py PROJECT_ROOT
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

VERSION = {
    "CMakeLists.txt": r"project\(pelorus VERSION ([0-9.]+)",
    "library.json": r'"version": "([0-9.]+)"',
    "idf_component.yml": r'version: "([0-9.]+)"',
    "conanfile.py": r'version = "([0-9.]+)"',
    "src/record/words.c": r'plr_version\(void\) {\s*return "([0-9.]+)"',
    "tools/pelorus/__init__.py": r'__version__ = "([0-9.]+)"',
}
ARITHMETIC = {
    "include/pelorus/config.h": r"#define PLR_ARITHMETIC ([0-9]+)",
    "tools/pelorus/__init__.py": r"ARITHMETIC = ([0-9]+)",
}


def agree(root: Path, places: dict[str, str]) -> bool:
    """Whether all places say the same, and something."""
    found = set()
    for place, pattern in places.items():
        match = re.search(pattern, (root / place).read_text(encoding="utf-8"))
        said = match.group(1) if match else "none found"
        print(f"{said}  {place}")
        found.add(said)
    return len(found) == 1 and "none found" not in found


def main() -> int:
    """Compares them; the exit status."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    root = Path(sys.argv[1])
    return 0 if all([agree(root, VERSION), agree(root, ARITHMETIC)]) else 1


if __name__ == "__main__":
    sys.exit(main())
