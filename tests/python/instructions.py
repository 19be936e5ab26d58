# SPDX-License-Identifier: MIT
"""Counts the instructions that fixed frames of `pelorus-bench --count` take, and keeps a table.

usage: instructions.py [--write]

Prints each count beside the table's (tests/bench/instructions.json); --write makes the table anew.
Valgrind's callgrind counts, so the machine and what else it does have no part in it, but compiler
and flags do: they are in the table.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "tests" / "bench" / "instructions.json"
MOST_CHANGE = 0.02

# name: landmarks, process, the call whose instructions count
CASES = {
    "frames by twists, N = 20": ("20", "twist", "plr_filter_update"),
    "frames by twists, N = 50": ("50", "twist", "plr_filter_update"),
    "frames by an IMU, N = 50": ("50", "imu", "plr_filter_update"),
    "readings of an IMU": ("20", "imu", "plr_filter_inertial"),
}
SETTINGS = ("CMAKE_BUILD_TYPE", "CMAKE_C_FLAGS", "PELORUS_ARCH", "PLR_BLOCK_OBSERVATIONS")


def made_by(build: Path) -> dict[str, str]:
    """Returns what the counts depend on besides the source: a build's compiler and flags."""
    (compiler,) = build.glob("CMakeFiles/*/CMakeCCompiler.cmake")
    found = dict(
        re.findall(r"set\((CMAKE_C_COMPILER_(?:ID|VERSION)) \"(.*)\"\)", compiler.read_text())
    )
    cache = (build / "CMakeCache.txt").read_text()
    for name in (*SETTINGS, "PLR_PORTABLE", "PLR_ASSERTIONS"):
        match = re.search(rf"^{name}:\w+=(.*)$", cache, re.MULTILINE)
        found[name] = match[1] if match else ""
    return found


def why_not(build: Path) -> str:
    """Returns why nothing can be counted in this build; empty if it can."""
    if not shutil.which("valgrind"):
        return "valgrind is not installed"
    if not (build / "bin" / "pelorus-bench").is_file():
        return "the build has no pelorus-bench"
    return ""


def count(build: Path, name: str) -> int:
    """Returns the instructions of one of CASES."""
    landmarks, process, call = CASES[name]
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [
                "valgrind",
                "--tool=callgrind",
                f"--callgrind-out-file={folder}/out",
                "--collect-atstart=no",
                f"--toggle-collect={call}",
                build / "bin" / "pelorus-bench",
                "--count",
                landmarks,
                process,
            ],
            capture_output=True,
            text=True,
            check=True,
        )
    collected = re.search(r"Collected : (\d+)", done.stderr)
    if not collected:
        raise ValueError(f"callgrind said of {name}: {done.stderr}")
    return int(collected[1])


def main() -> int:
    """Counts, prints, and writes the table if told to."""
    build = ROOT / "build"
    if reason := why_not(build):
        print(f"instructions.py: {reason}", file=sys.stderr)
        return 1
    before = json.loads(TABLE.read_text())["instructions"] if TABLE.exists() else {}
    counts = {}
    for name in CASES:
        counts[name] = count(build, name)
        print(f"{name:26} {counts[name]:>12,} {before.get(name, 0):>12,}", flush=True)
    if "--write" in sys.argv[1:]:
        table = {"made by": made_by(build), "instructions": counts}
        TABLE.write_text(json.dumps(table, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
