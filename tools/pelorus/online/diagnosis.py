# SPDX-License-Identifier: MIT
"""What is wrong and what to do: the filter's health with its reasons, and what the inputs show."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from pelorus.evaluate.health import DEGRADED, GOOD, HARMLESS, SHORT
from pelorus.online.odometry import Odom, Odometry
from pelorus.online.order import Pairing, Together
from pelorus.wire import schema

MISSED_SHARE = 0.1  # of the pictures may lack their partner before it is told
LATE_SHARE = 0.02
ALONE_LEAST = 6


class Level(IntEnum):
    """As diagnostic_msgs of ROS has them."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Status:
    """One thing that is said; `do` is what would mend it."""

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
    "NO_FRAMES": "is the camera connected, and its driver alive?",
    "NO_TWISTS": "is the IMU's (or the wheels') driver alive, on the camera's clock?",
    "TWIST_CONTRADICTED": "wheels that slip, a shock, or a moving scene: setting scene=may-move",
    "POSE_MAY_BE_WRONG": "the covariance covers it; drive on where there is texture",
    "BIAS_OFF_PRIOR": "the IMU's bias is larger than its setting says: bias-accel-sigma, "
    "bias-gyro-sigma, or a wrong unit or frame",
    "FROZEN_IMAGE": "the camera's driver repeats a picture: restart it",
    "NOISE_MISFIT": "the settings of noise do not fit, or calibration or stamps are off: "
    "pelorus explain on the log says which",
    "CALIBRATION_OFF": "calibrate the cameras anew",
    "NIS_HIGH": "pixel-sigma is too small, or the calibration is off: pelorus check on the log",
    "GATE_LOCKED": "calibration, stamps or swapped cameras: pelorus explain on the log",
    "IMU_FAULT": "the IMU's readings are impossible: saturated, frozen or full of spikes",
    "READINGS_REJECTED": "the wheels disagree with all else: radius, frame or slip",
    "RECOVERED": "the filter lost its covariance and began anew: send the log as a report",
    "STATE_DAMAGED": "start anew: something has written into its memory",
    "REFUSED_INPUT": "tracks are malformed, or an id stands twice in a frame",
}
NOTHING_YET = Status(
    "estimate", Level.ERROR, "nothing is estimated yet", "camera and IMU (or wheels) must both send"
)
LEVELS = {GOOD: Level.OK, DEGRADED: Level.WARN}


def of_health(health: int, reasons: int, values: dict[str, str] | None = None) -> Status:
    """Returns health in words, why, and what to do about the first cause."""
    told_of = reasons & ~HARMLESS
    bits = [1 << k for k in range(told_of.bit_length()) if told_of >> k & 1]
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


# --- what the inputs show -------------------------------------------------------------------------


def of_pairs(pairing: Pairing[Any]) -> list[Status]:
    """Returns whether left and right pictures find each other."""
    alone, paired = pairing.alone, pairing.paired
    if alone < ALONE_LEAST or alone <= MISSED_SHARE * (2 * paired + alone):
        return []
    gap = pairing.usual_gap_ms
    apart = "" if gap is None else f", as a rule {gap:.3g} ms apart"
    words = f"{alone} pictures had no partner within {pairing.within_ns * 1e-6:g} ms{apart}; "
    words += f"{paired} pairs"
    do = (
        "trigger the cameras together (hardware sync), or look for lost pictures; a larger "
        "threshold of sync costs accuracy: speed times that time"
    )
    return [Status("sync", Level.WARN if paired else Level.ERROR, words, do)]


def of_halves(together: Together | None) -> list[Status]:
    """Returns whether the two pictures of a pair are taken together, by their rows."""
    if together is None or together.found is None:
        return []
    do = "trigger both cameras together (hardware sync); health is no better than this until then"
    return [Status("halves", Level.ERROR, together.found.words, do)]


def of_speed(too_slow: int) -> list[Status]:
    """Returns whether pictures come faster than they can be followed."""
    if not too_slow:
        return []
    words = f"{too_slow} pairs were left out: they come faster than they can be followed"
    do = "smaller pictures or a lower rate; the odometry itself stays in time"
    return [Status("speed", Level.WARN, words, do)]


def of_odometry(odometry: Odometry | None, last: Odom | None, messages: int) -> list[Status]:
    """Returns what the order of the stamps, the filter and the log say."""
    if odometry is None:
        return [NOTHING_YET]
    found = [*_of_order(odometry, messages), _of_estimate(odometry, last)]
    log = None if odometry.drive is None else odometry.drive.log
    if log is not None and log.trouble:
        do = "make room; a new drive begins a new log"
        found.append(Status("log", Level.ERROR, log.trouble, do))
    return found


def _of_order(odometry: Odometry, messages: int) -> list[Status]:
    order, found = odometry.sequencer, []
    counts = order.counts
    if counts.late > max(LATE_SHARE * messages, 2):
        words = f"{counts.late} of {messages} messages came too late or twice, the last by "
        words += f"{order.late_by_ns * 1e-6:.3g} ms"
        do = "are all stamps of one clock, taken at the measurement and not at the arrival?"
        found.append(Status("order", Level.WARN, words, do))
    if counts.off_clock:
        words = f"{counts.off_clock} stamps lie {order.off_by_ns * 1e-9:+.3g} s from the others"
        do = (
            "camera and IMU must have one clock (the driver's option for host or system time); "
            "where it is a second or two, the machine is too slow for the pictures"
        )
        level = Level.ERROR if counts.off_clock > LATE_SHARE * messages else Level.WARN
        found.append(Status("clock", level, words + ", and were left out", do))
    remarks, odometry.remarks = odometry.remarks, []
    return found + [Status("clock", Level.WARN, words) for words in remarks]


def _of_estimate(odometry: Odometry, last: Odom | None) -> Status:
    if odometry.drive is None:
        return NOTHING_YET
    estimate, values = odometry.drive.estimate(), {}
    if last is not None:
        estimate = last.estimate
        sigma = np.sqrt(np.diag(last.covariance))
        values = {
            "points used": str(0 if estimate.report is None else estimate.report.used),
            "sigma position, m": " ".join(f"{s:.3g}" for s in sigma[:3]),
            "sigma rotation, rad": " ".join(f"{s:.3g}" for s in sigma[3:]),
        }
    refused = "; ".join(
        f"{count} {kind.name}: {schema.STATUSES.get(status, status)}"
        for (kind, status), count in odometry.drive.refused.items()
    )
    return of_health(estimate.health, estimate.reasons, values | {"refused": refused})
