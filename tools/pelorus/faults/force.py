# SPDX-License-Identifier: MIT
"""The displacements between frames by an IMU, up to an unknown start.

With R(t) the attitude since the start of a stretch, from gyro or images, the velocity is V + g t +
int R M (a - b_a). V and g, three numbers each, are unknown in every stretch, and so is the
accelerometer's bias. All enter linearly, so least squares solves for them and for what is measured:
M, whose expected value is the identity, or one scale; biases; and the clock.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.seen import pauses
from pelorus.math import se3
from pelorus.math.inertial import Inertial
from pelorus.math.se3 import Poses
from pelorus.wire.layout import Floats

STRETCH_S = 10.0
STRETCH_FRAMES = 20
READINGS_HZ = 100.0
NO_BREAKS = np.empty(0)
OWN = 6  # unknowns of a stretch: V and g


@dataclass(frozen=True)
class Force:
    """Mean velocities between frames k and k + 1 in body axes, (k, 3, ...), and their derivatives.

    NaN where there are no readings. `turn` are the mean rates.
    """

    turn: Floats
    of_force: Floats  # (k, 3, 3, 3): by M_ij
    of_bias: Floats  # (k, 3, 3): by b_a
    of_gyro: Floats  # (k, 3, 3): by a gyro bias
    of_start: Floats  # (k, 3, 6): by V and g of the stretch
    stretch: NDArray[np.intp]

    @property
    def way(self) -> Floats:
        """Returns (k, 3) the mean velocities with M the identity."""
        return np.asarray(np.einsum("naii->na", self.of_force))

    def of_stretches(self) -> Floats:
        """Returns (k, 3, 6 n) the derivatives by the unknowns of all stretches, side by side."""
        count = int(self.stretch.max(initial=-1)) + 1
        out = np.zeros((len(self.stretch), 3, count, OWN))
        out[np.arange(len(self.stretch)), :, self.stretch] = self.of_start
        return out.reshape(len(self.stretch), 3, count * OWN)


def by_gyro(readings: Inertial, bias: Floats) -> Floats:
    """Returns (n, 3, 3) attitudes by the gyro; the first one's axes are the world's."""
    w = readings.w_B_radps - bias
    tau = np.diff(readings.t_ns)[:, None] * 1e-9
    steps = se3.exp(np.zeros((len(tau), 3)), 0.5 * (w[1:] + w[:-1]) * tau).R
    R = np.empty((len(w), 3, 3))
    R[0] = np.eye(3)
    for k, step in enumerate(steps):
        R[k + 1] = R[k] @ step
    return R


def by_images(readings: Inertial, frame_s: Floats, turns: Floats) -> Floats:
    """Returns the same by the images' turns (k, 3), radians in body axes from frame to frame."""
    t = seconds(readings)
    R = np.empty((len(turns) + 1, 3, 3))
    R[0] = np.eye(3)
    none = np.zeros_like(turns)
    for k, step in enumerate(se3.exp(none, turns).R):
        R[k + 1] = R[k] @ step
    at = np.clip(np.searchsorted(frame_s, t, side="right") - 1, 0, len(turns) - 1)
    share = np.clip((t - frame_s[at]) / (frame_s[at + 1] - frame_s[at]), 0, 1)
    return np.asarray(R[at] @ se3.exp(none[at], share[:, None] * turns[at]).R)


def thinned(readings: Inertial, most_hz: float = READINGS_HZ) -> Inertial:
    """Returns the readings averaged down to this rate, faster than which no body turns."""
    t = readings.t_ns
    rate = (len(t) - 1) / max(float(t[-1] - t[0]) * 1e-9, 1e-9) if len(t) > 1 else 0.0
    group = int(rate / most_hz)
    if group < 2:
        return readings
    count = len(t) // group
    since = (t[: count * group] - t[0]).reshape(count, group).mean(axis=1)
    numbers = (readings.a_B_mps2, readings.w_B_radps)
    a, w = (x[: count * group].reshape(count, group, 3).mean(axis=1) for x in numbers)
    return Inertial(t[:1] + since.astype(np.int64), a, w)


def seconds(readings: Inertial) -> Floats:
    """Returns the readings' times since the first one."""
    return np.asarray((readings.t_ns - readings.t_ns[0]) * 1e-9)


