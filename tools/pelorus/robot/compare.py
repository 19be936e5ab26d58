# SPDX-License-Identifier: MIT
"""Do two filters agree to the bit? The desktop's replay against what a board answered."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pelorus.errors import PelorusError
from pelorus.frames import OBSERVATIONS_MAX, Kind, Message, Pose, Stereo
from pelorus.replay import SOURCE_ROOT, run_program
from pelorus.wire import Writer, read_file

REPLAYS = {4: Path("build/bin/pelorus-replay"), 8: Path("build/bin/pelorus-replay-f64")}


def digest(poses: Iterable[Pose]) -> str:
    """SHA-256 over the payloads of the poses, in hexadecimal."""
    total = hashlib.sha256()
    for pose in poses:
        total.update(pose.pack())
    return total.hexdigest()


@dataclass(frozen=True)
class Comparison:
    """The poses after each frame, here and there."""

    desktop: list[Pose]
    board: list[Pose]

    @property
    def equal(self) -> bool:
        return bool(self.desktop) and digest(self.desktop) == digest(self.board)

    @property
    def first_difference(self) -> int | None:
        """The number of the first pose that differs, or that only one side has."""
        for number, (ours, theirs) in enumerate(zip(self.desktop, self.board, strict=False)):
            if ours != theirs:
                return number
        shorter = min(len(self.desktop), len(self.board))
        return None if len(self.desktop) == len(self.board) else shorter


def replay_program(real_bytes: int, program: Path | None) -> Path:
    """The desktop replay of that precision: the given one, or that of the usual build folder."""
    name = REPLAYS[real_bytes]
    candidates = (program,) if program else (name, SOURCE_ROOT / name)
    for candidate in candidates:
        if candidate.exists():
            return candidate
    raise PelorusError(f"{candidates[0]}: no such program; build it, or give --replay")


def desktop_poses(
    recording: Path, program: Path, slots: int, observations: int = OBSERVATIONS_MAX
) -> list[Pose]:
    """Replay a recording on this machine, with a board's capacities.

    As many landmark slots, and without the frames that it refuses: of more observations than fit.
    """
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        taken = _without_long_frames(recording, observations, Path(folder))
        messages = desktop_log(taken, program, ["--slots", str(slots)])
    return [message for message in messages if isinstance(message, Pose) and message.after_stereo]


def desktop_log(recording: Path, program: Path, options: Sequence[str] = ()) -> list[Message]:
    """Replay a recording on this machine: its inputs and what the filter answered."""
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        answers = Path(folder) / "answers.plr"
        run_program(program, recording, ["--quiet", *options, "--out", str(answers)])
        received, _ = read_file(answers)
    return [frame.message for frame in received]


def _without_long_frames(recording: Path, most: int, folder: Path) -> Path:
    """The recording, or a copy without STEREO of more than `most` observations."""
    messages = [frame.message for frame in read_file(recording)[0]]
    short = [m for m in messages if not (isinstance(m, Stereo) and len(m.ids) > most)]
    if len(short) == len(messages):
        return recording
    copy = folder / "short.plr"
    write_recording(copy, short)
    return copy


def write_recording(path: Path, messages: Iterable[Message]) -> None:
    """The messages as a recording, with an END of their own."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        for message in messages:
            if message.kind != Kind.END:
                writer.write(message)
        writer.end()
