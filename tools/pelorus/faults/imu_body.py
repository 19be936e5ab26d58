# SPDX-License-Identifier: MIT
"""The body's motion by an IMU, and its derivatives by what may be wrong with it.

f is the velocity by the specific force within a stretch, without its start and gravity
(pelorus.faults.force):

    w = a w_B - b_w + phi x w_B + dt w_B'
    v = s g - b_a.. + phi x g + w_B x dr + dt g',      g = f + R' (V + g t) + w_B x r

A wrong baseline is s; a wrong focal length changes turns and displacements of the images.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.drift import Densities, Drift
from pelorus.faults.fit import (
    BIAS,
    CLOCK,
    FOCAL,
    GYRO,
    LEVER,
    PARAMETERS,
    SCALE,
    TILT,
    TURN,
    TURN_SCALE,
    Design,
    Fit,
    joined,
)
from pelorus.faults.force import Force, by_gyro, force, mean_rates, rates_of_turn, thinned
from pelorus.faults.seen import CameraMotion, Motions, slope
from pelorus.io.recording import Recording
from pelorus.math import se3
from pelorus.math.inertial import Inertial
from pelorus.wire.layout import Floats

Flags = NDArray[np.bool_]
START_MPS, GRAVITY_MPS2 = 100.0, 100.0  # sigmas of the start of a stretch
GYRO_SCALE = 0.005  # sigma: no focal length is known better without it


class ImuBody:
    """The motion between frames by the readings of an IMU."""

    def __init__(self, recording: Recording, seen: CameraMotion) -> None:
        self.readings = thinned(_until(recording))
        self.attitudes = by_gyro(self.readings, np.zeros(3))
        self._set_bias(recording.frame_t_ns, seen)

    def _set_bias(self, frame_t_ns: NDArray[np.int64], seen: CameraMotion) -> None:
        """Corrects the gyro's attitudes by the bias against the images: their median difference."""
        off = self.turns(frame_t_ns, 0.0) - seen.rates[:, 3:]
        bias = np.nanmedian(off[seen.usable], axis=0)
        if np.isfinite(bias).all():
            self.attitudes = by_gyro(self.readings, bias)

    def force(self, frame_t_ns: NDArray[np.int64], offset_s: float) -> Force:
        """Returns the mean velocities between frames that are `offset_s` later."""
        return force(self.readings, self.attitudes, self.frame_s(frame_t_ns, offset_s))

    def frame_s(self, frame_t_ns: NDArray[np.int64], offset_s: float) -> Floats:
        return np.asarray((frame_t_ns - self.readings.t_ns[0]) * 1e-9 + offset_s)

    def turns(self, frame_t_ns: NDArray[np.int64], offset_s: float) -> Floats:
        """Returns the mean rates between frames, as fit.Body."""
        return rates_of_turn(self.readings, self.attitudes, self.frame_s(frame_t_ns, offset_s))

    def mean_turns(self, frame_t_ns: NDArray[np.int64], offset_s: float) -> Floats:
        """Returns (k, 3) the readings' own means from frame to frame.

        They are `turns` but for the order of turns, and right in any unit: degrees taken for
        radians go round several times.
        """
        frame_s = self.frame_s(frame_t_ns, offset_s)
        return mean_rates(self.readings, frame_s)

    def design(
        self, recording: Recording, seen: CameraMotion, offset_s: float, bias: float
    ) -> Design:
        """Returns the design of the usable pairs, as fit.Body."""
        told = self.force(recording.frame_t_ns, offset_s)
        arm = -recording.T_CB.R.T @ recording.T_CB.p
        of = Densities.of(recording.header.noise, self.readings)
        drift = Drift(told, np.diff(recording.frame_t_ns) * 1e-9, of)
        every = [_design(told, arm, own, others, bias) for own, others in seen.pairs()]
        return replace(joined(*every), drift=drift)


