# SPDX-License-Identifier: MIT
"""Reads a recording in pieces, so that one of ten hours needs no more memory than one of minutes.

Explaining a log takes some 20 bytes of memory for each of its own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from pelorus.wire.frames import Config, Header, Landmark, Message, Pose, Role, Stereo
from pelorus.wire.framing import Counts, end_of, frames_in, without_header

PIECE_BYTES = 16 << 20  # of frames on the wire: ten minutes of 60 points at 10 Hz, with the answers


def in_pieces(path: Path, counts: Counts, piece_bytes: int) -> Iterator[list[Message]]:
    """Yields the messages, at least one piece; each ends before a frame and has its own END.

    What holds for all of it stands ahead of each piece: header, settings, known landmarks.
    """
    ahead: list[Message] = []
    piece: list[Message] = []
    begun = 0
    for frame in frames_in(path, counts):
        message = frame.message
        if isinstance(message, Stereo) and frame.offset - begun >= piece_bytes:
            yield [*piece, end_of(Counter(m.kind for m in piece))]
            piece, begun = list(ahead), frame.offset
        if _holds_for_all(message):
            ahead.append(message)
        piece.append(message)
    if not any(isinstance(message, Header) for message in ahead):
        raise without_header(path)
    yield piece


def _holds_for_all(message: Message) -> bool:
    is_known = isinstance(message, Landmark) and message.role == Role.KNOWN
    return is_known or isinstance(message, Header | Config)


def holds_answers(piece: list[Message]) -> bool:
    """Returns whether a filter has answered to the frames: it is a log, not a recording alone."""
    return any(isinstance(m, Pose) and m.after_stereo for m in piece)
