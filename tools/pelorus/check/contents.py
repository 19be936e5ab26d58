# SPDX-License-Identifier: MIT
"""Reads a .plr file as a `Recording` for examination, and cuts parts of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from pelorus.errors import PelorusError
from pelorus.evaluate.inertial_survey import readings_of
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math import inertial
from pelorus.math.inertial import Inertial
from pelorus.wire.frames import Imu, Kind, Message, Process, Reading, Start, Stereo, Twist
from pelorus.wire.framing import Writer, encode, header_of_messages


def recording_of(messages: Sequence[Message], process: Process | None = None) -> Recording:
    """Returns header, twists or IMU readings, and tracks of the messages.

    What a filter would refuse is left out: pixels that are not finite and times that do not ascend.
    `process` is the HEADER's if not given.
    """
    header = header_of_messages(messages)
    by_imu = (process or header.process) is Process.IMU
    twists = [] if by_imu else _ascending([m for m in messages if isinstance(m, Twist)])
    readings = [m for m in messages if isinstance(m, Imu)] if by_imu else []
    frames = _ascending([m for m in messages if isinstance(m, Stereo)])
    if not (twists or readings) or not frames:
        moved = "readings of an IMU" if by_imu else "twists"
        lacks = "stereo frames" if twists or readings else moved
        raise PelorusError(f"the recording holds no {lacks}: there is nothing to check")
    frame = np.repeat(np.arange(len(frames)), [len(m.ids) for m in frames])
    ids = np.concatenate([m.ids for m in frames]).astype(np.int64)
    if not len(ids):
        raise PelorusError(
            "no frame of the recording shows a point: there is nothing to check; pelorus evaluate "
            "compares it with a truth"
        )
    pixels = np.concatenate([m.pixels for m in frames]).astype(np.float64).reshape(-1, 4)
    good = np.isfinite(pixels).all(axis=1)
    return Recording(
        header,
        np.array([m.t_ns for m in twists], np.int64),
        np.array([m.v_B_mps for m in twists], np.float64).reshape(-1, 3),
        np.array([m.w_B_radps for m in twists], np.float64).reshape(-1, 3),
        np.array([m.t_ns for m in frames], np.int64),
        Tracks.from_rows(len(frames), frame[good], ids[good], pixels[good]),
        inertial=_in_order(readings) if by_imu else inertial.NO_READINGS,
        readings=[m for m in messages if isinstance(m, Reading)],
    )


def _in_order(messages: Sequence[Imu]) -> Inertial:
    """Returns the readings whose times ascend."""
    readings = readings_of(messages)
    newest = np.maximum.accumulate(readings.t_ns)
    return readings.at(np.concatenate(([True], readings.t_ns[1:] > newest[:-1])))


Timed = TypeVar("Timed", Twist, Stereo)


def _ascending(messages: list[Timed]) -> list[Timed]:
    out: list[Timed] = []
    for message in messages:
        if not out or message.t_ns > out[-1].t_ns:
            out.append(message)
    return out


STEADY_NS = 2_000_000_000
SIDES: tuple[tuple[int, Literal["left", "right"]], ...] = ((-1, "left"), (1, "right"))
FRAMES_MOST, SEEN_MOST = 4000, 60_000  # enough to estimate the sigmas to 1 or 2 %
AHEAD = (Kind.HEADER, Kind.CONFIG, Kind.LANDMARK)  # belong to every part of a recording


def first_frames(messages: Sequence[Message], most: int = FRAMES_MOST) -> list[Message]:
    """Returns the recording's beginning, without truth, which must not be used, and without END."""
    out: list[Message] = []
    frames = seen = 0
    for message in messages:
        if isinstance(message, Stereo):
            frames, seen = frames + 1, seen + len(message.ids)
        if frames > most or seen > SEEN_MOST:
            break
        if message.kind not in (Kind.END, Kind.TRUTH, Kind.TEXT, Kind.STATE):
            out.append(message)
    return out


