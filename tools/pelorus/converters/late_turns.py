# SPDX-License-Identifier: MIT
"""Moves rates of turn that come later than the velocities beside them to their true times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pelorus.errors import PelorusError
from pelorus.wire import framing
from pelorus.wire.frames import End, Message, Text, Twist

LATE_MOST_S = 2.0


def convert(source: Path, late_s: float, target: Path) -> int:
    """Writes the recording with the rates of turn `late_s` earlier; returns their number.

    Rates are interpolated between two readings; after the last one they stay constant.
    """
    if not 0 < abs(late_s) <= LATE_MOST_S:
        raise PelorusError(
            f"--late {late_s:g}: seconds are expected, up to {LATE_MOST_S:g}, and not 0"
        )
    messages = framing.messages_of(source)
    twists = [m for m in messages if isinstance(m, Twist)]
    if not twists:
        raise PelorusError(f"{source}: holds no twists whose rates of turn could be moved")
    framing.write_file(target, _moved(messages, twists, late_s), len(messages))
    return len(twists)


def _moved(
    messages: Sequence[Message], twists: Sequence[Twist], late_s: float
) -> Iterator[Message]:
    t_ns = np.array([twist.t_ns for twist in twists], np.int64)
    order = np.argsort(t_ns, kind="stable")
    t_s = (t_ns[order] - t_ns.min()) * 1e-9
    w = np.array([twist.w_B_radps for twist in twists])[order]
    first = next(k for k, message in enumerate(messages) if isinstance(message, Twist))
    for k, message in enumerate(messages):
        if k == first:
            yield Text(f"rates of turn moved {late_s:g} s earlier than their velocities")
        if isinstance(message, Twist):
            at_s = (message.t_ns - t_ns.min()) * 1e-9 + late_s
            there = np.array([np.interp(at_s, t_s, w[:, axis]) for axis in range(3)])
            yield replace(message, w_B_radps=there)
        elif not isinstance(message, End):
            yield message
