# SPDX-License-Identifier: MIT
"""Readings of an IMU, and the motion that they alone give.

Specific force a = R^T (d2p/dt2 - g) and angular rate w in body axes, which are the IMU's; R, p
bring the body to the world, v is the velocity in body axes, g = (0, 0, -gravity). Over tau, with a
and w constant (docs/MATH.md, the drive by an IMU), W = [tau w]x:

    E = Exp(tau w),  G1 = sum W^k / (k+1)!,  G2 = sum W^k / (k+2)!
    p <- p + R (tau v + tau^2 (R^T g / 2 + G2 a)),  v <- E^T (v + tau (R^T g + G1 a)),  R <- R E
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.math import se3
from pelorus.math.motion import Times
from pelorus.wire.frames import IMU_READINGS_MAX, Imu
from pelorus.wire.layout import Floats

GRAVITY_MPS2 = 9.81
SERIES_TERMS = 6  # exact to rounding for up to 0.3 rad a step
STAMP_TOLERANCE_NS = 100  # a batch has one period: error of its stamps
PERIOD_MAX_NS = 2**32 - 1  # of a batch, a u32; a longer pause begins a new one


class Inertial(NamedTuple):
    """Readings of an IMU at n times."""

    t_ns: Times
    a_B_mps2: Floats  # (n, 3)
    w_B_radps: Floats

    def at(self, index: slice | NDArray[np.intp] | NDArray[np.bool_]) -> Inertial:
        return Inertial(self.t_ns[index], self.a_B_mps2[index], self.w_B_radps[index])

    def between(self, t_ns: Times) -> Inertial:
        """Interpolates linearly at any times; beyond the ends the first and last reading hold."""
        # relative times: a double cannot hold nanoseconds of today's clock
        own, at = self.t_ns - self.t_ns[:1], t_ns - self.t_ns[:1]
        columns = np.hstack((self.a_B_mps2, self.w_B_radps)).T
        found = np.stack([np.interp(at, own, x) for x in columns], axis=-1)
        return Inertial(t_ns, found[:, :3], found[:, 3:])


NO_READINGS = Inertial(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3)))


class MotionState(NamedTuple):
    """Poses and velocities of bodies: R (..., 3, 3), p in the world, v in body axes."""

    R: Floats
    p: Floats
    v_B: Floats


def step(state: MotionState, tau_s: Floats, a: Floats, w: Floats, g_W: Floats) -> MotionState:
    """Moves every state (...) by its own tau, with constant a and w."""
    tau = tau_s[..., None]
    turn = tau * w
    W = se3.skew(turn)
    square = W @ W
    t2 = np.sum(turn * turn, axis=-1)[..., None, None]
    s1, s2, s3, s4 = (series(t2, order, SERIES_TERMS) for order in (1, 2, 3, 4))
    E = np.eye(3) + s1 * W + s2 * square
    G1 = np.eye(3) + s2 * W + s3 * square
    G2 = 0.5 * np.eye(3) + s3 * W + s4 * square
    down = _times(np.swapaxes(state.R, -1, -2), g_W)
    moved = tau * state.v_B + tau * tau * (0.5 * down + _times(G2, a))
    v_B = _times(np.swapaxes(E, -1, -2), state.v_B + tau * (down + _times(G1, a)))
    return MotionState(state.R @ E, state.p + _times(state.R, moved), v_B)


def _times(M: Floats, x: Floats) -> Floats:
    return np.asarray(np.einsum("...ij,...j->...i", M, x))


def series(s: Floats, order: int, terms: int) -> Floats:
    """Returns sum_k (-s)^k / (2k + order)!, s = a^2.

    That is sin(a)/a, (1 - cos a)/a^2 and (a - sin a)/a^3 for order 1, 2 and 3.
    """
    total = np.ones_like(s)
    for k in range(terms, 0, -1):
        n = 2 * k + order
        total = 1 - s / (n * (n - 1)) * total
    return np.asarray(total / (1.0, 1.0, 2.0, 6.0, 24.0)[order])


def coasted(
    readings: Inertial, from_ns: Times, until_ns: Times, first: MotionState, gravity: float
) -> MotionState:
    """Moves many states in parallel: from `first` (n) at `from_ns` (n) to `until_ns`.

    Each interval has the mean of the readings at both ends; where a stretch cuts one, they are
    interpolated.
    """
    g_W = np.array([0.0, 0.0, -gravity])
    begin = np.searchsorted(readings.t_ns, from_ns, side="right")
    end = np.searchsorted(readings.t_ns, until_ns, side="left")
    state, now = first, from_ns
    reading = readings.between(from_ns)
    for k in range(int((end - begin).max(initial=0)) + 1):
        inner = np.minimum(begin + k, len(readings.t_ns) - 1)
        then = np.where(begin + k < end, readings.t_ns[inner], until_ns)
        following = readings.between(then)
        a = 0.5 * (reading.a_B_mps2 + following.a_B_mps2)
        w = 0.5 * (reading.w_B_radps + following.w_B_radps)
        state = step(state, np.asarray((then - now) * 1e-9), a, w, g_W)
        now, reading = then, following
    return state


def path(readings: Inertial, first: MotionState, gravity: float) -> MotionState:
    """Returns the states (n) at the times of the readings, beginning with `first`."""
    g_W = np.array([0.0, 0.0, -gravity])
    tau: Floats = np.diff(readings.t_ns) * 1e-9
    a = 0.5 * (readings.a_B_mps2[:-1] + readings.a_B_mps2[1:])
    w = 0.5 * (readings.w_B_radps[:-1] + readings.w_B_radps[1:])
    states = [first]
    for k in range(len(tau)):
        states.append(step(states[-1], tau[k], a[k], w[k], g_W))
    return MotionState(*(np.array(part) for part in zip(*states, strict=True)))


def messages(
    readings: Inertial, cuts_ns: Times, most: int = IMU_READINGS_MAX
) -> Iterator[tuple[int, Imu]]:
    """Yields IMU frames of up to `most` readings, each with the time of its last one.

    No batch has readings on both sides of a cut, and none has a stamp that is off by more than
    STAMP_TOLERANCE_NS. Cuts are the times, in order, of all that the filter takes besides: frames
    and readings of small sensors. A batch across one would make it late.
    """
    side = np.searchsorted(cuts_ns, readings.t_ns, side="left")
    begin, count = 0, len(readings.t_ns)
    while begin < count:
        end = _batch_end(readings.t_ns, side, begin, min(begin + most, count))
        t_ns = readings.t_ns[begin:end]
        period = _period(t_ns) if end - begin > 1 else 0
        rows = slice(begin, end)
        yield (
            int(t_ns[-1]),
            Imu(int(t_ns[0]), readings.a_B_mps2[rows], readings.w_B_radps[rows], period),
        )
        begin = end


def _period(t_ns: Times) -> int:
    return round(int(t_ns[-1] - t_ns[0]) / (len(t_ns) - 1))


def _batch_end(t_ns: Times, side: NDArray[np.intp], begin: int, most: int) -> int:
    end = begin + int(np.searchsorted(side[begin:most], side[begin], side="right"))
    while end - begin > 1:
        own = t_ns[begin:end]
        period = _period(own)
        off = own - own[0] - period * np.arange(end - begin)
        if period <= PERIOD_MAX_NS and np.abs(off).max() <= STAMP_TOLERANCE_NS:
            break
        end = begin + max((end - begin) // 2, 1)
    return end
