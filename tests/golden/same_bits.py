#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Do the replays of several builds compute the same bits?

usage: same_bits.py BUILD_FOLDER BUILD_FOLDER...

Each build's pelorus-replay and pelorus-replay-f64 are given a simulated recording of twists, one
of an IMU and, where $PELORUS_DATA has it, Starry Night. Every POSE that they write (position,
rotation, covariance, velocity, bias) must be the same in all builds, to the bit.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from pelorus.wire.frames import Pose
from pelorus.wire.framing import read_file

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("PELORUS_DATA", ROOT.parent / "shared" / "data"))
STARRY_NIGHT = DATA / "starry-night" / "dataset3.mat"
PROGRAMS = ("pelorus-replay", "pelorus-replay-f64")
TWISTS = {
    "body": ["--bias", "on", "--slots", "50"],
    "world": ["--model", "world", "--slots", "20", "--max-depth", "20"],
    "dead reckoning": ["--mode", "dead_reckoning"],
}
IMU = {
    "start given": ["--slots", "50"],
    "start in motion": ["--slots", "50", "--imu-start", "motion"],
    "calibrated": [  # the simulation says that its camera is exact
        *("--slots", "50", "--calibrate", "focal,baseline,turn"),
        *("--focal-sigma", "0.005", "--baseline-sigma", "0.005", "--camera-turn-sigma", "0.003"),
    ],
}
SIMULATED = ("simulate", "--seed", "11", "--duration", "20")
BY_IMU = ("--imu-rate", "400", "--wheel-rate", "20")


def make_recordings(folder: Path) -> dict[Path, dict[str, list[str]]]:
    """The recordings to replay, made anew, each with its settings."""
    wanted = {"simulated.plr": SIMULATED, "imu.plr": (*SIMULATED, *BY_IMU)}
    if STARRY_NIGHT.exists():
        wanted["starry-night.plr"] = ("convert", "starry-night", str(STARRY_NIGHT))
    else:
        print(f"skipped: {STARRY_NIGHT} is not there")
    for name, words in wanted.items():
        command = [sys.executable, "-m", "pelorus", *words, str(folder / name)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return {folder / name: IMU if name == "imu.plr" else TWISTS for name in wanted}


def replay_digest(program: Path, recording: Path, settings: list[str]) -> tuple[str, int]:
    """SHA-256 over the poses that a replay writes, and their number."""
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        answers = Path(folder) / "answers.plr"
        command = [str(program), str(recording), *settings, "--quiet", "--out", str(answers)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        frames, _ = read_file(answers)
    poses = [frame.message for frame in frames if isinstance(frame.message, Pose)]
    return hashlib.sha256(b"".join(pose.pack() for pose in poses)).hexdigest(), len(poses)


def agree(
    builds: list[Path], program: str, recording: Path, name: str, settings: list[str]
) -> bool:
    """Replays one recording with one setting in all builds, and compares."""
    found = {build: replay_digest(build / "bin" / program, recording, settings) for build in builds}
    same = len(set(found.values())) == 1 and all(count > 0 for _, count in found.values())
    first, count = found[builds[0]]
    print(f"{program}, {recording.stem}, {name}: {count} poses, SHA-256 {first[:16]}...", end=" ")
    print("the same in all builds" if same else "NOT the same:")
    if not same:
        for build, (this, number) in found.items():
            print(f"  {this[:16]}... {number} poses in {build}")
    return same


def main() -> int:
    """Compares all builds; the exit status."""
    builds = [Path(word) for word in sys.argv[1:]]
    if len(builds) < 2:
        print(__doc__, file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        results = [
            agree(builds, program, recording, name, words)
            for recording, settings in make_recordings(Path(folder)).items()
            for program in PROGRAMS
            for name, words in settings.items()
        ]
    print(f"{sum(results)} passed, {len(results) - sum(results)} failed in {len(builds)} builds")
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
