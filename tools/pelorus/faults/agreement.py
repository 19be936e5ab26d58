# SPDX-License-Identifier: MIT
"""By how much camera and twists disagree in scale, place and time, and how well that is known.

Both tell a turn and a velocity for each pair of frames. In body axes, with the camera at r,

    w = a w_B - b_w + phi_w x w_B + dt w_B'
    v = s g - b_v + phi_v x g + w_B x dr + dt g',      g = v_B + w_B x r

All of these are unknown at once: a scale is told from a bias by a speed that varies, a lever by
turns, a late clock by motions that change. Weights are robust; scale and time are free of the
twists' noise by instruments (the same motion some frames away). The standard errors are those of
whole blocks of the drive: they need no model of the noise, and hold when it is not white.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pelorus import se3
from pelorus.faults.two_views import TwoViews, two_views
from pelorus.layout import Floats
from pelorus.motion import dead_reckoning
from pelorus.recording import Recording
from pelorus.se3 import Poses
from pelorus.tracks import Tracks

POINTS_MIN = 6  # of a pair of frames
FRAMES_MIN = 50
NO_BIAS_MPS = 1e-4
BIAS_MPS = 0.1  # sigma of the velocity's bias, as the filter's setting
ROUNDS = 8
CHANCE = 2.0  # standard errors that near and far may differ by
BLOCKS_MOST, BLOCK_FRAMES = 40, 10
OFFSETS_S = np.arange(-20, 21) * 0.02  # where the clock's offset is looked for at first
CLOCK_ROUNDS, CLOCK_STEP_S, CLOCK_FOUND_S = 10, 0.05, 2e-4
SCALE, BIAS, LEVER, TILT, CLOCK, GYRO, TURN, TURN_SCALE = 0, 1, 4, 7, 10, 11, 14, 17
PARAMETERS = 18


@dataclass(frozen=True)
class Agreement:
    """`scale` 1, `lever_m` 0 and `offset_s` 0 are due; sigmas stand beside them."""

    frames: int
    scale: float
    scale_sigma: float
    through_zero: float  # the scale if there is no bias
    through_zero_sigma: float
    lever_m: Floats  # the camera's place in the body beside the given one
    lever_covariance: Floats
    offset_s: float  # to be added to the frames' times
    offset_sigma_s: float
    speed_mps: float
    turn_scale: float  # 1 is due
    turn_scale_sigma: float

    @property
    def told(self) -> bool:
        return self.frames >= FRAMES_MIN


class Body:
    """What the twists say of the motion between any two times."""

    def __init__(self, recording: Recording) -> None:
        header = recording.header
        self._t_ns, self._v, self._w = recording.twist_t_ns, recording.v_B_mps, recording.w_B_radps
        self._nodes = dead_reckoning(self._t_ns, self._v, self._w, header.twist_timing)
        self._held = header.twist_timing.name

    def at(self, t_s: Floats) -> Poses:
        """Poses at seconds since the first twist; between two nodes at an even rate."""
        nodes = (self._t_ns - self._t_ns[0]) * 1e-9
        k = np.clip(np.searchsorted(nodes, t_s, side="right") - 1, 0, len(nodes) - 2)
        whole = se3.compose(se3.inverse(self._nodes.at(k)), self._nodes.at(k + 1))
        share = (t_s - nodes[k]) / (nodes[k + 1] - nodes[k])
        part = se3.log(whole) * np.clip(share, 0, 1)[:, None]
        return se3.compose(self._nodes.at(k), se3.exp(part[:, :3], part[:, 3:]))

    def rates(self, frame_t_ns: NDArray[np.int64], lag: int, offset_s: float) -> Floats:
        """(k, 6) v and w on average between frames k and k + lag, if these were later by so much.
        NaN where the twists do not reach.
        """
        t = (frame_t_ns - self._t_ns[0]) * 1e-9 + offset_s
        path = self.at(t)
        out = rates_of(path.at(slice(None, -lag)), path.at(slice(lag, None)), t[lag:] - t[:-lag])
        end = (self._t_ns[-1] - self._t_ns[0]) * 1e-9
        out[(t[:-lag] < 0) | (t[lag:] > end)] = np.nan
        return out


def rates_of(earlier: Poses, later: Poses, tau_s: Floats) -> Floats:
    """(k, 6) v and w of a motion."""
    return np.asarray(se3.log(se3.compose(se3.inverse(earlier), later)) / tau_s[:, None])


@dataclass(frozen=True)
class Seen:
    """The camera's own v and w in body axes as given, (k, 6), their variances, and which count."""

    rates: Floats
    variance: Floats
    usable: NDArray[np.bool_]
    tau_s: Floats

    @classmethod
    def of(cls, recording: Recording, views: TwoViews) -> Seen:
        lag, R = views.lag, recording.T_CB.R
        tau = np.asarray(recording.frame_t_ns[lag:] - recording.frame_t_ns[:-lag]) * 1e-9
        rates = se3.log(se3.inverse(views.motion)) / tau[:, None]
        in_body = np.hstack((rates[:, :3] @ R, rates[:, 3:] @ R))
        turn = np.kron(np.eye(2), R)
        covariance = np.asarray(turn.T @ views.covariance @ turn, np.float64)
        of_axes = np.asarray(np.diagonal(covariance, axis1=1, axis2=2), np.float64)
        variance = of_axes / tau[:, None] ** 2
        usable = (views.counts >= POINTS_MIN) & np.isfinite(in_body).all(axis=1)
        return cls(in_body, variance, usable, tau)


