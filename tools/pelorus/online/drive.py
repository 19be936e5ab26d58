# SPDX-License-Identifier: MIT
"""One drive of one filter, and its log: the filter gets what the log holds, bit by bit.

Every message is packed before it is used, and the filter is given what comes out of the bytes. So
`pelorus-replay` gives the same bits for the log, and `pelorus compare` says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from pelorus.filter import Filter, FilterError, observations
from pelorus.math.se3 import Poses
from pelorus.native.binding import Precision, library
from pelorus.native.binding import Report as FrameReport
from pelorus.native.configured import Configured, Named
from pelorus.online.order import Datum
from pelorus.wire import packed_file, schema
from pelorus.wire.frames import (
    UNKNOWN_VARIANCE,
    Config,
    Header,
    Imu,
    Kind,
    Landmark,
    Message,
    Pose,
    Reading,
    Report,
    Start,
    StartFlag,
    Stereo,
    Twist,
)
from pelorus.wire.framing import Writer
from pelorus.wire.layout import Floats, pack_symmetric, unpack_symmetric
from pelorus.wire.settings import IDS

SENSOR_NAMES = {number: name for name, number in schema.SENSORS.items()}
DIVERGED = schema.number("status", "DIVERGED")
NOT_STARTED = schema.number("reason", "NOT_STARTED")
# Nothing is known: a sphere of a kilometre, and any angle.
UNKNOWN_COVARIANCE = np.diag([1e6] * 3 + [np.pi**2 / 3] * 3)


class Estimate(NamedTuple):
    """What the filter knows of the body at a time: pose T_WB, covariance of (rho, theta), velocity
    (v, w) in the body's axes with its covariance."""

    t_ns: int
    T_WB: Poses
    covariance: Floats
    velocity: Floats
    velocity_covariance: Floats
    health: int
    reasons: int
    report: FrameReport | None = None  # of the frame that led to it

    @property
    def started(self) -> bool:
        return not self.reasons & NOT_STARTED


class Log:
    """A recording that is whole up to any moment. If the disk fails, it ends there; `trouble` says
    so, and the drive goes on."""

    def __init__(self, path: Path) -> None:
        self.path, self.trouble = path, ""
        self._stream: BinaryIO | None = None
        try:
            self._stream = packed_file.create(path, packed_file.is_packed(path), live=True)
        except OSError as error:
            self._fail(error)
            return
        self._writer = Writer(self._stream)

    def write(self, *messages: Message) -> None:
        if self._stream is None:
            return
        try:
            for message in messages:
                self._writer.write(message)
            self._stream.flush()
        except OSError as error:
            self._fail(error)

    def close(self) -> None:
        if self._stream is None:
            return
        try:
            self._writer.end()
            self._stream.close()
        except OSError as error:
            self._fail(error)
        self._stream = None

    def _fail(self, error: OSError) -> None:
        self.trouble = f"the log {self.path} ends here: {error.strerror}"
        self._stream = None


@dataclass(frozen=True)
class Setup:
    """What a drive begins with; `settings` win over what the HEADER suggests. `known` is a map, for
    the settings known-map and mode."""

    header: Header
    settings: Named
    precision: Precision = "float32"
    known: tuple[Landmark, ...] = ()


