#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What a caller reserves has the size that the library expects, though the two are built with other
flags: only the options of config.h may change it.

usage: layout.py PROJECT_ROOT

Exit status 77 (skipped) where there is no gcc.
"""

from __future__ import annotations

import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

SKIPPED = 77
TYPES = ("plr_filter", "plr_session", "plr_reader", "plr_writer", "plr_message", "plr_report")
VARIANTS = [["-std=c99"], ["-std=gnu11", "-O3"], ["-std=c99", "-O0"]]
X86_VARIANTS = [["-std=c99", f"-march={arch}"] for arch in ("x86-64-v2", "x86-64-v3", "x86-64-v4")]
PROBE = (
    '#include "pelorus/pelorus.h"\n#include "pelorus/session.h"\n#include "pelorus/wire.h"\n'
    + "".join(f"char probe_{name}[sizeof({name})] = {{1}};\n" for name in TYPES)
)
SIZE = re.compile(r"\.size\s+probe_(\w+), (\d+)")


def sizes(root: Path, flags: list[str]) -> dict[str, str]:
    """The size of each type under these flags, as the assembler is told."""
    done = subprocess.run(
        ["gcc", *flags, f"-I{root / 'include'}", "-x", "c", "-S", "-o", "-", "-"],
        input=PROBE,
        capture_output=True,
        text=True,
        check=True,
    )
    return dict(SIZE.findall(done.stdout))


def main() -> int:
    """Compares the variants; the exit status."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    if not shutil.which("gcc"):
        print("skipped: no gcc")
        return SKIPPED
    root = Path(sys.argv[1]).resolve()
    variants = VARIANTS + (X86_VARIANTS if platform.machine() == "x86_64" else [])
    expected = sizes(root, variants[0])
    breaches = 0
    for flags in variants[1:]:
        found = sizes(root, flags)
        for name in TYPES:
            if found[name] != expected[name]:
                print(
                    f"{name}: {expected[name]} bytes with {' '.join(variants[0])}, "
                    f"{found[name]} with {' '.join(flags)}"
                )
                breaches += 1
    print(", ".join(f"{name} {size} bytes" for name, size in expected.items()))
    print(f"{len(variants)} variants, {breaches} breaches")
    return 1 if breaches or len(expected) != len(TYPES) else 0


if __name__ == "__main__":
    sys.exit(main())