def half(messages: Sequence[Message], which: int) -> list[Message]:
    """Returns the first (0) or the second (1) half of the frames with the messages between them."""
    at = [k for k, m in enumerate(messages) if isinstance(m, Stereo)]
    middle = at[len(at) // 2]
    if which == 0:
        return list(messages[:middle])
    ahead = [m for m in messages[:middle] if m.kind in AHEAD]
    return [*ahead, *messages[middle:]]


def shifted(messages: Sequence[Message], offset_ns: int) -> list[Message]:
    """Returns the messages, sorted, with the frames later by the offset."""
    ahead = [m for m in messages if m.kind in AHEAD or isinstance(m, Start)]
    data: list[tuple[int, int, Message]] = []
    for message in messages:
        if isinstance(message, Stereo):
            moved = message.t_ns + offset_ns
            if moved >= 0:  # nothing can be predicted to a time before zero
                data.append((moved, 2, replace(message, t_ns=moved)))
        elif isinstance(message, Twist | Reading):
            data.append((message.t_ns, isinstance(message, Reading), message))
    readings = [m for m in messages if isinstance(m, Imu)]
    if readings:
        cuts = np.unique([t for t, _, _ in data]).astype(np.int64)
        data += [(t, 0, m) for t, m in inertial.messages(_in_order(readings), cuts)]
    return [*ahead, *(m for _, _, m in sorted(data, key=lambda row: row[:2]))]


def scaled(messages: Sequence[Message], times: float) -> list[Message]:
    """Returns the messages with the twists' velocities multiplied by `times`, and their noise as it
    was.

    Scaled noise would favour the factor that shrinks it. So the added velocity is their mean over
    seconds.
    """
    twists = [m for m in messages if isinstance(m, Twist)]
    if times == 1 or not twists:
        return list(messages)
    v = np.array([m.v_B_mps for m in twists], np.float64)
    t = np.array([m.t_ns for m in twists], np.int64)
    first, last = (np.searchsorted(t, t + sign * STEADY_NS // 2, side) for sign, side in SIDES)
    total = np.concatenate((np.zeros((1, 3)), np.cumsum(v, axis=0)))
    mean = (total[last] - total[first]) / np.maximum(last - first, 1)[:, None]
    moved = iter(v + (times - 1) * mean)
    return [replace(m, v_B_mps=next(moved)) if isinstance(m, Twist) else m for m in messages]


def not_before(messages: Sequence[Message], t_ns: int) -> list[Message]:
    """Returns all messages later, none before t_ns, so that every offset moves the same frames."""
    timed = (Stereo, Twist, Imu, Reading, Start)
    least = min((m.t_ns for m in messages if isinstance(m, timed)), default=t_ns)
    later = max(t_ns - least, 0)
    return [replace(m, t_ns=m.t_ns + later) if isinstance(m, timed) else m for m in messages]


def within(messages: Sequence[Message], margin_ns: int) -> list[Message]:
    """Returns the messages without frames that lack a reading on either side at any offset up to
    the margin.

    So all offsets are judged by the same frames. If few would be left, all are kept.
    """
    times = [t for m in messages for t in _reading_times(m)]
    if not times:
        return list(messages)
    first, last = min(times) + margin_ns, max(times) - margin_ns
    kept = [m for m in messages if not isinstance(m, Stereo) or first < m.t_ns < last]
    frames = [sum(isinstance(m, Stereo) for m in some) for some in (kept, messages)]
    return kept if 2 * frames[0] > frames[1] else list(messages)


def _reading_times(message: Message) -> list[int]:
    if isinstance(message, Twist):
        return [message.t_ns]
    return message.times_ns if isinstance(message, Imu) else []


class Frames:
    """Writes recordings that share messages; makes a frame once for each place in a file."""

    def __init__(self, messages: Sequence[Message]) -> None:
        self._shared = {id(message): message for message in messages}  # kept, so that ids hold
        self._made: dict[tuple[int, int], bytes] = {}

    def write(self, path: Path, messages: Sequence[Message]) -> None:
        """Writes these messages, shared or not, as a recording."""
        with path.open("wb") as stream:
            writer = Writer(stream)
            for sequence, message in enumerate(messages):
                if id(message) not in self._shared:
                    writer.write(message)
                    continue
                key = id(message), sequence
                if key not in self._made:
                    self._made[key] = encode(message, sequence)
                writer.write_frame(message.kind, self._made[key])
            writer.end()