class Drive:
    """A filter from its start to its end. `refused` counts, by status and kind, what it refused;
    `watch` is given all that a log holds.
    """

    def __init__(
        self,
        setup: Setup,
        start: Start | None = None,
        log: Path | None = None,
        watch: Callable[[Message], None] | None = None,
    ) -> None:
        library_ = library(setup.precision)
        asked: dict[int, float] = {}
        for name, value in setup.settings.items():
            asked |= Configured(library_).set(name, value)
        wanted: list[Message] = [Header.unpack(setup.header.pack())]
        if asked:
            wanted.append(Config(asked))
        wanted += [Landmark.unpack(one.pack()) for one in setup.known]
        self.filter = Filter.of_recording(wanted, precision=setup.precision)
        self.refused: dict[tuple[Kind, int], int] = {}
        self.log = None if log is None else Log(log)
        self._watch = watch
        self._start = None if start is None else Start.unpack(start.pack())
        self._library, self._resets = library_, 0
        self._write(*wanted, *([] if self._start is None else [self._start]))
        self._write(self._in_force())
        if self._start is not None and self._start.flags & StartFlag.BIAS_PRIOR:
            self.filter.set_bias(self._start.bias_mean, self._start.bias_variance)

    def use(self, datum: Datum) -> Estimate | None:
        """Gives the filter a message; returns the estimate after a frame that it took."""
        datum = type(datum).unpack(datum.pack())
        self._write(datum)
        self._begin()
        self.filter.evicted.clear()
        try:
            return self._given(datum)
        except FilterError as error:
            key = datum.kind, error.status
            self.refused[key] = self.refused.get(key, 0) + 1
            if not isinstance(datum, Stereo):
                return None
            if error.status != DIVERGED:
                self._write(
                    Report(datum.t_ns, datum.kind, error.status, observations=len(datum.ids))
                )
                return None
            return self._answered(datum, self.filter.last_report)

    def _given(self, datum: Datum) -> Estimate | None:
        f = self.filter
        match datum:
            case Imu():
                for t_ns, a, w in zip(datum.times_ns, datum.a_B_mps2, datum.w_B_radps, strict=True):
                    f.inertial(t_ns, a, w)
            case Twist():
                f.predict(datum.t_ns, datum.v_B_mps, datum.w_B_radps)
            case Reading():
                sensor = SENSOR_NAMES[datum.sensor]
                f.measure(datum.t_ns, sensor, datum.value, datum.sigma, datum.at_B_m)
            case Stereo():
                return self._answered(
                    datum, f.update(datum.t_ns, observations(datum.ids, datum.pixels, datum.sigmas))
                )
        return None

    def place(self, start: Start) -> None:
        """Sets the pose in the middle of the drive; the landmarks go."""
        self._start, before = Start.unpack(start.pack()), self._resets
        self._write(self._start)
        self._begin()
        self._resets = before  # a controller sees the jump in reset_count

    def _begin(self) -> None:
        """Sets the pose of the START, whose time is that of the first message."""
        if self._start is None:
            return
        start, self._start = self._start, None
        given = start.flags & StartFlag.COVARIANCE
        P = unpack_symmetric(start.covariance[None], 6)[0] if given else None
        self.filter.set_pose(start.t_ns, start.R_WB, start.p_WB_m, P)
        self._resets = self._all_resets()

    @property
    def reset_count(self) -> int:
        """Returns how often the pose may have jumped: enlargements of the covariance."""
        return self._all_resets() - self._resets

    def _all_resets(self) -> int:
        totals = self.filter.totals()
        return totals["resets"] + totals["widened"]

    def estimate(self, report: FrameReport | None = None) -> Estimate:
        """Returns what is known at the filter's time; an unknown covariance is enormous."""
        f = self.filter
        health = f.health()
        try:
            P = f.pose_covariance()
            if not np.isfinite(P).all() or P[0, 0] >= UNKNOWN_VARIANCE:
                P = UNKNOWN_COVARIANCE
            U = f.velocity_covariance()
        except FilterError:
            P = U = UNKNOWN_COVARIANCE
        R, p = f.pose()
        reasons = health.reasons | (0 if report is None else report.reasons)
        worst = health.health if report is None else max(health.health, report.health)
        return Estimate(f.time_ns, Poses(R, p), P, f.velocity(), U, worst, reasons, report)

    def close(self) -> None:
        if self.log is not None:
            self.log.close()

    # --- the log

    def _write(self, *messages: Message) -> None:
        if self.log is not None:
            self.log.write(*messages)
        if self._watch is not None:
            for message in messages:
                self._watch(message)

    def _answered(self, frame: Stereo, report: FrameReport) -> Estimate:
        if self.log is not None or self._watch is not None:
            self._write(self._pose_message(), self._report_message(frame, report))
        return self.estimate(report)

    def _in_force(self) -> Config:
        sizes = self._library.sizes
        return Config(
            {id: self.filter.setting(name) for name, id in IDS.items()},
            self._library.build_fingerprint(),
            *(sizes.landmarks, sizes.observations, sizes.block, sizes.real // 8),
        )

    def _pose_message(self) -> Pose:
        f = self.filter
        unknown = np.diag([UNKNOWN_VARIANCE] * 6)
        try:
            P = f.pose_covariance()
        except FilterError:
            P = unknown
        try:
            U = f.velocity_covariance()
        except FilterError:
            U = unknown
        R, p = f.pose()
        u, (bias, P_b) = f.velocity(), f.bias()
        return Pose(
            f.time_ns, p, R, pack_symmetric(P), u[:3], u[3:], bias, pack_symmetric(U),
            self._library.sizes.real // 8, True, self.reset_count, f.trace(),
            np.diag(P_b).copy(),
        )  # fmt: skip

    @staticmethod
    def _report_message(frame: Stereo, report: FrameReport) -> Report:
        told = {field[0] for field in FrameReport._fields_} & set(Report.__dataclass_fields__)
        same = {name: getattr(report, name) for name in told - {"t_ns"}}
        return Report(frame.t_ns, Kind.STEREO, **same)
