# SPDX-License-Identifier: MIT
"""The board computes what the desk computes, to the bit."""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path

import pytest
from desk import desktop_poses, digest
from pelorus.robot.emulator import Emulator
from pelorus.robot.stream import Streamer
from pelorus.wire.frames import Pose, Stereo
from pelorus.wire.framing import read_file

SLOTS, OBSERVATIONS = 32, 128  # of the images and of the desktop's builds
GOLDEN = Path(__file__).resolve().parents[1] / "golden"
FULL = -10  # plr_status
FLOAT64_BOARD = "mps2_an500"  # the M7's FPU has it


def board_poses(board: str, image: Path, recording: Path) -> list[Pose]:
    messages = [frame.message for frame in read_file(recording)[0]]
    with Emulator(board, image) as emulator:
        link = emulator.connect()
        outcome = Streamer(link).run(messages)
        link.close()
    frames = [message for message in messages if isinstance(message, Stereo)]
    too_long = sum(len(frame.ids) > OBSERVATIONS for frame in frames)  # sequence 03 has one
    assert outcome.unanswered == 0
    assert outcome.frames == len(frames)
    assert outcome.reports[FULL] == too_long
    assert outcome.reports[0] == len(outcome.poses) == len(frames) - too_long
    return outcome.poses


def same_bits(program: Path, recording: Path, board_answer: list[Pose]) -> None:
    """The poses of a desktop's replay and of a board."""
    poses = desktop_poses(recording, program, SLOTS, OBSERVATIONS)
    differ = [k for k, (a, b) in enumerate(zip(poses, board_answer, strict=True)) if a != b]
    assert not differ, f"pose {differ[0]} is the first that differs"
    assert poses
    assert digest(poses) == digest(board_answer)
    print(f"\n{len(board_answer)} poses, SHA-256 {digest(board_answer)}")


def test_float32(program: Path, board: str, firmware: Path, recording: Path) -> None:
    same_bits(program, recording, board_poses(board, firmware, recording))


@pytest.mark.boards(FLOAT64_BOARD)
def test_float64(desktop: Path, board: str, robot: Path, recording: Path) -> None:
    image = robot / "images" / f"pelorus-{board}-n{SLOTS}-f64.elf"
    same_bits(desktop / "pelorus-replay-f64", recording, board_poses(board, image, recording))


@pytest.mark.spread
def test_the_golden_drive_has_the_sum_that_the_page_in_the_browser_shows(
    program: Path, board: str, firmware: Path, tmp_path: Path
) -> None:
    drive, path = GOLDEN / "drive.plr", tmp_path / "path.tum"
    same_bits(program, drive, board_poses(board, firmware, drive))
    command = [str(program), str(drive), "--slots", str(SLOTS), "--trajectory", str(path)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    golden = (GOLDEN / "drive.sha256").read_text().strip()
    assert hashlib.sha256(path.read_bytes()).hexdigest() == golden
