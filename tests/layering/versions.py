#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The version stands in three places, of which each is the first that somebody reads: CMake's, the
library's and the Python package's. They must agree.

usage: versions.py PROJECT_ROOT
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

PLACES = {
    "CMakeLists.txt": r"project\(pelorus VERSION ([0-9.]+)",
    "src/filter/status.c": r'plr_version\(void\) {\s*return "([0-9.]+)"',
    "tools/pelorus/__init__.py": r'__version__ = "([0-9.]+)"',
}


def main() -> int:
    """Compares them; the exit status."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    root = Path(sys.argv[1])
    versions = set()
    for place, pattern in PLACES.items():
        match = re.search(pattern, (root / place).read_text(encoding="utf-8"))
        version = match.group(1) if match else "none found"
        print(f"{version}  {place}")
        versions.add(version)
    return 0 if len(versions) == 1 and "none found" not in versions else 1


if __name__ == "__main__":
    sys.exit(main())
