# SPDX-License-Identifier: MIT
"""A filter's log by column: stereo frames with their answers, and readings; and its incidents."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.io.trajectory import is_finite
from pelorus.math.motion import Times, runs
from pelorus.wire import schema
from pelorus.wire.evidence import Evidence, EvidenceFlag
from pelorus.wire.frames import Header, Imu, Kind, Message, Pose, Report, Stereo, Twist
from pelorus.wire.framing import header_of_messages
from pelorus.wire.layout import Floats
from pelorus.wire.schema import number
from pelorus.wire.settings import in_force

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

Flags = NDArray[np.bool_]
Counts = NDArray[np.int64]
Pixels = NDArray[np.float32]
FEW = 3  # fewer points fix no pose
NO_READING = -1
CONTRADICTED = number("reason", "TWIST_CONTRADICTED") | number("reason", "POSE_MAY_BE_WRONG")
ODD_FLAGS = EvidenceFlag.OUTRIGHT | EvidenceFlag.WAITS | EvidenceFlag.LOCKED


@dataclass(frozen=True)
class FilterLog:
    """A filter's log.

    `frames` are in the order of arrival, each with its answer, and with its evidence where the log
    has it. `behind_ns` is the stamp of the newest reading that had arrived before the frame.
    """

    header: Header
    frames: list[Stereo]
    reports: list[Report]
    poses: list[Pose | None]
    evidence: list[Evidence | None]
    behind_ns: Times
    reading_ns: Times
    readings: Floats  # (n, 6): v, w of twists; a, w of an IMU
    by_imu: bool
    refused: list[Report]  # of readings
    sigma: Floats  # (6,) of a twist reading in the filter; zeros where it is unknown
    bias_sigma: Floats  # (6,) priors of the biases, likewise
    _columns: dict[str, Counts] = field(default_factory=dict)

    @cached_property
    def t_ns(self) -> Times:
        return np.array([frame.t_ns for frame in self.frames], np.int64)

    @cached_property
    def arrived_ns(self) -> Times:
        """Returns when frames came, by the readings' clock; without readings their stamps."""
        return np.where(self.behind_ns == NO_READING, self.t_ns, self.behind_ns)

    @property
    def origin_ns(self) -> int:
        return int(self.t_ns[0])

    def incident(self, cause: Cause, first: int, last: int, words: str) -> Incident:
        """Returns the incident of these frames."""
        return Incident(cause, int(self.t_ns[first]), int(self.t_ns[last]), words)

    def column(self, name: str) -> Counts:
        """Returns a column of the REPORTs by its name."""
        if name not in self._columns:
            found = (getattr(report, name) for report in self.reports)
            self._columns[name] = np.fromiter(found, np.int64, len(self.reports))
        return self._columns[name]

    @cached_property
    def reasons(self) -> Counts:
        return self.column("reasons")

    def said(self, bits: int) -> Flags:
        """Returns frames with one of these reasons; a refused one has those of the frame before."""
        return np.asarray(((self.reasons & bits) != 0) & (self.column("status") == 0))

    @property
    def shared(self) -> Counts:
        """Returns how many points of each frame were in the frame before."""
        return self._from_before[:, 0].astype(np.int64)

    @property
    def repeated(self) -> Counts:
        """Returns how many of these have identical pixels there."""
        return self._from_before[:, 1].astype(np.int64)

    @property
    def flow_px(self) -> Floats:
        """Returns the shared points' median motion in the left picture; NaN where they are few."""
        return self._from_before[:, 2]

    @cached_property
    def _from_before(self) -> Floats:
        """Returns (n, 3) the three columns above; the points themselves are many, and not kept."""
        out = np.tile([0.0, 0.0, np.nan], (len(self.frames), 1))
        for k, (before, now) in enumerate(pairwise(self.frames), 1):
            first, second = before.pixels, now.pixels
            _, i, j = np.intersect1d(before.ids, now.ids, return_indices=True)
            out[k] = len(i), *_moved(first[i], second[j])
        return out


def _moved(first: Pixels, second: Pixels) -> tuple[int, float]:
    """Returns how many points are identical, and the median motion of all."""
    repeated = int((first == second).all(axis=1).sum())
    way = (second.astype(np.float64) - first)[:, :2]
    way = way[np.isfinite(way).all(axis=1)]
    return repeated, float(np.median(np.hypot(*way.T))) if len(way) >= FEW else np.nan


@dataclass
class _Answered:
    """A frame, and what a filter said of it."""

    frame: Stereo
    report: Report | None = None
    pose: Pose | None = None
    evidence: Evidence | None = None


