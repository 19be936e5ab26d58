# SPDX-License-Identifier: MIT
"""The camera's velocity and rate of turn by the images alone, in the axes of the body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.two_views import TwoViews, two_views
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math import se3
from pelorus.math.motion import Times
from pelorus.wire.layout import Floats

POINTS_MIN = 6  # of a pair of frames
LONGER = 0.02  # change of the focal length for its derivative


GAP_PERIODS = 5.0  # a longer pause of a stream leaves the motion unknown
BLOCKS = 20
SHAKES_D2, SHAKES_SHARE = 600.0, 0.02  # of six degrees of freedom, ten sigma; share of the frames
BESIDE = (2, 3)  # frames: adjacent pairs share a picture


@dataclass(frozen=True)
class CameraMotion:
    """The camera's v and w in body axes, (k, 6), their variances, and which are usable."""

    rates: Floats
    variance: Floats
    usable: NDArray[np.bool_]
    tau_s: Floats
    by_focal: Floats | None = None  # (k, 6) derivative by the logarithm of the focal length
    halves: tuple[CameraMotion, CameraMotion] | None = (
        None  # by every other point, with independent noise
    )

    @property
    def moves(self) -> float:
        """Returns by how many standard errors the camera moves: motion lasts, noise does not."""
        beside = self.beside()
        good = self.usable & np.isfinite(beside).all(axis=1)
        own, told, trust = self.rates[good], beside[good], 1 / self.variance[good]
        noise = np.sum(told * (own - told) * trust, axis=1)
        return float(np.sum(told * own * trust)) / standard_error(noise)

    @property
    def shakes(self) -> bool:
        """Returns whether some frames move by far more than their noise, even to and fro."""
        d2 = np.sum(self.rates[self.usable] ** 2 / self.variance[self.usable], axis=1)
        return bool(len(d2)) and float(np.mean(d2 > SHAKES_D2)) > SHAKES_SHARE

    @classmethod
    def of(cls, recording: Recording, views: TwoViews) -> CameraMotion:
        lag, R = views.lag, recording.T_CB.R
        tau = np.asarray(recording.frame_t_ns[lag:] - recording.frame_t_ns[:-lag]) * 1e-9
        rates = se3.log(se3.inverse(views.motion)) / tau[:, None]
        in_body = np.hstack((rates[:, :3] @ R, rates[:, 3:] @ R))
        turn = np.kron(np.eye(2), R)
        covariance = np.asarray(turn.T @ views.covariance @ turn, np.float64)
        of_axes = np.asarray(np.diagonal(covariance, axis1=1, axis2=2), np.float64)
        variance = of_axes / tau[:, None] ** 2
        usable = (views.counts >= POINTS_MIN) & np.isfinite(in_body).all(axis=1)
        usable &= tau <= GAP_PERIODS * np.median(tau)
        return cls(in_body, variance, usable, tau)

    def without(self, wrong: NDArray[np.bool_]) -> CameraMotion:
        """Returns the motion without these frames."""
        halves = None
        if self.halves is not None:
            one, two = (replace(half, usable=half.usable & ~wrong) for half in self.halves)
            halves = (one, two)
        return replace(self, usable=self.usable & ~wrong, halves=halves)

    def beside(self) -> Floats:
        """Returns (k, 6) v and w as predicted by neighbouring frames, weighted; NaN where there are
        none.

        They share no picture with the pair itself, so its noise and that of the body's sensors are
        not in them.
        """
        trust = np.where(self.usable[:, None], 1 / (self.variance + 1e-12), 0.0)
        told = np.where(self.usable[:, None], self.rates, 0.0) * trust
        total, weight = (_of_neighbours(x) for x in (told, trust))
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(total / np.where(weight > 0, weight, np.nan))

    def slope(self) -> Floats:
        """Returns (k, 6) the slope of v and w by neighbouring frames; NaN where there are none."""
        usable = np.where(self.usable[:, None], self.rates, np.nan)
        return slope(usable, BESIDE[0], float(np.median(self.tau_s)))

    def itself(self) -> Motions:
        """Returns this half's motion as an instrument of the other: independent noise."""
        usable = np.where(self.usable[:, None], self.rates, np.nan)
        return Motions(usable, slope(usable, 1, float(np.median(self.tau_s))), self.by_focal)

    def of_others(self) -> Motions:
        """Returns the motion by all points of neighbouring frames, as an instrument."""
        focal = None if self.by_focal is None else beside(self.by_focal, *BESIDE)
        return Motions(self.beside(), self.slope(), focal)

    def pairs(self) -> list[tuple[CameraMotion, list[Motions]]]:
        """Returns motions to explain, with instruments: the same motion with other noise."""
        beside = self.of_others()
        if self.halves is None:
            return [(self, [beside])]
        one, other = self.halves
        return [(one, [other.itself(), beside]), (other, [one.itself(), beside])]

    def with_halves(self, recording: Recording, lag: int, frames_least: int) -> CameraMotion:
        """Returns this with the motion of each half of the points, where these suffice.

        Each is also computed with another focal length. Neither turns nor displacements simply
        scale with it: with near points one is mistaken for the other.
        """
        camera = recording.header.camera
        longer = replace(
            camera, fx_px=(1 + LONGER) * camera.fx_px, fy_px=(1 + LONGER) * camera.fy_px
        )
        parts = by_turns(recording.tracks)
        own, other = ([CameraMotion.of(recording, two_views(part, c, lag)) for part in parts]
                      for c in (camera, longer))  # fmt: skip
        if min(int(half.usable.sum()) for half in own) < frames_least:
            return self
        focal = [(b.rates - a.rates) / LONGER for a, b in zip(own, other, strict=True)]
        one, two = (replace(half, by_focal=x) for half, x in zip(own, focal, strict=True))
        return replace(self, halves=(one, two), by_focal=np.mean(focal, axis=0))