def _design(
    told: Force, arm: Floats, seen: CameraMotion, others: list[Motions], bias: float
) -> Design:
    """Returns the design; `others` are the instruments."""
    stretches = told.of_stretches()
    g = told.way + np.cross(told.turn, arm)
    good = seen.usable & np.isfinite(told.turn).all(axis=1)
    left = np.where(good[:, None], seen.rates[:, :3] - g, 0.0)
    g = g + stretches @ _start(left[good], stretches[good], seen.variance[good, :3])
    both = np.hstack((g, told.turn))
    X = _columns(told, stretches, both, slope(both, 1, float(np.median(seen.tau_s))))
    if seen.by_focal is not None:
        X[:, :, FOCAL] = seen.by_focal
    Z = np.concatenate([_instruments(told, stretches, z) for z in others], axis=2)
    k = np.flatnonzero(good & np.isfinite(X).all(axis=(1, 2)) & np.isfinite(Z).all(axis=(1, 2)))
    y, prior = seen.rates - both, _prior(bias, stretches.shape[2])
    return Design(y[k], X[k], Z[k], seen.variance[k], prior, g[k], k)


def _instruments(told: Force, stretches: Floats, z: Motions) -> Floats:
    out = _columns(told, stretches, z.rates, z.slope)
    if z.by_focal is not None:
        out[:, :, FOCAL] = z.by_focal
    return out


def _columns(told: Force, stretches: Floats, both: Floats, by_time: Floats) -> Floats:
    """Returns (k, 6, m) what each unknown adds to a motion (v, w) and its slope."""
    g, w = both[:, :3], both[:, 3:]
    X = np.zeros((len(g), 6, PARAMETERS + stretches.shape[2]))
    X[:, :3, SCALE] = g
    X[:, :3, BIAS : BIAS + 3] = told.of_bias
    X[:, :3, LEVER : LEVER + 3] = se3.skew(w)
    X[:, :3, TILT : TILT + 3] = -se3.skew(g)
    X[:, 3:, TILT : TILT + 3] = -se3.skew(w)
    X[:, :3, GYRO : GYRO + 3] = told.of_gyro
    X[:, 3:, GYRO : GYRO + 3] = -np.eye(3)
    X[:, 3:, TURN_SCALE] = w
    X[:, :, CLOCK] = by_time
    X[:, :3, PARAMETERS:] = stretches
    return X


def _until(recording: Recording) -> Inertial:
    """Returns the readings that the frames need."""
    readings = recording.inertial
    numbers = np.hstack((readings.a_B_mps2, readings.w_B_radps))
    finite: Flags = np.asarray(np.isfinite(numbers).all(axis=1), np.bool_)
    readings = readings.at(finite)
    t = readings.t_ns
    most = int(np.searchsorted(t, recording.frame_t_ns[-1] + 10**9))
    least = max(int(np.searchsorted(t, recording.frame_t_ns[0] - 10**9)), 0)
    return readings.at(slice(least, most))


def _start(y: Floats, X: Floats, variance: Floats) -> Floats:
    """Returns the starts of the stretches, fitted robustly as if all else were right."""
    sigma = np.resize([START_MPS] * 3 + [GRAVITY_MPS2] * 3, X.shape[2])
    fit = Fit(Design(y, X, X, variance, np.diag(sigma**-2), y, np.arange(len(y))))
    return fit.x


def _prior(bias: float, starts: int) -> Floats:
    """Returns inverse variances: nothing but the accelerometer's bias is known beforehand."""
    sigma = np.full(PARAMETERS + starts, 10.0)
    sigma[BIAS : BIAS + 3] = bias
    sigma[LEVER : LEVER + 3] = 3.0
    sigma[TILT : TILT + 3] = sigma[TURN : TURN + 3] = 0.2
    sigma[CLOCK] = 0.3
    sigma[GYRO : GYRO + 3] = 0.3
    sigma[TURN_SCALE] = GYRO_SCALE
    sigma[PARAMETERS:] = np.resize([START_MPS] * 3 + [GRAVITY_MPS2] * 3, starts)
    return np.diag(sigma**-2)
