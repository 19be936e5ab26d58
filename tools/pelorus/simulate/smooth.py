# SPDX-License-Identifier: MIT
"""A drive with accelerations: the velocities of `drive.profile`, with ramps where it rests.

Velocities and their derivatives are exact at any time; poses are their integral by two evaluations
a step and the commutator of these (Magnus, fourth order), exact to 1e-9 m at 100 steps a second. As
in all of the simulation, only sums, products, quotients and square roots are used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pelorus.math.motion import Times, chain
from pelorus.math.se3 import Poses
from pelorus.simulate import drive
from pelorus.simulate.drive import rotate
from pelorus.simulate.settings import Span
from pelorus.wire.layout import Floats

RAMP_S = 2.0  # from rest to full speed
GAUSS = 0.28867513459481287  # sqrt(3) / 6: from the middle of a step to its evaluations


class Way(NamedTuple):
    """The body's velocity as a function of time."""

    speed_mps: float
    lap_s: float
    rest_s: float = 0.0  # at the beginning
    stop: Span | None = None
    parked: bool = False

    def velocities(self, t_s: Floats) -> tuple[Floats, Floats]:
        """Returns v and w (n, 3) in body axes."""
        v, w = drive.profile_at(t_s, self.speed_mps, self.lap_s)
        share = self._share(t_s)[0][:, None]
        return share * v, share * w

    def acceleration(self, t_s: Floats) -> Floats:
        """Returns dv/dt (n, 3) of v in body axes."""
        v, _ = drive.profile_at(t_s, self.speed_mps, self.lap_s)
        share, growth = (x[:, None] for x in self._share(t_s))
        return growth * v + share * drive.profile_slope(t_s, self.speed_mps)

    def _share(self, t_s: Floats) -> tuple[Floats, Floats]:
        """Returns the share of the full speed, 0 to 1, and its derivative."""
        share, growth = _smooth_step((t_s - self.rest_s) / RAMP_S)
        if self.parked or not self.rest_s:
            share, growth = np.full_like(t_s, not self.parked), np.zeros_like(t_s)
        if self.stop is None:
            return share, growth / RAMP_S
        down, slower = _smooth_step((self.stop.from_s - t_s) / RAMP_S)
        end_s = self.stop.from_s + self.stop.for_s if self.stop.for_s else np.inf
        up, faster = _smooth_step((t_s - end_s) / RAMP_S)
        moves, change = down + up, faster - slower
        return share * moves, (growth * moves + share * change) / RAMP_S


def _smooth_step(x: Floats) -> tuple[Floats, Floats]:
    """Returns a step from 0 to 1 over 0 to 1 with two derivatives, and its derivative."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (10 - 15 * x + 6 * x * x), 30 * x * x * (1 - x) * (1 - x)


def seconds(t_ns: Times) -> Floats:
    """Returns times in seconds."""
    return np.asarray(t_ns * 1e-9, np.float64)


def poses(t_ns: Times, way: Way) -> Poses:
    """Returns poses at ascending times, beginning at the drive's first pose."""
    t_s = seconds(t_ns)
    tau = np.diff(t_s)
    middle = t_s[:-1] + 0.5 * tau
    (v1, w1), (v2, w2) = (way.velocities(middle + side * GAUSS * tau) for side in (-1, 1))
    tau = tau[:, None]
    half, bracket = 0.5 * tau, 0.5 * GAUSS * tau * tau
    # the commutator of the twists at the second and at the first evaluation
    rho = half * (v1 + v2) - bracket * (_cross(w2, v1) - _cross(w1, v2))
    theta = half * (w1 + w2) - bracket * _cross(w2, w1)
    return chain(drive.exp(rho, theta), drive.FIRST)


def specific_force(t_ns: Times, way: Way, R_WB: Floats, gravity: float) -> Floats:
    """Returns the specific force at the body's origin: dv/dt + w x v - R^T g."""
    t_s = seconds(t_ns)
    v, w = way.velocities(t_s)
    up = np.swapaxes(R_WB, 1, 2)
    return way.acceleration(t_s) + _cross(w, v) + rotate(up, np.array([[0.0, 0.0, gravity]]))


def _cross(x: Floats, y: Floats) -> Floats:
    (a, b, c), (d, e, f) = x.T, y.T
    return np.stack((b * f - c * e, c * d - a * f, a * e - b * d), axis=-1)
