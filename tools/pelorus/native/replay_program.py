# SPDX-License-Identifier: MIT
"""The commands `pelorus-replay` and `pelorus-replay-f64`, which pip puts on the PATH.

They become the program in C, which is in the package or in build/bin.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from pelorus.native import binding


def program(name: str) -> Path | None:
    """Returns the first of that name where `binding.folders` looks; None if it is in none."""
    places = (folder / f"{name}{binding.EXE}" for folder in binding.folders(None))
    return next((path for path in places if path.is_file()), None)


def _become(name: str) -> int:
    found = program(name)
    if found is None:
        where = ", ".join(map(str, binding.folders(None)))
        print(f"{name}: is in none of {where}: build it, or name its folder in PELORUS_BIN",
              file=sys.stderr)  # fmt: skip
        return 1
    command = [str(found), *sys.argv[1:]]
    if not binding.EXE:  # elsewhere exec would return to the shell at once
        os.execv(command[0], command)
    return subprocess.run(command, check=False).returncode


def float32() -> int:
    """Runs pelorus-replay; returns its exit status."""
    return _become("pelorus-replay")


def float64() -> int:
    """Runs pelorus-replay-f64; returns its exit status."""
    return _become("pelorus-replay-f64")
