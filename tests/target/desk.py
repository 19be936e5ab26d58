# SPDX-License-Identifier: MIT
"""What this machine computes of a recording, as a board with its capacities would."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from pelorus.native.replay import replayed
from pelorus.wire.frames import Pose, Stereo
from pelorus.wire.framing import messages_of


def digest(poses: Iterable[Pose]) -> str:
    """SHA-256 over the payloads of the poses, in hexadecimal."""
    return hashlib.sha256(b"".join(pose.pack() for pose in poses)).hexdigest()


def desktop_poses(recording: Path, program: Path, slots: int, observations: int) -> list[Pose]:
    """The poses after each frame, without the frames of more observations than fit."""
    inputs = [
        m
        for m in messages_of(recording)
        if not (isinstance(m, Stereo) and len(m.ids) > observations)
    ]
    answers = replayed(program, inputs, ["--slots", str(slots)])
    return [m for m in answers if isinstance(m, Pose) and m.after_stereo]