def agreement(recording: Recording, views: TwoViews) -> Agreement:
    """Of a recording whose extrinsic's rotation and whose units are right."""
    body = Body(recording)
    seen = Seen.of(recording, views)
    if seen.usable.sum() < FRAMES_MIN:
        nan = float("nan")
        return Agreement(
            int(seen.usable.sum()), nan, nan, nan, nan, np.zeros(3), np.eye(3), nan, nan, nan,
            nan, nan,
        )  # fmt: skip
    offset = _offset(recording, body, seen)
    prior = recording.header.noise.bias_velocity_sigma_mps
    bias = prior if prior > 0 else BIAS_MPS
    found = _Fit(recording, body, seen, offset, bias)
    none = _Fit(recording, body, seen, offset, NO_BIAS_MPS)
    doubt = _doubt_by_depth(recording, views, body, offset)
    lever = slice(LEVER, LEVER + 3)
    return Agreement(
        found.frames,
        1 + float(found.x[SCALE]),
        float(np.hypot(found.sigma[SCALE], doubt)),
        1 + float(none.x[SCALE]),
        float(np.hypot(none.sigma[SCALE], doubt)),
        found.x[lever],
        found.covariance[lever, lever],
        offset,
        float(found.sigma[CLOCK]),
        float(np.median(np.linalg.norm(found.g, axis=1))),
        1 + float(found.x[TURN_SCALE]),
        float(found.sigma[TURN_SCALE]),
    )


def _offset(recording: Recording, body: Body, seen: Seen) -> float:
    """Of the clock, from where it should be and from where the turns go together most."""
    ends = []
    for start in dict.fromkeys((0.0, _likely_offset(recording, body, seen))):
        offset = start
        for _ in range(CLOCK_ROUNDS):
            fit = _Fit(recording, body, seen, offset)
            step = float(np.clip(fit.x[CLOCK], -CLOCK_STEP_S, CLOCK_STEP_S))
            offset += step
            if abs(step) < CLOCK_FOUND_S:
                break
        ends.append((fit.cost, offset))
    return min(ends)[1]


def _likely_offset(recording: Recording, body: Body, seen: Seen) -> float:
    """Where the turns of both go together most."""
    best, at = -np.inf, 0.0
    own = seen.rates[:, 3:]
    for offset in OFFSETS_S:
        w = body.rates(recording.frame_t_ns, 1, float(offset))[:, 3:]
        good = seen.usable & np.isfinite(w).all(axis=1)
        if good.sum() < FRAMES_MIN:
            continue
        parts = [x[good] - np.median(x[good], axis=0) for x in (own, w)]
        size = 4 * np.median(np.linalg.norm(parts[0], axis=1)) + 1e-9
        together = float(np.mean(np.sum(np.clip(parts[0], -size, size) * parts[1], axis=1)))
        if together > best * (1 + 1e-9):
            best, at = together, float(offset)
    return at


def _doubt_by_depth(recording: Recording, views: TwoViews, body: Body, offset: float) -> float:
    """How far near and far points are from agreeing on one scale, beyond what noise makes: as much
    doubt there is about it. A disparity that is off, or a tracker that lags, shows so.
    """
    halves = []
    for tracks in by_depth(recording.tracks):
        part = replace(recording, tracks=tracks)
        seen = Seen.of(part, two_views(tracks, recording.header.camera, views.lag))
        if seen.usable.sum() < FRAMES_MIN:
            return 0.0
        fit = _Fit(part, body, seen, offset, NO_BIAS_MPS)
        halves.append((fit.x[SCALE], fit.image_sigma[SCALE]))
    (near, near_sigma), (far, far_sigma) = halves
    excess = (near - far) ** 2 - CHANCE**2 * (near_sigma**2 + far_sigma**2)
    return float(np.sqrt(max(excess, 0.0)) / 2)


def by_depth(tracks: Tracks) -> tuple[Tracks, Tracks]:
    """The near and the far half of the points, each point as a whole."""
    disparity = tracks.pixels[:, 0] - tracks.pixels[:, 2]
    _, number = np.unique(tracks.id, return_inverse=True)
    mean = np.bincount(number, disparity) / np.bincount(number)
    near = (mean >= np.median(mean[number]))[number]
    halves = [
        Tracks(tracks.frame_count, tracks.frame[k], tracks.id[k], tracks.pixels[k])
        for k in (near, ~near)
    ]
    return halves[0], halves[1]


