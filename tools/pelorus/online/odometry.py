# SPDX-License-Identifier: MIT
"""Odometry of a robot: messages in, in any order, and where its base is, in the frame `odom`.

The filter's body is the IMU, or with wheels alone what they measure. `T_IB` brings points of the
base into it: the pose of the base is T_WI T_IB. A right error xi and a twist both change by the
same matrix, Ad(T_BI). The frame `odom` is the filter's world, moved along and turned about the
vertical so that the base begins in its origin and looks along its x axis; where a pose was given,
it is the world in which that was given.

Where the stamps jump, nothing ties what comes to what was: a new drive begins, and a new log, from
the last pose with a covariance for the time that is not known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pelorus.errors import PelorusError
from pelorus.evaluate.health import LOST
from pelorus.filter import FilterError
from pelorus.math import se3
from pelorus.math.se3 import IDENTITY, Poses
from pelorus.online.drive import UNKNOWN_COVARIANCE, Drive, Estimate, Setup
from pelorus.online.order import ClockStep, Datum, Sequencer
from pelorus.wire import packed_file
from pelorus.wire.frames import Message, Process, Start, StartFlag, Stereo
from pelorus.wire.layout import Floats, pack_symmetric

PATIENCE_NS = 500_000_000  # a sensor that is this late is taken for dead, until it comes again
SILENCE_NS = 100_000_000  # without frames the readings alone tell the pose, this often
USUAL_RATE_RADPS = 1.0  # a body with an IMU may turn like this at any time
UNSEEN_SPEED_MPS = 3.0  # and its speed may change by this while nobody looks


def adjoint(T: Poses) -> Floats:
    """Returns Ad(T) (6, 6) of (rho, theta): T Exp(xi) = Exp(Ad(T) xi) T."""
    Ad = np.zeros((6, 6))
    Ad[:3, :3] = Ad[3:, 3:] = T.R
    Ad[:3, 3:] = se3.skew(T.p) @ T.R
    return Ad


def turned(R: Floats, P: Floats) -> Floats:
    """Returns diag(R, R) P diag(R, R)^T: a covariance (6, 6) of (rho, theta) in the axes of a body
    with attitude R, as that of position and rotation about the fixed axes (the order of ROS)."""
    both = np.kron(np.eye(2), R)
    return np.asarray(both @ P @ both.T)


class Odom(NamedTuple):
    """The base in the frame `odom`: pose, covariance of (rho, theta) in the base's axes; its
    velocity (v, w) in its own axes with a covariance; of what it comes; how often the pose may have
    jumped."""

    t_ns: int
    T_OB: Poses
    covariance: Floats
    velocity: Floats
    velocity_covariance: Floats
    estimate: Estimate
    reset_count: int


@dataclass(frozen=True)
class Given:
    """Where the base is in `odom`, as somebody says; covariance of (rho, theta)."""

    T_OB: Poses
    covariance: Floats


class Odometry:
    """`log` is the recording that is written; later drives of the same run get -2, -3 ...; `watch`
    is given all that stands in it."""

    def __init__(
        self,
        setup: Setup,
        T_IB: Poses = IDENTITY,
        log: Path | None = None,
        given: Given | None = None,
        watch: Callable[[Message], None] | None = None,
    ) -> None:
        self.setup, self.T_IB, self._log, self._watch = setup, T_IB, log, watch
        self._jumps = 0  # of the drives before this one
        self.drives = 0
        self.origin: Poses | None = None  # T_OW
        self.drive: Drive | None = None
        self.remarks: list[str] = []  # what happened that somebody should know
        probe = Drive(setup)
        self.inertial = bool(probe.filter.setting("process") == Process.IMU)
        gap_ns = round(probe.filter.setting("max-gap") * 1e9)
        self.sequencer = Sequencer(PATIENCE_NS, gap_ns)
        self._start: Start | None = None
        self._told_ns = -1
        if given is not None:
            self.place(given)

    def add(self, datum: Datum) -> list[Odom]:
        """Returns what is known after each frame that this message lets go on."""
        return [odom for expected in self.sequencer.add(datum) for odom in self._use(expected)]

    def finish(self) -> list[Odom]:
        """Uses what still waits, and ends the log."""
        rest = [odom for expected in self.sequencer.flush() for odom in self._use(expected)]
        self._end()
        return rest

    def place(self, given: Given) -> None:
        """The base is here, now, or where nothing has come yet at the first message."""
        T_WI = se3.compose(given.T_OB, se3.inverse(self.T_IB))
        Ad = adjoint(self.T_IB)
        P = pack_symmetric(Ad @ given.covariance @ Ad.T)
        self._start = Start(0, T_WI.R, T_WI.p, StartFlag.COVARIANCE, P)
        self.origin = IDENTITY
        if self.drive is not None:
            self.drive.place(replace(self._start, t_ns=self.drive.filter.time_ns))
            self._start = None

    def restart(self) -> None:
        """The next message begins a drive that knows nothing of this one."""
        self._end()
        self.origin, self._start = None, None

    # --- saved state

    def save(self) -> bytes:
        """Returns the state of the filter, and where `odom` is."""
        if self.drive is None or self.origin is None:
            raise PelorusError("nothing is known yet, so there is nothing to save")
        frame = np.concatenate((self.origin.R.ravel(), self.origin.p)).astype("<f8").tobytes()
        return frame + self.drive.filter.save()

    def load(self, saved: bytes, moved_sigma: tuple[float, float] = (0.0, 0.0)) -> None:
        """Goes on from a saved state at the next message; `moved_sigma`, m and rad, is how far the
        body may have moved meanwhile."""
        frame = np.frombuffer(saved[:96], "<f8")
        if len(frame) != 12 or not np.isfinite(frame).all():
            raise PelorusError(f"{len(saved)} bytes are no saved state")
        drive = self._new_drive(None)
        try:
            drive.filter.restore(saved[96:])
        except FilterError:
            drive.close()
            raise
        self._end()
        self.drive, self._start = drive, None
        self._resume = np.diag(np.repeat(np.square(moved_sigma), 3))
        self.origin = Poses(frame[:9].reshape(3, 3), frame[9:])
        self.sequencer = Sequencer(PATIENCE_NS, self.sequencer.gap_ns)
        self.remarks.append("goes on from a saved state, which the log does not hold")

    _resume: Floats | None = None

    # --- drives

    def _use(self, expected: Datum | ClockStep) -> Iterator[Odom]:
        if isinstance(expected, ClockStep):
            self._follow(expected)
            return
        if self.drive is None:
            start = None if self._start is None else replace(self._start, t_ns=expected.t_ns)
            self.drive, self._start = self._new_drive(start), None
        if self._resume is not None:
            moved, self._resume = self._resume, None
            self._go_on(self.drive, expected.t_ns, moved)
        estimate = self.drive.use(expected)
        if estimate is None and not isinstance(expected, Stereo) and self._is_silent(expected.t_ns):
            estimate = self.drive.estimate()
        if estimate is not None and estimate.started:
            self._told_ns = estimate.t_ns
            yield self.odom(estimate)

    def _go_on(self, drive: Drive, t_ns: int, moved: Floats) -> None:
        """From a saved state. Where nothing lies between, as if it had never been interrupted."""
        between_ns = t_ns - drive.filter.time_ns
        if moved.any() or not 0 <= between_ns <= self.sequencer.gap_ns:
            drive.filter.resume(t_ns, moved if moved.any() else None)

    def _is_silent(self, t_ns: int) -> bool:
        """Whether nothing was told for long, though the drive has begun."""
        return self._told_ns >= 0 and t_ns - self._told_ns > SILENCE_NS

    def odom(self, estimate: Estimate) -> Odom:
        """Returns the base in `odom`."""
        T_WB = se3.compose(estimate.T_WB, self.T_IB)
        if self.origin is None:
            self.origin = level(T_WB)
        Ad = adjoint(se3.inverse(self.T_IB))
        P, U = (Ad @ C @ Ad.T for C in (estimate.covariance, estimate.velocity_covariance))
        T_OB = se3.compose(self.origin, T_WB)
        jumps = self._jumps + (self.drive.reset_count if self.drive is not None else 0)
        return Odom(estimate.t_ns, T_OB, P, Ad @ estimate.velocity, U, estimate, jumps)

    def _new_drive(self, start: Start | None) -> Drive:
        self.drives += 1
        path = self._log
        if path is not None and self.drives > 1:
            suffix = "".join(
                path.suffixes[-2:] if packed_file.is_packed(path) else path.suffixes[-1:]
            )
            path = path.with_name(f"{packed_file.bare_name(path)}-{self.drives}{suffix}")
        return Drive(self.setup, start, path, self._watch)

    def _end(self) -> None:
        if self.drive is not None:
            self._jumps += self.drive.reset_count + 1
            self.drive.close()
        self.drive, self._told_ns = None, -1

    def _begin_at(self, T_WI: Poses, P: Floats, bias: tuple[Floats, Floats] | None = None) -> None:
        self._end()
        flags = StartFlag.COVARIANCE
        prior = {}
        if bias is not None:
            flags |= StartFlag.BIAS_PRIOR
            prior = {"bias_mean": bias[0], "bias_variance": np.diag(bias[1]).copy()}
        self._start = Start(0, T_WI.R, T_WI.p, flags, pack_symmetric(P), **prior)

    def _follow(self, step: ClockStep) -> None:
        """A new drive from the last pose: how far it went meanwhile is not known."""
        seconds = (step.to_ns - step.from_ns) * 1e-9
        self.remarks.append(
            f"the stamps jumped by {seconds:+.3f} s: a new drive begins from the last pose, with a "
            "covariance for that time; is the clock set while driving, or does a bag loop?"
        )
        if self.drive is None:
            return
        last = self.drive.estimate()
        if not last.started:
            self._end()
            return
        self._begin_at(last.T_WB, self._widened(last, abs(seconds)), self._known_bias())

    def _known_bias(self) -> tuple[Floats, Floats] | None:
        assert self.drive is not None
        try:
            bias, P_b = self.drive.filter.bias()
        except FilterError:
            return None
        return (bias, P_b) if self.inertial and (np.diag(P_b) > 0).all() else None

    def _widened(self, last: Estimate, seconds: float) -> Floats:
        if last.health > LOST or (last.covariance == UNKNOWN_COVARIANCE).all():
            return UNKNOWN_COVARIANCE
        speed, rate = (np.abs(part).sum() for part in np.split(last.velocity, 2))
        beside = (UNSEEN_SPEED_MPS, USUAL_RATE_RADPS) if self.inertial else (0.0, 0.0)
        gone = [(speed + beside[0]) * seconds] * 3, [(rate + beside[1]) * seconds] * 3
        variance = np.minimum(np.square(np.concatenate(gone)), np.diag(UNKNOWN_COVARIANCE))
        return last.covariance + np.diag(variance)


def level(T_WB: Poses) -> Poses:
    """Returns the frame that has T_WB in its origin, with the same vertical, looking along x."""
    x = T_WB.R[:2, 0]
    heading = np.arctan2(x[1], x[0]) if np.hypot(*x) > 1e-6 else 0.0
    c, s = np.cos(heading), np.sin(heading)
    R = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    return Poses(R, -R @ T_WB.p)
