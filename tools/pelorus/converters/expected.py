# SPDX-License-Identifier: MIT
"""How points in the pictures are expected to have moved, by twists or by a gyro."""

from __future__ import annotations

import numpy as np

from pelorus.eyes.front_end import Motion
from pelorus.math import motion, se3
from pelorus.math.inertial import Inertial
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.wire.frames import TwistTiming
from pelorus.wire.layout import Floats

MOST_M = 100.0  # from pair to pair; more is another unit


class Expected:
    """The camera's motion between pictures of these times, as far as it is measured."""

    def __init__(self, t_ns: Times, T_CB: Poses, own_ns: Times) -> None:
        self._T_CB = T_CB
        self._known = (t_ns >= own_ns[0]) & (t_ns <= own_ns[-1])
        self._path: Poses | None = None
        self._turns_alone = True

    @classmethod
    def by_twists(
        cls,
        t_ns: Times,
        T_CB: Poses,
        twists: tuple[Times, Floats, Floats],
        measured: frozenset[str],
        timing: TwistTiming,
    ) -> Expected:
        """Returns that of times, velocities and rates, of which some were `measured`."""
        found = cls(t_ns, T_CB, twists[0])
        if measured:
            found._path = motion.path_at(t_ns, *twists, timing)
            found._turns_alone = not measured & {"vx", "vy", "vz"}
        return found

    @classmethod
    def by_gyro(cls, t_ns: Times, T_CB: Poses, readings: Inertial) -> Expected:
        """Returns that of a gyro: the turn alone."""
        found = cls(t_ns, T_CB, readings.t_ns)
        w, still = readings.w_B_radps, np.zeros_like(readings.w_B_radps)
        found._path = motion.path_at(t_ns, readings.t_ns, still, w, TwistTiming.MID)
        return found

    def between(self, earlier: int, later: int) -> Motion | None:
        """Returns (R, p), x_later = R x_earlier + p in the camera, of two pictures by their number;
        p = 0 where only the turn is measured."""
        path = self._path
        if path is None or not (self._known[earlier] and self._known[later]):
            return None
        moved = se3.compose(se3.inverse(path.at(later)), path.at(earlier))
        seen = se3.conjugate(self._T_CB, moved)
        p = np.zeros(3) if self._turns_alone else seen.p
        finite = np.isfinite(seen.R).all() and np.isfinite(p).all()
        return (seen.R, p) if finite and np.abs(p).max() <= MOST_M else None
