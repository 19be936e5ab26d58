# SPDX-License-Identifier: MIT
"""Robust least squares over pairs of frames, whose standard errors are those of whole blocks of the
drive: they need no model of the noise, and hold when it is not white.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.seen import Seen
from pelorus.layout import Floats
from pelorus.recording import Recording

ROUNDS = 8
BLOCKS_MOST, BLOCK_FRAMES = 40, 10
SCALE, BIAS, LEVER, TILT, CLOCK, GYRO, TURN, TURN_SCALE, FOCAL = 0, 1, 4, 7, 10, 11, 14, 17, 18
TURN_CLOCK = 19
PARAMETERS = 20
TELLS_SIGMAS = 3.0


@dataclass(frozen=True)
class Design:
    """y = X x + noise by pairs of frames, (k, 6): v and w. `Z` are instruments: X but for what
    shares the noise of y. `g` is the camera's velocity as the body has it.
    """

    y: Floats
    X: Floats  # (k, 6, m), the first PARAMETERS as named above
    Z: Floats
    variance: Floats  # what the images add
    prior: Floats  # (m, m), inverse variances
    g: Floats


class Body(Protocol):
    """What twists or an IMU say of the motion between frames."""

    def turns(self, frame_t_ns: NDArray[np.int64], offset_s: float) -> Floats:
        """(k, 3) w on average from each frame to the next, if these were later by so much. NaN
        where nothing is known.
        """

    def design(self, recording: Recording, seen: Seen, offset_s: float, bias: float) -> Design:
        """Of the pairs that can be used; `bias` is the sigma of what the velocity, or the specific
        force, is off by.
        """


class Fit:
    """All unknowns of a design."""

    def __init__(self, design: Design, blocks_most: int = BLOCKS_MOST) -> None:
        y, X, Z, variance, prior = design.y, design.X, design.Z, design.variance, design.prior
        self.g, self.frames = design.g, len(y)
        count = len(y)
        extra: Floats = np.median(y**2, axis=0)
        weight = np.ones(count)
        X_rows, Z_rows = (c.reshape(-1, c.shape[2]) for c in (X, Z))
        for _ in range(ROUNDS):
            trust = weight[:, None] / (variance + extra)
            trusted = Z_rows * trust.reshape(-1, 1)
            A = trusted.T @ X_rows + prior
            x = np.linalg.solve(A, trusted.T @ y.ravel())
            left = y - X @ x
            spread = 2.198 * np.median(left**2, axis=0)  # of a normal distribution the variance
            extra = np.maximum(spread - np.median(variance, axis=0), 0) + 1e-10
            d2 = np.sum(left**2 / (variance + extra), axis=1) / y.shape[1]
            weight = 1 / (1 + d2 / 9) ** 2
        inverse = np.linalg.inv(A)
        self._A, self._inverse, self._design, self._trust = A, inverse, design, trust
        self._blocks_most = blocks_most
        self.x = np.asarray(x)
        self.cost = float(np.sum(np.log(spread)))
        self.covariance = self.covariance_of(left) + inverse @ prior @ inverse.T
        self.sigma = np.sqrt(np.diagonal(self.covariance))
        shared = variance / (variance + extra)  # of the variance what the images add
        middle = (trusted * shared.reshape(-1, 1)).T @ Z_rows
        images = inverse @ middle @ inverse.T
        self.image_sigma = np.sqrt(np.maximum(np.diagonal(images), 0.0))

    def covariance_of(self, left: Floats) -> Floats:
        """Of the unknowns, by what residuals (k, a) leave in blocks of the drive."""
        count = len(left)
        score = (self._design.Z * (left * self._trust)[..., None]).sum(axis=1)
        blocks = int(np.clip(count // BLOCK_FRAMES, 8, self._blocks_most))
        sums = np.zeros((blocks, self._design.Z.shape[2]))
        np.add.at(sums, np.arange(count) * blocks // count, score)
        meat = sums.T @ sums * blocks / (blocks - 3)
        return np.asarray(self._inverse @ meat @ self._inverse.T)

    def tells(self, which: int) -> bool:
        """Whether an unknown's column and its instrument vary together by more than chance, by
        themselves and beyond what the other unknowns explain of both. Else, as for the clock on a
        circle at an even speed, or for the scale beside a bias, nothing is told of it: what varies
        is noise, and a weak instrument takes least squares back to what noise makes of the unknown,
        with a small standard error.
        """
        A, X, Z = self._A, self._design.X, self._design.Z
        others = np.arange(len(A)) != which
        of_x, of_z = -np.ones(len(A)), -np.ones(len(A))
        of_x[others] = np.linalg.solve(A[np.ix_(others, others)], A[others, which])
        of_z[others] = np.linalg.solve(A[np.ix_(others, others)].T, A[which, others])
        x, z = (c[:, :, which] - c[:, :, which].mean(axis=0) for c in (X, Z))
        for both in (x * z, (X @ of_x) * (Z @ of_z)):
            together = np.sum(both * self._trust, axis=1)
            if together.sum() < TELLS_SIGMAS * np.linalg.norm(together):
                return False
        return True


def beside(x: Floats, *lags: int) -> Floats:
    """The mean of the values so many frames before and behind; NaN at the ends."""
    return np.asarray(sum(_moved(x, k) + _moved(x, -k) for k in lags) / (2 * len(lags)))


def slope(x: Floats, lag: int, tau_s: float) -> Floats:
    """By the time, from the values so many frames before and behind."""
    return np.asarray((_moved(x, lag) - _moved(x, -lag)) / (2 * lag * tau_s))


def _moved(x: Floats, by: int) -> Floats:
    """x of k + by."""
    out = np.full_like(x, np.nan)
    if by > 0:
        out[:-by] = x[by:]
    else:
        out[-by:] = x[:by]
    return out
