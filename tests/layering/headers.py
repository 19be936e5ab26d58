#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compiles every public header alone, as C99 and as C++17, by every compiler at hand.

usage: headers.py PROJECT_ROOT
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

C_COMPILERS = ("gcc", "clang", "clang-14")
CXX_COMPILERS = ("g++", "clang++", "clang++-14")
WARNINGS = ["-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Wshadow", "-Werror"]
C_FLAGS = ["-std=c99", *WARNINGS, "-Wdouble-promotion", "-Wvla", "-Wmissing-prototypes"]
CXX_FLAGS = ["-std=c++17", *WARNINGS]


def compile_alone(compiler: str, flags: list[str], language: str, root: Path, header: Path) -> bool:
    """True if a file that holds nothing but the include compiles without a warning."""
    name = header.relative_to(root / "include")
    result = subprocess.run(
        [compiler, *flags, f"-I{root / 'include'}", "-x", language, "-fsyntax-only", "-"],
        input=f'#include "{name}"\n',
        capture_output=True,
        text=True,
        check=False,
    )
    if result.returncode != 0:
        print(f"{name} does not compile alone by {compiler} {flags[0]}:\n{result.stderr}")
    return result.returncode == 0


def main() -> int:
    """Compiles them all; the exit status."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    root = Path(sys.argv[1]).resolve()
    headers = sorted((root / "include/pelorus").glob("*.h"))
    passed = failed = 0
    for compilers, flags, language in (
        (C_COMPILERS, C_FLAGS, "c"),
        (CXX_COMPILERS, CXX_FLAGS, "c++"),
    ):
        present = [compiler for compiler in compilers if shutil.which(compiler)]
        if not present:
            print(f"no compiler for {language} here: not checked ({', '.join(compilers)})")
        for compiler in present:
            for real in (32, 64):
                for header in headers:
                    ok = compile_alone(
                        compiler, [*flags, f"-DPLR_REAL={real}"], language, root, header
                    )
                    passed, failed = passed + ok, failed + (not ok)
    print(f"{passed} compiled, {failed} did not")
    return 1 if failed or passed == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
