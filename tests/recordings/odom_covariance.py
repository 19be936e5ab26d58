# SPDX-License-Identifier: MIT
"""Is the covariance of /odom that of its errors, in the axes that REP-103 says?

usage: odom_covariance.py [--drives 200]

Simulated drives of a robot whose base is turned and half a metre off the body, each told its start
with an error. NEES by degree of freedom over all, of the whole and of each block: 1 is expected,
0.9 to 1.1 the bar for 200 drives; the exit status is 1 beyond. PELORUS_BIN says where the library
is, by default build/bin.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "python"), str(ROOT / "port" / "ros2" / "pelorus_ros")]

from odom_samples import nees, sample  # noqa: E402 - found by the line above
from pelorus.console import progress  # noqa: E402

BAR = (0.9, 1.1)


def main() -> int:
    """Prints the three means."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--drives", type=int, default=200)
    drives = parser.parse_args().drives
    found = nees([sample(seed) for seed in progress(range(1, drives + 1), "drives", drives)])
    print(f"{drives} drives: NEES/6 {found.whole:.3f}, ", end="")
    print(f"position {found.position:.3f}, rotation {found.rotation:.3f} (NEES/3)")
    return int(not all(BAR[0] < value < BAR[1] for value in found))


if __name__ == "__main__":
    sys.exit(main())
