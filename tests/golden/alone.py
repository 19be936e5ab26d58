# SPDX-License-Identifier: MIT
"""The estimator alone beside the whole filter.

usage: alone.py REPLAY REPLAY-ALONE

Alone: PLR_SUPERVISE=0, PLR_KNOWN_MAP=0, PLR_MAX_CALIBRATION=0. On the golden drives, where nothing
goes wrong, each pose is the same to the bit. What it is asked for and does not have, it names.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

DRIVES = ("drive.plr", "imu.plr")
LACKS = {
    ("--calibrate", "focal"): "PLR_MAX_CALIBRATION",
    ("--known-map", "on"): "PLR_KNOWN_MAP",
    ("--mode", "localization"): "PLR_KNOWN_MAP",
    ("--scene", "may-move"): "PLR_SUPERVISE",
}


def trajectory(replay: str, drive: Path) -> bytes:
    """Poses of the drive, as the replay writes them."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.tum"
        subprocess.run([replay, str(drive), "--quiet", "--trajectory", str(out)], check=True)
        return out.read_bytes()


def main() -> None:
    """Compares both on each drive."""
    whole, alone = sys.argv[1:]
    for name in DRIVES:
        drive = Path(__file__).parent / name
        poses = trajectory(whole, drive)
        if poses.count(b"\n") < 20:
            sys.exit(f"{name}: the replay wrote no trajectory")
        if trajectory(alone, drive) != poses:
            sys.exit(f"{name}: the estimator alone goes another way than the whole filter")
        print(f"{name}: the same to the bit")
    for asked, option in LACKS.items():
        command = [alone, "--print-config", *asked]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0 or option not in done.stderr:
            sys.exit(f"{' '.join(asked)}: is not refused, or does not say {option}: {done.stderr}")


main()