class _Fit:
    """All unknowns at one offset of the clock."""

    def __init__(
        self, recording: Recording, body: Body, seen: Seen, offset: float, bias: float = BIAS_MPS
    ) -> None:
        rates = body.rates(recording.frame_t_ns, 1, offset)
        arm = -recording.T_CB.R.T @ recording.T_CB.p
        w = rates[:, 3:]
        g = rates[:, :3] + np.cross(w, arm)
        usable = seen.usable & np.isfinite(_beside(np.hstack((g, w)), 3)).all(axis=1)
        usable &= np.isfinite(rates).all(axis=1)
        y = seen.rates - np.hstack((g, w))
        X, Z = _columns(g, w, float(np.median(seen.tau_s)))
        self.g = g[usable]
        self._solve(y[usable], X[usable], Z[usable], seen.variance[usable], _prior(bias))

    @property
    def frames(self) -> int:
        return len(self.g)

    def _solve(self, y: Floats, X: Floats, Z: Floats, variance: Floats, prior: Floats) -> None:
        count = len(y)
        extra: Floats = np.median(y**2, axis=0)
        weight = np.ones(count)
        for _ in range(ROUNDS):
            trust = weight[:, None] / (variance + extra)
            A = np.einsum("nai,naj,na->ij", Z, X, trust) + prior
            x = np.linalg.solve(A, np.einsum("nai,na,na->i", Z, y, trust))
            left = y - X @ x
            spread = 2.198 * np.median(left**2, axis=0)  # of a normal distribution the variance
            extra = np.maximum(spread - np.median(variance, axis=0), 0) + 1e-10
            d2 = np.sum(left**2 / (variance + extra), axis=1) / 6
            weight = 1 / (1 + d2 / 9) ** 2
        score = np.einsum("nai,na,na->ni", Z, left, trust)
        blocks = int(np.clip(count // BLOCK_FRAMES, 8, BLOCKS_MOST))
        sums = np.zeros((blocks, PARAMETERS))
        np.add.at(sums, np.arange(count) * blocks // count, score)
        meat = sums.T @ sums * blocks / (blocks - 3)
        inverse = np.linalg.inv(A)
        self.x = np.asarray(x)
        self.cost = float(np.sum(np.log(spread)))
        self.covariance = inverse @ (meat + prior) @ inverse.T
        self.sigma = np.sqrt(np.diagonal(self.covariance))
        shared = variance / (variance + extra)  # of the variance what the images add
        images = inverse @ np.einsum("nai,naj,na->ij", Z, Z, trust * shared) @ inverse.T
        self.image_sigma = np.sqrt(np.diagonal(images))


def _prior(bias: float) -> Floats:
    """Inverse variances: all but the velocity's bias are hardly known."""
    sigma = np.full(PARAMETERS, 10.0)
    sigma[BIAS : BIAS + 3] = bias
    sigma[LEVER : LEVER + 3] = 3.0
    sigma[TILT : TILT + 3] = sigma[TURN : TURN + 3] = 0.2
    sigma[CLOCK] = 0.3
    sigma[GYRO : GYRO + 3] = 0.3
    return np.diag(sigma**-2)


def _columns(g: Floats, w: Floats, tau_s: float) -> tuple[Floats, Floats]:
    """(k, 6, 17): what each unknown adds to (v, w), and the instruments."""
    count = len(g)
    X = np.zeros((count, 6, PARAMETERS))
    X[:, :3, SCALE] = g
    X[:, :3, BIAS : BIAS + 3] = X[:, 3:, GYRO : GYRO + 3] = -np.eye(3)
    X[:, :3, LEVER : LEVER + 3] = se3.skew(w)
    X[:, :3, TILT : TILT + 3] = -se3.skew(g)
    X[:, 3:, TURN : TURN + 3] = -se3.skew(w)
    X[:, 3:, TURN_SCALE] = w
    both = np.hstack((g, w))
    X[:, :, CLOCK] = _slope(both, 1, tau_s)
    Z = X.copy()
    Z[:, :3, SCALE] = _beside(g, 2, 3)
    Z[:, 3:, TURN_SCALE] = _beside(w, 2, 3)
    Z[:, :, CLOCK] = _slope(both, 2, tau_s)
    return X, Z


def _beside(x: Floats, *lags: int) -> Floats:
    """The mean of the values so many frames before and behind; NaN at the ends."""
    return np.asarray(sum(_moved(x, k) + _moved(x, -k) for k in lags) / (2 * len(lags)))


def _slope(x: Floats, lag: int, tau_s: float) -> Floats:
    return np.asarray((_moved(x, lag) - _moved(x, -lag)) / (2 * lag * tau_s))


def _moved(x: Floats, by: int) -> Floats:
    """x of k + by."""
    out = np.full_like(x, np.nan)
    if by > 0:
        out[:-by] = x[by:]
    else:
        out[-by:] = x[:by]
    return out