def log_of(messages: Sequence[Message]) -> FilterLog:
    """Reads a log; raises PelorusError where no frame was answered."""
    frames = _answers(messages)
    numbers = [k for k, one in enumerate(frames) if one.report is not None]
    if not numbers:
        raise PelorusError("holds no answer of a filter to a stereo frame: `pelorus-replay --out`")
    answered = [frames[k] for k in numbers]
    behind, stamps, readings = _readings(messages)
    refused = [m for m in messages if isinstance(m, Report) and m.status]
    return FilterLog(
        header_of_messages(messages),
        [one.frame for one in answered],
        [one.report for one in answered if one.report is not None],
        [one.pose for one in answered],
        [one.evidence for one in answered],
        behind[numbers],
        stamps,
        readings,
        any(isinstance(m, Imu) for m in messages),
        [m for m in refused if m.subject in (Kind.TWIST, Kind.IMU)],
        _sigma(messages, "velocity-sigma", "gyro-sigma"),
        _sigma(messages, "bias-velocity-sigma", "bias-gyro-sigma"),
    )


def _answers(messages: Sequence[Message]) -> list[_Answered]:
    """Returns all frames with their answers.

    A robot's answer comes late, and is matched by its time; a pose comes before its report,
    evidence after it.
    """
    found: list[_Answered] = []
    waiting: dict[int, list[_Answered]] = {}
    pose: Pose | None = None
    last: _Answered | None = None
    for m in messages:
        if isinstance(m, Stereo):
            found.append(_Answered(m))
            waiting.setdefault(m.t_ns, []).append(found[-1])
        elif isinstance(m, Pose) and m.after_stereo and is_finite(m):
            pose = m
        elif isinstance(m, Report) and m.subject == Kind.STEREO:
            asked = waiting.get(m.t_ns)
            last = asked.pop(0) if asked else None
            if last is not None:
                last.report, last.pose = m, pose
            pose = None
        elif isinstance(m, Evidence) and last is not None:
            last.evidence = m
    return found


def _readings(messages: Sequence[Message]) -> tuple[Times, Times, Floats]:
    """Returns for each frame the newest stamp before it, and stamps and values of the valid
    readings.

    Readings that are not finite, or out of any sensor's range, were refused and are left out.
    """
    by_imu = any(isinstance(m, Imu) for m in messages)
    behind, stamps, numbers = array("q"), array("q"), array("d")
    for m in messages:
        if isinstance(m, Stereo):
            behind.append(stamps[-1] if stamps else NO_READING)
        elif isinstance(m, Imu):
            stamps.extend(m.times_ns)
            numbers.extend(np.hstack((m.a_B_mps2, m.w_B_radps)).ravel().tolist())
        elif isinstance(m, Twist) and not by_imu:
            stamps.append(m.t_ns)
            numbers.extend((*m.v_B_mps, *m.w_B_radps))
    readings = np.frombuffer(numbers).reshape(-1, 6)
    most = schema.PLAUSIBLE["ACCELERATION" if by_imu else "SPEED"]
    bounds = np.repeat([most, schema.PLAUSIBLE["RATE"]], 3)
    good = (np.abs(readings) <= bounds).all(axis=1)
    every = np.frombuffer(stamps, np.int64)
    return np.array(behind, np.int64), every[good], readings[good]


def _sigma(messages: Sequence[Message], *names: str) -> Floats:
    return np.repeat([in_force(messages, name) or 0.0 for name in names], 3)


def suspect(log: FilterLog) -> Flags:
    """Returns the frames that the supervisor or the gate found suspect."""
    flags = np.array([0 if e is None else e.flags for e in log.evidence], np.int64)
    matched, gated = log.column("matched"), log.column("gated")
    rejected = (matched >= FEW) & (2 * gated > matched)
    return np.asarray(log.said(CONTRADICTED) | ((flags & ODD_FLAGS) != 0) | rejected)


def period(t_ns: Times) -> float:
    """Returns the median interval, ns."""
    return float(np.median(np.abs(np.diff(t_ns)))) if len(t_ns) > 1 else 0.0


def joined_runs(flags: Flags, t_ns: Times, apart_ns: int) -> list[tuple[int, int]]:
    """Returns the stretches of True, joined across gaps of at most `apart_ns`."""
    out: list[tuple[int, int]] = []
    for first, last in runs(flags):
        if out and t_ns[first] - t_ns[out[-1][1]] <= apart_ns:
            out[-1] = (out[-1][0], last)
        else:
            out.append((first, last))
    return out
