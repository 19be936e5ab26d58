# SPDX-License-Identifier: MIT
"""What the twists say of the body's motion, and what may be wrong with it:

w = a w_B - b_w + phi_w x w_B + (dt + dt_w) w_B'
v = s g - b_v + phi_v x g + w_B x dr + dt g',      g = v_B + w_B x r

dt_w, by which the rates of turn are later than the velocities, is 0 unless it is asked for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pelorus import se3
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
    joined,
)
from pelorus.faults.seen import Motions, Seen, pauses, slope
from pelorus.layout import Floats
from pelorus.motion import dead_reckoning
from pelorus.recording import Recording
from pelorus.se3 import Poses

ONE_CLOCK_S, OWN_CLOCK_S = 1e-6, 0.3  # sigmas of by how much the rates of turn are later


class TwistBody:
    """What the twists say of the motion between any two times. `turns_late_s`: the rates of turn
    are taken so much later than the velocities, and how far they are from that is asked, too.
    """

    def __init__(
        self,
        recording: Recording,
        turns_late_s: float | None = None,
    ) -> None:
        header = recording.header
        self._turns_late_s = turns_late_s
        self._t_ns, self._v, self._w = recording.twist_t_ns, recording.v_B_mps, recording.w_B_radps
        self._nodes = dead_reckoning(self._t_ns, self._v, self._w, header.twist_timing)
        before, after = self._nodes.at(slice(None, -1)), self._nodes.at(slice(1, None))
        self._between = se3.log(se3.compose(se3.inverse(before), after))
        self._held = header.twist_timing.name

    def at(self, t_s: Floats) -> Poses:
        """Poses at seconds since the first twist; between two nodes at an even rate."""
        nodes = (self._t_ns - self._t_ns[0]) * 1e-9
        k = np.clip(np.searchsorted(nodes, t_s, side="right") - 1, 0, len(nodes) - 2)
        share = (t_s - nodes[k]) / (nodes[k + 1] - nodes[k])
        part = self._between[k] * np.clip(share, 0, 1)[:, None]
        return se3.compose(self._nodes.at(k), se3.exp(part[:, :3], part[:, 3:]))

    def rates(self, frame_t_ns: NDArray[np.int64], lag: int, offset_s: float) -> Floats:
        """(k, 6) v and w on average between frames k and k + lag, if these were later by so much.
        NaN where the twists do not reach.
        """
        out = self._rates(frame_t_ns, lag, offset_s)
        if self._turns_late_s:
            out[:, 3:] = self._rates(frame_t_ns, lag, offset_s + self._turns_late_s)[:, 3:]
        return out

    def _rates(self, frame_t_ns: NDArray[np.int64], lag: int, offset_s: float) -> Floats:
        """Of one clock."""
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
        """As fit.Body."""
        return self.rates(frame_t_ns, 1, offset_s)[:, 3:]

    def design(self, recording: Recording, seen: Seen, offset_s: float, bias: float) -> Design:
        """As fit.Body."""
        told = self.rates(recording.frame_t_ns, 1, offset_s)
        arm = -recording.T_CB.R.T @ recording.T_CB.p
        told[:, :3] += np.cross(told[:, 3:], arm)
        own = ONE_CLOCK_S if self._turns_late_s is None else OWN_CLOCK_S
        return joined(*(_design(told, seen, z, _prior(bias, own)) for seen, z in seen.pairs()))


def _design(told: Floats, seen: Seen, others: list[Motions], prior: Floats) -> Design:
    """`others` are the instruments."""
    X = _columns(told, slope(told, 1, float(np.median(seen.tau_s))))
    Z = np.concatenate([_columns(z.rates, z.slope) for z in others], axis=2)
    usable = seen.usable & np.isfinite(told).all(axis=1)
    k = np.flatnonzero(usable & np.isfinite(X).all(axis=(1, 2)) & np.isfinite(Z).all(axis=(1, 2)))
    return Design((seen.rates - told)[k], X[k], Z[k], seen.variance[k], prior, told[k, :3], k)


def _prior(bias: float, turns_late: float) -> Floats:
    """Inverse variances: all but the velocity's bias are hardly known."""
    sigma = np.full(PARAMETERS, 10.0)
    sigma[BIAS : BIAS + 3] = bias
    sigma[LEVER : LEVER + 3] = 3.0
    sigma[TILT : TILT + 3] = sigma[TURN : TURN + 3] = 0.2
    sigma[CLOCK], sigma[TURN_CLOCK] = 0.3, turns_late
    sigma[GYRO : GYRO + 3] = 0.3
    return np.diag(sigma**-2)


def _columns(told: Floats, by_time: Floats) -> Floats:
    """(k, 6, m): what each unknown adds to a motion (v, w) and its slope."""
    g, w = told[:, :3], told[:, 3:]
    X = np.zeros((len(g), 6, PARAMETERS))
    X[:, :3, SCALE] = g
    X[:, :3, BIAS : BIAS + 3] = X[:, 3:, GYRO : GYRO + 3] = -np.eye(3)
    X[:, :3, LEVER : LEVER + 3] = se3.skew(w)
    X[:, :3, TILT : TILT + 3] = -se3.skew(g)
    X[:, 3:, TURN : TURN + 3] = -se3.skew(w)
    X[:, 3:, TURN_SCALE] = w
    X[:, :, CLOCK] = by_time
    X[:, 3:, TURN_CLOCK] = by_time[:, 3:]
    return X
