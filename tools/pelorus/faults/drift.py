# SPDX-License-Identifier: MIT
"""What an IMU's own noise adds to the errors of a fit.

Noise of the gyro turns the attitude for the rest of a stretch, and gravity with it; noise of the
accelerometer stays in the velocity; a bias that wanders stays for the rest of the drive. Such
errors last as long as a stretch, so that residuals, which have the stretch's start fitted to them,
hardly show them. Where a drive is slow they exceed what the images add. They are propagated
instead, from the densities that the HEADER tells: a kick in each interval, and what it does to all
later ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.force import Force
from pelorus.io.tracks import Indices
from pelorus.math import se3
from pelorus.math.inertial import Inertial
from pelorus.wire.frames import Noise
from pelorus.wire.layout import Floats
from pelorus.wire.schema import DEFAULTS

SCATTER = 0.6745 * 6**0.5  # of the median of |second differences|, of white noise of variance 1


@dataclass(frozen=True)
class Densities:
    """Of an IMU's white noise and of its biases' walks, as Noise has them."""

    gyro_noise: float
    accel_noise: float
    gyro_walk: float
    accel_walk: float

    @classmethod
    def of(cls, noise: Noise, readings: Inertial) -> Densities:
        """Returns those of the HEADER, or the filter's defaults. Files often tell more noise than
        there is: white noise is at most what readings differ by from one to the next.
        """
        told = [
            value if (value := getattr(noise, name)) >= 0 else DEFAULTS[name.replace("_", "-")]
            for name in ("gyro_noise", "accel_noise", "gyro_walk", "accel_walk")
        ]
        seen = [_white(readings, x) for x in (readings.w_B_radps, readings.a_B_mps2)]
        return cls(min(told[0], seen[0]), min(told[1], seen[1]), told[2], told[3])


def _white(readings: Inertial, x: Floats) -> float:
    """Returns the density of the noise that three readings in a row show, of the worst axis."""
    if len(x) < 3:
        return float("inf")
    period_s = float(np.median(np.diff(readings.t_ns))) * 1e-9
    sigma = np.median(np.abs(np.diff(x, 2, axis=0)), axis=0).max() / SCATTER
    return float(sigma * np.sqrt(period_s))


@dataclass(frozen=True)
class Drift:
    """By the intervals between frames, (k, ...)."""

    force: Force
    tau_s: Floats
    densities: Densities

    def covariance_of(self, score: Floats, at: Indices) -> Floats:
        """Returns (m, m), what the noise adds to sums over rows of `score` (r, 3, m) times the
        errors of the velocity in body axes (r, 3); `at` are the rows' intervals.
        """
        own = self.force
        known: NDArray[np.bool_] = np.asarray(np.isfinite(own.turn).all(axis=1))
        to_body = np.where(known[:, None, None], own.of_start[:, :, :3], np.eye(3))
        P = np.zeros((len(to_body), 3, score.shape[2]))
        np.add.at(P, at, score)
        P = np.einsum("kij,kim->kjm", to_body, P)  # of velocities in the stretch's first axes
        to_start = np.linalg.inv(to_body)
        U = np.where(known[:, None], np.einsum("kij,kj->ki", to_start, own.way), 0.0)
        G, J = (
            np.where(known[:, None, None], to_start @ x, 0.0) for x in (own.of_gyro, -own.of_bias)
        )
        of, tau = self.densities, self.tau_s[:, None, None]
        # sums over the later intervals of the stretch
        sums = _later(P, own.stretch)
        turned = _later(_times(P, se3.skew(U)), own.stretch) - _times(sums, se3.skew(U))
        kicks = (
            (of.accel_noise, sums),
            (of.gyro_noise, turned),
            (of.accel_walk, self._lasting(P, J) - _times(sums, J)),
            (of.gyro_walk, self._lasting(P, G) - _times(sums, G) - _times(turned, J)),
        )
        total = np.zeros((score.shape[2],) * 2)
        for density, kick in kicks:
            rows = (kick * (density * np.sqrt(tau))).reshape(-1, score.shape[2])
            total += rows.T @ rows
        return np.asarray(total)

    def _lasting(self, P: Floats, by_bias: Floats) -> Floats:
        """Returns the sums over all later intervals, of the stretch and of those behind it."""
        return _later(_times(P, by_bias), np.zeros_like(self.force.stretch))


def _times(P: Floats, by: Floats) -> Floats:
    """Returns (k, 3, m): by' P."""
    return np.asarray(np.einsum("kij,kim->kjm", by, P))


def _later(x: Floats, stretch: Indices) -> Floats:
    """Returns the sum over each interval and the later ones of its stretch."""
    back = np.cumsum(x[::-1], axis=0)[::-1]
    last = np.searchsorted(stretch, stretch, side="right")
    behind = np.concatenate((back, np.zeros_like(back[:1])))[last]
    return np.asarray(back - behind)
