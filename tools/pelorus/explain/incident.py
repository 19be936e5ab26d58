# SPDX-License-Identifier: MIT
"""An incident: something that went wrong, with its beginning and end."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

S = 1_000_000_000


class Cause(StrEnum):
    """Causes, in causal order: of two that begin together the earlier one causes the other."""

    CLOCK_STEP = "clock-step"
    NO_READINGS = "no-readings"
    NO_FRAMES = "no-frames"
    SHOCK = "shock"
    FROZEN_PICTURE = "frozen-picture"
    DEAD_ODOMETRY = "dead-odometry"
    DEAD_GYRO = "dead-gyro"
    DEAD_ACCELEROMETER = "dead-accelerometer"
    READINGS_OFF = "readings-off"
    LOST_TRACKS = "lost-tracks"
    JUMP = "jump"
    SLIP = "slip"
    TURN_CONTRADICTED = "turn-contradicted"
    CONTRADICTED = "contradicted"
    WRONG_MATCHES = "wrong-matches"
    LOST = "lost"
    DIVERGED = "diverged"
    SETTINGS = "settings"


class Incident(NamedTuple):
    """An incident in a log.

    `words` describe it without its time. `noticed_ns` is when the filter itself noticed it, where
    that is later than it began.
    """

    cause: Cause
    from_ns: int
    to_ns: int
    words: str
    noticed_ns: int | None = None

    @property
    def rank(self) -> int:
        return list(Cause).index(self.cause)

    @property
    def remedy(self) -> str:
        """Returns what to check first."""
        return REMEDIES[self.cause]


REMEDIES = {
    Cause.CLOCK_STEP: "stamp by a clock that nobody sets while the robot runs (monotonic)",
    Cause.NO_READINGS: "look at the sensor's cable, driver and bus; what the filter says of the "
    "motion meanwhile comes of a reading that is old",
    Cause.NO_FRAMES: "look at the camera's cable, trigger and driver",
    Cause.SHOCK: "nothing, where the robot fell or was hit; else look at the IMU's mount and range",
    Cause.FROZEN_PICTURE: "look at the camera's driver: it hands on the same picture again",
    Cause.DEAD_ODOMETRY: "look at the encoders, their cables and driver",
    Cause.DEAD_GYRO: "look at the gyro's bus and driver",
    Cause.DEAD_ACCELEROMETER: "look at the accelerometer's bus and driver",
    Cause.READINGS_OFF: "nothing, where wheels slip; else look at the sensor's scale, place and "
    "sigma (`pelorus check` measures wheels beside an IMU)",
    Cause.LOST_TRACKS: "look at light, exposure and what was before the camera; a front end that "
    "begins anew keeps no ids",
    Cause.JUMP: "nothing, where the robot was pushed or carried; else look at the stamps there",
    Cause.SLIP: "nothing, where wheels slip or traffic fills the picture; else look at the wheels "
    "and, in `pelorus check`, at scale and timing",
    Cause.TURN_CONTRADICTED: "look at the gyro: its axes, units and clock (`pelorus check`)",
    Cause.CONTRADICTED: "`pelorus check` on the recording: scale, axes, clocks",
    Cause.WRONG_MATCHES: "look at the front end's matches (`pelorus report --pictures`)",
    Cause.LOST: "`pelorus report` shows the points of each frame, and which were rejected",
    Cause.DIVERGED: "keep this log and report it: no input should do that. Beside "
    "pelorus-replay-f64 it shows whether rounding did it",
    Cause.SETTINGS: "`pelorus check` on the recording writes settings that fit",
}
