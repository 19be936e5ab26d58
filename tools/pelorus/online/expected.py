# SPDX-License-Identifier: MIT
"""How the points in the pictures are expected to have moved since the last pair."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.wire import schema
from pelorus.wire.layout import Floats

KEPT_NS = 2_000_000_000  # velocities older than this say nothing of the next pair
# a velocity that is known worse does not say where points will be
SPEED_SIGMA_MPS = schema.EYES_SPEED_SIGMA_MPS


class Velocity(NamedTuple):
    """Of the body, in its own axes; None: not known, as of a gyro alone."""

    t_ns: int
    w_radps: Floats
    v_mps: Floats | None


class ExpectedMotion:
    """Collects velocities of the body and tells the points' motion from pair to pair.

    `T_CB` brings points of the body into the camera.
    """

    def __init__(self, T_CB: Poses) -> None:
        self._T_CB = T_CB
        self._velocities: deque[Velocity] = deque()
        self._last_ns: int | None = None

    def add(self, one: Velocity) -> None:
        """Takes the velocity from its time on."""
        if self._velocities and one.t_ns <= self._velocities[-1].t_ns:
            return
        self._velocities.append(one)
        while one.t_ns - self._velocities[0].t_ns > KEPT_NS:
            self._velocities.popleft()

    def until(self, t_ns: int) -> tuple[Floats, Floats] | None:
        """Returns (R, p), x_now = R x_then + p in the camera, since the pair before this one; None
        for the first pair, or where no velocity is known."""
        last, self._last_ns = self._last_ns, t_ns
        if last is None or not last < t_ns <= last + KEPT_NS or not self._velocities:
            return None
        known = [one for one in self._velocities if last <= one.t_ns < t_ns]
        used = known or [self._velocities[-1]]
        seconds = (t_ns - last) * 1e-9
        speeds = [one.v_mps for one in used if one.v_mps is not None]
        v = np.mean(speeds, axis=0) if speeds else np.zeros(3)
        step = se3.exp(v * seconds, np.mean([one.w_radps for one in used], axis=0) * seconds)
        now = se3.conjugate(self._T_CB, se3.inverse(step))
        return now.R, now.p if speeds else np.zeros(3)


def known_velocity(velocity: Floats, covariance: Floats) -> Floats | None:
    """Returns the linear part of (v, w) where it is known well enough to tell where points are."""
    sigma = np.sqrt(np.diag(covariance)[:3])
    return velocity[:3] if bool((sigma < SPEED_SIGMA_MPS).all()) else None
