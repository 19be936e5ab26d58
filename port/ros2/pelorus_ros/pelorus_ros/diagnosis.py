# SPDX-License-Identifier: MIT
"""What is wrong and what to do, for diagnostic_msgs: health, its reasons, and the inputs."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

from pelorus import schema
from pelorus.health import SHORT

GOOD, DEGRADED, LOST = 0, 1, 2


class Level(IntEnum):
    """As diagnostic_msgs has them."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Status:
    """One line of /diagnostics; `do` is what would mend it."""

    name: str
    level: Level
    message: str
    do: str = ""
    values: dict[str, str] = field(default_factory=dict)


# What to do about a reason of the filter.
ADVICE = {
    "NOT_STARTED": "let the robot stand still for a second; in motion it starts after 3 s",
    "FEW_OBSERVATIONS": "look at the pictures: light, texture, exposure; are the lenses clean?",
    "NO_OBSERVATIONS": "look at the pictures: a covered or dark camera, or no texture at all",
    "NO_FRAMES": "is the camera's driver alive? ros2 topic hz left/image",
    "NO_TWISTS": "is the IMU's (or the wheels') driver alive, and are its stamps the camera's clock?",
    "TWIST_CONTRADICTED": "wheels that slip, a shock, or a moving scene: setting scene=may-move",
    "POSE_MAY_BE_WRONG": "the covariance covers it; drive on where there is texture",
    "BIAS_OFF_PRIOR": "the IMU's bias is larger than its setting says: bias-accel-sigma, "
    "bias-gyro-sigma, or a wrong unit or frame",
    "FROZEN_IMAGE": "the camera's driver repeats a picture: restart it",
    "NOISE_MISFIT": "the settings of noise do not fit, or calibration or stamps are off: record "
    "with the parameter log, and pelorus explain says which",
    "CALIBRATION_OFF": "calibrate the cameras anew",
    "NIS_HIGH": "pixel-sigma is too small, or the calibration is off: pelorus check on the log",
    "GATE_LOCKED": "calibration, stamps or swapped topics: pelorus explain on the log",
    "IMU_FAULT": "the IMU's readings are impossible: saturated, frozen or full of spikes",
    "READINGS_REJECTED": "the wheels disagree with all else: radius, frame or slip",
    "RECOVERED": "the filter lost its covariance and began anew: send the log as a report",
    "STATE_DAMAGED": "restart the node: something has written into its memory",
    "REFUSED_INPUT": "tracks are malformed, or an id stands twice in a message",
}
LEVELS = {GOOD: Level.OK, DEGRADED: Level.WARN}


def of_health(health: int, reasons: int, values: dict[str, str] | None = None) -> Status:
    """Returns health in words, why, and what to do about the first cause."""
    bits = [1 << k for k in range(reasons.bit_length()) if reasons >> k & 1]
    names = [schema.REASON_NAMES.get(bit, f"reason {bit}") for bit in bits]
    causes = sorted(names, key=_place)
    why = ", ".join(SHORT.get(name, name.lower().replace("_", " ")) for name in causes)
    word = schema.HEALTHS.get(health, str(health))
    told = f"{word}: {why}" if why and health != GOOD else word
    do = next((ADVICE[name] for name in causes if name in ADVICE), "") if health != GOOD else ""
    more = {"health": word, "reasons": " ".join(names)}
    return Status("estimate", LEVELS.get(health, Level.ERROR), told, do, more | (values or {}))


def _place(name: str) -> int:
    """What explains the others comes first."""
    if name in ("POSE_MAY_BE_WRONG", "FEW_OBSERVATIONS", "NO_OBSERVATIONS"):
        return 2
    return 0 if name in ("NOT_STARTED", "NO_FRAMES", "NO_TWISTS", "IMU_FAULT") else 1