class Motions(NamedTuple):
    """Instruments of a motion: rates and slopes (k, 6), and how a focal length changes them."""

    rates: Floats
    slope: Floats
    by_focal: Floats | None


def by_turns(tracks: Tracks) -> list[Tracks]:
    """Returns two halves of the points, each point whole."""
    _, number = np.unique(tracks.id, return_inverse=True)
    return [tracks.at(number % 2 == half) for half in (0, 1)]


def beside(x: Floats, *lags: int) -> Floats:
    """Returns the mean of the values so many frames before and after; NaN at the ends."""
    return np.asarray(sum(_moved(x, k) + _moved(x, -k) for k in lags) / (2 * len(lags)))


def slope(x: Floats, lag: int, tau_s: float) -> Floats:
    """Returns the slope by time, from the values so many frames before and after."""
    return np.asarray((_moved(x, lag) - _moved(x, -lag)) / (2 * lag * tau_s))


def _moved(x: Floats, by: int) -> Floats:
    """Returns x shifted: at k the value of k + by, NaN at the ends."""
    out = np.full_like(x, np.nan)
    if by > 0:
        out[:-by] = x[by:]
    else:
        out[-by:] = x[:by]
    return out


def _of_neighbours(x: Floats) -> Floats:
    out = np.zeros_like(x)
    for lag in BESIDE:
        out[lag:] += x[:-lag]
        out[:-lag] += x[lag:]
    return out


def pauses(t: Times | Floats, begin: Times | Floats, end: Times | Floats) -> NDArray[np.bool_]:
    """Returns whether a stream pauses between each beginning and end."""
    steps = np.diff(t)
    longer = steps > GAP_PERIODS * np.median(steps) if len(steps) else np.zeros(0, bool)
    before = np.concatenate(([0], np.cumsum(longer)))
    first = np.clip(np.searchsorted(t, begin, side="right") - 1, 0, None)
    last = np.clip(np.searchsorted(t, end), 0, len(t) - 1)
    return np.asarray(before[last] > before[first])


def standard_error(noise: Floats) -> float:
    """Returns the standard error of a sum over a drive, by blocks of correlated noise."""
    blocks = np.arange(len(noise)) * BLOCKS // max(len(noise), 1)
    return float(np.linalg.norm(np.bincount(blocks, noise, BLOCKS))) + 1e-12
