# SPDX-License-Identifier: MIT
"""Something that went wrong, from when to when."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

S = 1_000_000_000


class Cause(StrEnum):
    """In the order in which one makes another: of two that begin together the first made it."""

    CLOCK_STEP = "clock-step"
    NO_READINGS = "no-readings"
    NO_FRAMES = "no-frames"
    SHOCK = "shock"
    FROZEN_PICTURE = "frozen-picture"
    DEAD_ODOMETRY = "dead-odometry"
    DEAD_GYRO = "dead-gyro"
    DEAD_ACCELEROMETER = "dead-accelerometer"
    LOST_TRACKS = "lost-tracks"
    JUMP = "jump"
    SLIP = "slip"
    TURN_CONTRADICTED = "turn-contradicted"
    CONTRADICTED = "contradicted"
    WRONG_MATCHES = "wrong-matches"
    LOST = "lost"
    SETTINGS = "settings"


class Finding(NamedTuple):
    """`words` say what the log shows of it, without its time. `noticed_ns` is when the filter
    itself found it odd, where that is later than it began.
    """

    cause: Cause
    from_ns: int
    to_ns: int
    words: str
    noticed_ns: int | None = None

    @property
    def rank(self) -> int:
        return list(Cause).index(self.cause)
