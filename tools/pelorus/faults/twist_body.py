# SPDX-License-Identifier: MIT
"""The body's motion by the twists, and its derivatives by what may be wrong with it.

w = a w_B - b_w + phi_w x w_B + (dt + dt_w) w_B'
v = s g - b_v + phi_v x g + w_B x dr + dt g',      g = v_B + w_B x r

dt_w, the delay of the rates of turn behind the velocities, is 0 unless it is asked for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.fit import (
    BIAS,
    CLOCK,
    GYRO,
    LEVER,
    PARAMETERS,
    SCALE,
    TILT,
    TURN,
    TURN_CLOCK,
    TURN_SCALE,
    Design,
)
from pelorus.faults.seen import CameraMotion, beside, pauses, slope
from pelorus.io.recording import Recording
from pelorus.math import se3
from pelorus.math.motion import dead_reckoning
from pelorus.math.se3 import Poses
from pelorus.wire.layout import Floats

ONE_CLOCK_S, OWN_CLOCK_S = 1e-6, 0.3  # prior sigmas of the rates' delay behind the velocities
SPREAD_MOST = 3.0  # factor on the usual difference of images and twists
FAR, NEAR = 3, 2  # frames from which a slope is taken, beyond the reach of a reading's noise


class TwistBody:
    """The motion between any two times by the twists.

    `turns_late_s`: the rates of turn are taken so much later than the velocities, and this delay is
    estimated, too. `for_place`: the lever's column is free of the gyro's noise, and less precise;
    the other unknowns are more precise with one that is slightly biased.
    """

    def __init__(
        self,
        recording: Recording,
        turns_late_s: float | None = None,
        for_place: bool = False,
    ) -> None:
        header = recording.header
        self._turns_late_s, self._for_place = turns_late_s, for_place
        self._t_ns, self._v, self._w = recording.twist_t_ns, recording.v_B_mps, recording.w_B_radps
        self._nodes = dead_reckoning(self._t_ns, self._v, self._w, header.twist_timing)
        before, after = self._nodes.at(slice(None, -1)), self._nodes.at(slice(1, None))
        self._between = se3.log(se3.compose(se3.inverse(before), after))
        self._held = header.twist_timing.name

    def at(self, t_s: Floats) -> Poses:
        """Returns poses at seconds since the first twist; the rate is constant between nodes."""
        nodes = (self._t_ns - self._t_ns[0]) * 1e-9
        k = np.clip(np.searchsorted(nodes, t_s, side="right") - 1, 0, len(nodes) - 2)
        share = (t_s - nodes[k]) / (nodes[k + 1] - nodes[k])
        part = self._between[k] * np.clip(share, 0, 1)[:, None]
        return se3.compose(self._nodes.at(k), se3.exp(part[:, :3], part[:, 3:]))

    def rates(self, frame_t_ns: NDArray[np.int64], lag: int, offset_s: float) -> Floats:
        """Returns (k, 6) mean v and w between frames k and k + lag that are `offset_s` later.

        NaN where there are no twists.
        """
        out = self._rates(frame_t_ns, lag, offset_s)
        if self._turns_late_s:
            out[:, 3:] = self._rates(frame_t_ns, lag, offset_s + self._turns_late_s)[:, 3:]
        return out

    def _rates(self, frame_t_ns: NDArray[np.int64], lag: int, offset_s: float) -> Floats:
        """Returns the same for one clock of velocities and rates."""
        t = (frame_t_ns - self._t_ns[0]) * 1e-9 + offset_s
        path = self.at(t)
        tau = t[lag:] - t[:-lag]
        motion = se3.compose(se3.inverse(path.at(slice(None, -lag))), path.at(slice(lag, None)))
        out = np.asarray(se3.log(motion) / tau[:, None])
        end = (self._t_ns[-1] - self._t_ns[0]) * 1e-9
        out[(t[:-lag] < 0) | (t[lag:] > end)] = np.nan
        at_ns = frame_t_ns + round(offset_s * 1e9)
        out[pauses(self._t_ns, at_ns[:-lag], at_ns[lag:])] = np.nan
        return out

    def turns(self, frame_t_ns: NDArray[np.int64], offset_s: float) -> Floats:
        """Returns the mean rates between frames, as fit.Body."""
        return self.rates(frame_t_ns, 1, offset_s)[:, 3:]

    def design(
        self, recording: Recording, seen: CameraMotion, offset_s: float, bias: float
    ) -> Design:
        """Returns the design of the usable pairs, as fit.Body.

        Instruments keep scale and time free of the twists' noise: the same motion some frames away.
        """
        rates = self.rates(recording.frame_t_ns, 1, offset_s)
        arm = -recording.T_CB.R.T @ recording.T_CB.p
        w = rates[:, 3:]
        g = rates[:, :3] + np.cross(w, arm)
        usable = seen.usable & np.isfinite(beside(np.hstack((g, w)), 3)).all(axis=1)
        usable &= np.isfinite(rates).all(axis=1)
        y = seen.rates - np.hstack((g, w))
        X, Z = _columns(g, w, seen)
        if self._for_place:
            Z[:, :3, LEVER : LEVER + 3] = se3.skew(beside(w, 2))
        k = np.flatnonzero(usable & np.isfinite(X + Z).all(axis=(1, 2)))
        own = ONE_CLOCK_S if self._turns_late_s is None else OWN_CLOCK_S
        return Design(y[k], X[k], Z[k], seen.variance[k], _prior(bias, own), g[k], k)


def _prior(bias: float, turns_late: float) -> Floats:
    """Returns inverse variances: nothing but the velocity's bias is known beforehand."""
    sigma = np.full(PARAMETERS, 10.0)
    sigma[BIAS : BIAS + 3] = bias
    sigma[LEVER : LEVER + 3] = 3.0
    sigma[TILT : TILT + 3] = sigma[TURN : TURN + 3] = 0.2
    sigma[CLOCK], sigma[TURN_CLOCK] = 0.3, turns_late
    sigma[GYRO : GYRO + 3] = 0.3
    return np.diag(sigma**-2)


