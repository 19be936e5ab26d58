# SPDX-License-Identifier: MIT
"""A .plr file as a `Recording`, what the examinations of tracks and twists work on; and parts of it
to be replayed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from pelorus.errors import PelorusError
from pelorus.frames import Kind, Message, Reading, Start, Stereo, Twist
from pelorus.recording import Recording
from pelorus.tracks import Tracks
from pelorus.wire import Writer, header_of_messages


def recording_of(messages: Sequence[Message]) -> Recording:
    """Header, twists and tracks. What a filter would refuse, pixels that are not finite and times
    that do not ascend, is left out.
    """
    twists = _ascending([m for m in messages if isinstance(m, Twist)])
    frames = _ascending([m for m in messages if isinstance(m, Stereo)])
    if not twists or not frames:
        lacks = "twists" if not twists else "stereo frames"
        raise PelorusError(f"the recording holds no {lacks}: there is nothing to check")
    frame = np.repeat(np.arange(len(frames)), [len(m.ids) for m in frames])
    ids = np.concatenate([m.ids for m in frames]).astype(np.int64)
    pixels = np.concatenate([m.pixels for m in frames]).astype(np.float64).reshape(-1, 4)
    good = np.isfinite(pixels).all(axis=1)
    return Recording(
        header_of_messages(messages),
        np.array([m.t_ns for m in twists], np.int64),
        np.array([m.v_B_mps for m in twists], np.float64),
        np.array([m.w_B_radps for m in twists], np.float64),
        np.array([m.t_ns for m in frames], np.int64),
        Tracks.from_rows(len(frames), frame[good], ids[good], pixels[good]),
    )


Timed = TypeVar("Timed", Twist, Stereo)


def _ascending(messages: list[Timed]) -> list[Timed]:
    out: list[Timed] = []
    for message in messages:
        if not out or message.t_ns > out[-1].t_ns:
            out.append(message)
    return out


FRAMES_MOST, SEEN_MOST = 4000, 60_000  # so many tell the sigmas to a percent or two
AHEAD = (Kind.HEADER, Kind.CONFIG, Kind.LANDMARK)  # what belongs to each part of a recording


def first_frames(messages: Sequence[Message], most: int = FRAMES_MOST) -> list[Message]:
    """The recording's beginning, without truth, which is not to be looked at, and without END."""
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
    """The first (0) or the second (1) half of the frames with all that goes with them."""
    at = [k for k, m in enumerate(messages) if isinstance(m, Stereo)]
    middle = at[len(at) // 2]
    if which == 0:
        return list(messages[:middle])
    ahead = [m for m in messages[:middle] if m.kind in AHEAD]
    return [*ahead, *messages[middle:]]


def shifted(messages: Sequence[Message], offset_ns: int) -> list[Message]:
    """With the frames later by so much, in the order of time."""
    if offset_ns == 0:
        return list(messages)
    ahead = [m for m in messages if m.kind in AHEAD or isinstance(m, Start)]
    data: list[tuple[int, int, Message]] = []
    for message in messages:
        if isinstance(message, Stereo):
            moved = message.t_ns + offset_ns
            if moved >= 0:  # before time zero there is nothing to see it by
                data.append((moved, 1, replace(message, t_ns=moved)))
        elif isinstance(message, Twist | Reading):
            data.append((message.t_ns, 0, message))
    return [*ahead, *(m for _, _, m in sorted(data, key=lambda row: row[:2]))]


def not_before(messages: Sequence[Message], t_ns: int) -> list[Message]:
    """All later by so much, where they begin before: then every offset moves the same frames."""
    timed = (Stereo, Twist, Reading, Start)
    least = min((m.t_ns for m in messages if isinstance(m, timed)), default=t_ns)
    later = max(t_ns - least, 0)
    return [replace(m, t_ns=m.t_ns + later) if isinstance(m, timed) else m for m in messages]


def write(path: Path, messages: Sequence[Message]) -> None:
    """A recording of these messages."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        for message in messages:
            writer.write(message)
        writer.end()
