# SPDX-License-Identifier: MIT
"""The robot's path: twists by a smooth rule, poses by their exact integration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pelorus.math import motion
from pelorus.math.inertial import series
from pelorus.math.motion import Times
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
    v, w = profile(t_ns, speed_mps, lap_s)
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


def profile(t_ns: Times, speed_mps: float, lap_s: float) -> tuple[Floats, Floats]:
    """Returns linear and angular velocity (n, 3) in a forward-left-up body."""
    return profile_at(np.asarray(t_ns * 1e-9, np.float64), speed_mps, lap_s)


def profile_at(t: Floats, speed_mps: float, lap_s: float) -> tuple[Floats, Floats]:
    """Returns the same at times in seconds."""
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