def _columns(g: Floats, w: Floats, seen: CameraMotion) -> tuple[Floats, Floats]:
    """Returns (k, 6, m) what each unknown adds to (v, w), and the instruments."""
    X = np.zeros((len(g), 6, PARAMETERS))
    X[:, :3, SCALE] = g
    X[:, :3, BIAS : BIAS + 3] = X[:, 3:, GYRO : GYRO + 3] = -np.eye(3)
    X[:, :3, LEVER : LEVER + 3] = se3.skew(w)
    X[:, :3, TILT : TILT + 3] = -se3.skew(g)
    X[:, 3:, TURN : TURN + 3] = -se3.skew(w)
    X[:, 3:, TURN_SCALE] = w
    both = np.hstack((g, w))
    X[:, :, CLOCK] = slope(both, 1, float(np.median(seen.tau_s)))
    Z = X.copy()
    Z[:, :3, SCALE] = beside(g, 2, 3)
    Z[:, 3:, TURN_SCALE] = beside(w, 2, 3)
    Z[:, :, CLOCK] = _slope_beside(both, seen)
    X[:, 3:, TURN_CLOCK], Z[:, 3:, TURN_CLOCK] = X[:, 3:, CLOCK], Z[:, 3:, CLOCK]
    return X, Z


def _slope_beside(told: Floats, seen: CameraMotion) -> Floats:
    """Returns the slope by time, by images and twists of neighbouring frames, weighted by
    precision.

    Between two readings the twists are a mean of both, and share their noise with the next but one:
    their slope is taken from farther away. An instrument that shares it would make any offset by
    half a reading look right.
    """
    tau_s = float(np.median(seen.tau_s))
    off = np.where(seen.usable[:, None], seen.rates - told, 0.0)
    off = np.where(np.isfinite(off), off, 0.0)
    off -= np.median(off, axis=0)
    spread = 2.198 * np.median(off[seen.usable] ** 2, axis=0) + 1e-12
    of_images = np.median(seen.variance[seen.usable], axis=0)
    share = np.clip(1 - of_images / spread, 0, 1)  # share of the noise that the twists have
    most = SPREAD_MOST * np.sqrt(spread)
    by_images = slope(told + np.clip(off, -most, most), NEAR, tau_s)
    return np.asarray(share * by_images + (1 - share) * slope(told, FAR, tau_s))
