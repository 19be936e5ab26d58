# SPDX-License-Identifier: MIT
"""Runs an image that replays pictures on an emulated board, and the same recording at the desk.

usage: python -m firmware.eyes BOARD IMAGE.elf RECORDING.plr PELORUS-REPLAY

Prints instructions of each pair and what both saw; exit status 1 where one bit differs.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pelorus.wire.frames import Pose, Stereo
from pelorus.wire.framing import messages_of

from firmware.image import measured

ROW = np.dtype([("id", "<u4"), ("pixels", "<f4", 4), ("sigma", "<f4")])


@dataclass(frozen=True)
class Pair:
    """A pair of pictures: CRC of observations, and of pose and covariance."""

    t_ns: int
    seen: int
    pose: int


@dataclass(frozen=True)
class Board:
    """The result of an image."""

    pairs: list[Pair]
    look: list[float]  # instructions of eyes, a pair
    update: list[float]  # of the filter
    eyes_bytes: int
    session_bytes: int
    stack: int


def on_board(board: str, image: Path) -> Board:
    """Runs the image."""
    found = measured(board, image)
    return Board(
        [Pair(row["pair"], row["seen"], row["pose"]) for row in found.rows],
        [row["look"] * found.instructions_per_clock for row in found.rows],
        [row["update"] * found.instructions_per_clock for row in found.rows],
        found.sizes["eyes"],
        found.sizes["session"],
        found.stack_bytes,
    )


def at_desk(program: Path, recording: Path) -> list[Pair]:
    """Replays the recording, and reads its log."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.plr"
        subprocess.run([program, recording, "--out", log, "--quiet"], check=True)
        messages = messages_of(log)
    poses = {m.t_ns: m for m in messages if isinstance(m, Pose) and m.after_stereo}
    return [
        Pair(m.t_ns, zlib.crc32(_rows(m)), zlib.crc32(_numbers(poses[m.t_ns])))
        for m in messages
        if isinstance(m, Stereo)
    ]


def _rows(stereo: Stereo) -> bytes:
    """Returns the observations as a plr_observation holds them."""
    rows = np.zeros(len(stereo.ids), ROW)
    rows["id"], rows["pixels"] = stereo.ids, stereo.pixels
    if stereo.sigmas is not None:
        rows["sigma"] = stereo.sigmas
    return rows.tobytes()


def _numbers(pose: Pose) -> bytes:
    """Returns the pose and its covariance as doubles, as a plr_pose_message holds them."""
    parts = (pose.R_WB, pose.p_WB_m, pose.covariance)
    return b"".join(np.ascontiguousarray(part, "<f8").tobytes() for part in parts)


def main() -> int:
    """Prints what a pair costs; the exit status."""
    board, image, recording, program = sys.argv[1:5]
    found = on_board(board, Path(image))
    desk = at_desk(Path(program), Path(recording))
    print(f"{'pair, s':>9}{'eyes, Minstr':>14}{'filter':>9}   the desk's bits")
    for pair, other, look, update in zip(found.pairs, desk, found.look, found.update, strict=False):
        same = "same" if pair == other else "DIFFER"
        print(f"{pair.t_ns * 1e-9:9.3f}{look * 1e-6:14.2f}{update * 1e-6:9.2f}   {same}")
    later = found.look[1:]
    print(
        f"eyes: {np.mean(later) * 1e-6:.2f} million instructions a pair, "
        f"{max(later) * 1e-6:.2f} at most, {found.look[0] * 1e-6:.2f} the first, all births; "
        f"{found.eyes_bytes} bytes of eyes and "
        f"{found.session_bytes} of session; stack {found.stack} bytes"
    )
    return 0 if found.pairs == desk else 1


if __name__ == "__main__":
    sys.exit(main())