def force(readings: Inertial, R: Floats, frame_s: Floats, breaks_s: Floats = NO_BREAKS) -> Force:
    """Returns the mean velocities between frames by the readings.

    `frame_s` is on the IMU's clock, since the first reading; a stretch begins at each of
    `breaks_s`.
    """
    t = seconds(readings)
    turns, at = _attitudes(R, t, frame_s)
    tau = np.diff(frame_s)
    stretch, begin = _stretches(frame_s, t, breaks_s)
    body = _to_body(at, turns) / tau[:, None, None]

    def mean(rate: Floats) -> Floats:
        """Returns the mean body velocities that an acceleration in the world (n, 3, m) adds."""
        return np.asarray(body @ (_twice(t, rate, frame_s, begin[stretch])))

    a = readings.a_B_mps2
    of_force = mean((R[:, :, :, None] * a[:, None, None, :]).reshape(len(t), 3, 9))
    J = _summed(t, R)
    own = np.clip(np.searchsorted(begin, t, side="right") - 1, 0, len(begin) - 1)
    since = J - _interpolated(t, J, begin)[own]
    f = np.einsum("nij,nj->ni", R, a)
    # the attitude is off by -J b: the error of the force in the world
    of_gyro = mean(np.cross(f[:, :, None], since, axisa=1, axisb=1, axisc=1))
    first, second = frame_s[:-1] - begin[stretch], frame_s[1:] - begin[stretch]
    start = np.concatenate(
        (
            np.tile(np.eye(3), (len(tau), 1, 1)) * tau[:, None, None],
            np.tile(np.eye(3), (len(tau), 1, 1)) * (0.5 * (second**2 - first**2))[:, None, None],
        ),
        axis=2,
    )
    turn = rates_of_turn(readings, R, frame_s)
    return Force(
        turn, of_force.reshape(-1, 3, 3, 3), -mean(R), of_gyro, np.asarray(body @ start), stretch
    )


def rates_of_turn(readings: Inertial, R: Floats, frame_s: Floats) -> Floats:
    """Returns (k, 3) mean rates from each frame to the next; NaN where there are no readings."""
    t = seconds(readings)
    turns, _ = _attitudes(R, t, frame_s)
    return _reached(t, turns / np.diff(frame_s)[:, None], frame_s)


def mean_rates(readings: Inertial, frame_s: Floats) -> Floats:
    """Returns (k, 3) means of the gyro's readings; otherwise as rates_of_turn."""
    t = seconds(readings)
    turned = np.diff(_interpolated(t, _summed(t, readings.w_B_radps), frame_s), axis=0)
    return _reached(t, turned / np.diff(frame_s)[:, None], frame_s)


def _reached(t: Floats, rates: Floats, frame_s: Floats) -> Floats:
    """Returns the rates with NaN where there are no readings."""
    out = (frame_s[:-1] < 0) | (frame_s[1:] > t[-1]) | pauses(t, frame_s[:-1], frame_s[1:])
    rates[out] = np.nan
    return np.asarray(rates)


def _stretches(frame_s: Floats, t: Floats, breaks_s: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Returns each interval's stretch, and when stretches begin; pauses begin one, too."""
    whole = max(frame_s[-1] - frame_s[0], 1e-9)
    count = max(int(np.ceil(whole / STRETCH_S)), 1)
    count = max(min(count, (len(frame_s) - 1) // STRETCH_FRAMES), 1)
    begin = frame_s[0] + np.arange(count) * whole / count
    begin = np.union1d(begin, t[1:][pauses(t, t[:-1], t[1:])])
    begin = np.union1d(begin, breaks_s)
    own = np.searchsorted(begin, frame_s[:-1], side="right") - 1
    return np.clip(own, 0, len(begin) - 1), begin


def _attitudes(R: Floats, t: Floats, frame_s: Floats) -> tuple[Floats, Floats]:
    """Returns turns between frames (rad, in body axes), and the attitudes at all but the last."""
    k = np.clip(np.searchsorted(t, frame_s, side="right") - 1, 0, len(t) - 2)
    step = se3.log(Poses(np.swapaxes(R[k], 1, 2) @ R[k + 1], np.zeros((len(k), 3))))[:, 3:]
    share = np.clip((frame_s - t[k]) / (t[k + 1] - t[k]), 0, 1)
    at = R[k] @ se3.exp(np.zeros_like(step), share[:, None] * step).R
    relative = np.swapaxes(at[:-1], 1, 2) @ at[1:]
    turns = se3.log(Poses(relative, np.zeros((len(relative), 3))))[:, 3:]
    return np.asarray(turns), np.asarray(at[:-1])


def _to_body(at: Floats, turns: Floats) -> Floats:
    """Returns (k, 3, 3) maps of a displacement in the world to its constant body velocity."""
    R = se3.exp(np.zeros_like(turns), turns).R
    columns = [se3.log(Poses(R, np.tile(e, (len(R), 1))))[:, :3] for e in np.eye(3)]
    return np.asarray(np.stack(columns, axis=2) @ np.swapaxes(at, 1, 2))


def _summed(t: Floats, rate: Floats) -> Floats:
    """Returns the integral since the first reading, by trapezoids."""
    steps = np.diff(t).reshape(-1, *(1,) * (rate.ndim - 1))
    total = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * steps, axis=0)
    return np.concatenate((np.zeros_like(rate[:1]), total))


def _twice(t: Floats, rate: Floats, frame_s: Floats, begin_s: Floats) -> Floats:
    """Returns (k, 3, m) each interval's displacement by an acceleration since its begin."""
    once = _summed(t, rate)
    place = _interpolated(t, _summed(t, once), frame_s)
    tau = np.diff(frame_s)[:, None, None]
    return np.diff(place, axis=0) - _interpolated(t, once, begin_s) * tau


def _interpolated(t: Floats, x: Floats, at: Floats) -> Floats:
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    share = np.clip((at - t[k]) / (t[k + 1] - t[k]), 0, 1).reshape(-1, *(1,) * (x.ndim - 1))
    return np.asarray(x[k] + share * (x[k + 1] - x[k]))
