# SPDX-License-Identifier: MIT
"""The robot's path: twists by a smooth rule, poses by their exact integration.

With an IMU it needs accelerations: a Way is the same velocities, with ramps where it rests. They
and their derivatives are exact at any time; poses are their integral by two evaluations a step and
the commutator of these (Magnus, fourth order), exact to 1e-9 m at 100 steps a second. As in all of
the simulation, only sums, products, quotients and square roots are used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pelorus.math import motion
from pelorus.math.inertial import series
from pelorus.math.motion import Times, chain
from pelorus.math.se3 import Poses
from pelorus.simulate.settings import Span
from pelorus.wire.frames import TwistTiming
from pelorus.wire.layout import Floats

SERIES_TERMS = 9  # of the exponential map: exact to rounding up to 1 rad a step
TURN_MAX_RAD = 1.0

FIRST = Poses(  # a quarter turn left, off the origin: a wrong world frame would show
    np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([10.0, -5.0, 1.0])
)


class Drive(NamedTuple):
    """True twists at t_ns (what a perfect sensor reads) and the poses at these times."""

    t_ns: Times
    v_B_mps: Floats
    w_B_radps: Floats
    poses: Poses


def drive(
    t_ns: Times, timing: TwistTiming, speed_mps: float, lap_s: float, stop: Span | None = None
) -> Drive:
    """Returns laps of an uneven oval, with a little roll and pitch; in `stop` the body rests.

    The reading at t_j depends on `timing`; the poses are the integral of the readings, so truth and
    twists agree up to rounding.
    """
    v, w = profile_at(np.asarray(t_ns * 1e-9, np.float64), speed_mps, lap_s)
    if stop is not None:
        rests = stop.holds(t_ns)[:, None]
        v, w = np.where(rests, 0.0, v), np.where(rests, 0.0, w)
    tau = (np.diff(t_ns) * 1e-9)[:, None]
    steps = exp(tau * motion.held(v, timing), tau * motion.held(w, timing))
    return Drive(t_ns, v, w, motion.chain(steps, FIRST))


def stood(t_ns: Times) -> Drive:
    """Returns a drive that stays at the first pose."""
    still: Floats = np.zeros((len(t_ns), 3))
    R = np.broadcast_to(FIRST.R, (len(t_ns), 3, 3))
    return Drive(t_ns, still, still, Poses(R, np.broadcast_to(FIRST.p, still.shape)))


def profile_at(t: Floats, speed_mps: float, lap_s: float) -> tuple[Floats, Floats]:
    """Returns linear and angular velocity (n, 3) in a forward-left-up body at times in seconds."""
    lap_rate = 6.283185307179586 / lap_s
    v = np.stack(
        (
            speed_mps * (1 + 0.2 * wave(t / 17.0)),
            0.02 * speed_mps * wave(t / 5.0),
            0.02 * speed_mps * wave(t / 3.0),
        ),
        axis=-1,
    )
    w = np.stack(
        (0.05 * wave(t / 2.7), 0.04 * wave(t / 3.9), lap_rate * (1 + 0.6 * wave(3 * t / lap_s))),
        axis=-1,
    )
    return v, w


def profile_slope(t: Floats, speed_mps: float) -> Floats:
    """Returns the derivative of the linear velocity (n, 3)."""
    return np.stack(
        (
            0.2 / 17.0 * speed_mps * wave_slope(t / 17.0),
            0.02 / 5.0 * speed_mps * wave_slope(t / 5.0),
            0.02 / 3.0 * speed_mps * wave_slope(t / 3.0),
        ),
        axis=-1,
    )


def wave(x: Floats) -> Floats:
    """Returns an approximate sine of period 1 and amplitude 1, from parabolas."""
    x = x - np.floor(x)
    half = x < 0.5
    return np.where(half, 16 * x * (0.5 - x), -16 * (x - 0.5) * (1 - x))


def wave_slope(x: Floats) -> Floats:
    """Returns the derivative of `wave`, which is continuous."""
    x = x - np.floor(x)
    return np.where(x < 0.5, 8 - 32 * x, 32 * x - 24)


def exp(rho: Floats, theta: Floats) -> Poses:
    """Returns Exp of SE(3) by its power series, of (n, 3) and (n, 3)."""
    s = theta[:, 0] ** 2 + theta[:, 1] ** 2 + theta[:, 2] ** 2
    if len(s) and s.max() > TURN_MAX_RAD**2:
        raise ValueError(f"a step of {np.sqrt(s.max()):.2f} rad, at most {TURN_MAX_RAD} are exact")
    a, b, c = (series(s, order, SERIES_TERMS) for order in (1, 2, 3))
    identity = np.broadcast_to(np.eye(3), (len(s), 3, 3))
    hat: Floats = np.zeros((len(s), 3, 3))
    hat[:, 2, 1], hat[:, 0, 2], hat[:, 1, 0] = theta[:, 0], theta[:, 1], theta[:, 2]
    hat = hat - np.swapaxes(hat, 1, 2)
    squared = theta[:, :, None] * theta[:, None, :] - s[:, None, None] * identity
    R = identity + a[:, None, None] * hat + b[:, None, None] * squared
    V = identity + b[:, None, None] * hat + c[:, None, None] * squared
    return Poses(R, rotate(V, rho))


def rotate(R: Floats, x: Floats) -> Floats:
    """Returns R x for stacks, in a fixed order of operations."""
    return (
        R[..., :, 0] * x[..., None, 0]
        + R[..., :, 1] * x[..., None, 1]
        + (R[..., :, 2] * x[..., None, 2])
    )


# --- with accelerations, for an IMU ---------------------------------------------------------------


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
        v, w = profile_at(t_s, self.speed_mps, self.lap_s)
        share = self._share(t_s)[0][:, None]
        return share * v, share * w

    def acceleration(self, t_s: Floats) -> Floats:
        """Returns dv/dt (n, 3) of v in body axes."""
        v, _ = profile_at(t_s, self.speed_mps, self.lap_s)
        share, growth = (x[:, None] for x in self._share(t_s))
        return growth * v + share * profile_slope(t_s, self.speed_mps)

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


def way_poses(t_ns: Times, way: Way) -> Poses:
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
    return chain(exp(rho, theta), FIRST)


def specific_force(t_ns: Times, way: Way, R_WB: Floats, gravity: float) -> Floats:
    """Returns the specific force at the body's origin: dv/dt + w x v - R^T g."""
    t_s = seconds(t_ns)
    v, w = way.velocities(t_s)
    up = np.swapaxes(R_WB, 1, 2)
    return way.acceleration(t_s) + _cross(w, v) + rotate(up, np.array([[0.0, 0.0, gravity]]))


def _cross(x: Floats, y: Floats) -> Floats:
    (a, b, c), (d, e, f) = x.T, y.T
    return np.stack((b * f - c * e, c * d - a * f, a * e - b * d), axis=-1)
