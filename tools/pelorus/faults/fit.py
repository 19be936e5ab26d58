# SPDX-License-Identifier: MIT
"""Robust least squares over pairs of frames, with standard errors from blocks of the drive.

They need no model of the noise, and hold when it is not white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.drift import Drift
from pelorus.faults.seen import CameraMotion
from pelorus.io.recording import Recording
from pelorus.io.tracks import Indices
from pelorus.wire.layout import Floats

ROUNDS = 8
BLOCKS_LEAST, BLOCKS_MOST, BLOCK_FRAMES = 8, 60, 5
SCALE, BIAS, LEVER, TILT, CLOCK, GYRO, TURN, TURN_SCALE, FOCAL = 0, 1, 4, 7, 10, 11, 14, 17, 18
TURN_CLOCK = 19
PARAMETERS = 20
NEIGHBOURS = 0.5  # weight of the covariance between neighbouring blocks
# Of an instrument, standard errors. Below the first nothing is estimated (Stock and Yogo 2005: F of
# 10); above the second usual standard errors hold (Lee, McCrary, Moreira and Porter 2022: F of
# 104).
TELLS_SIGMAS, STRONG = 3.0, 10.0
SURE = 4.0  # standard errors
# quantiles of a column that bound its instrument: frozen pictures make it leap
WITHIN = (0.01, 0.99)
UNTOLD = 1e6  # variance of what cannot be estimated
PIECE_FRAMES = 20  # longer than the instruments' noise is correlated
RIDGE = 1e-9  # for instruments that are linearly dependent


@dataclass(frozen=True)
class Design:
    """The linear model y = X x + noise over pairs of frames.

    `y` is (k, 6), v and w. `Z` are the instruments: X without what shares the noise of y, and
    further ones behind. `g` is the camera's velocity by the body's motion, `at` is ascending time.
    `drift` is what noise of an IMU adds to y.
    """

    y: Floats
    X: Floats  # (k, 6, m), the first PARAMETERS as named above
    Z: Floats  # (k, 6, q), q >= m
    variance: Floats  # what the images add
    prior: Floats  # (m, m), inverse variances
    g: Floats
    at: Indices
    drift: Drift | None = None


def joined(*parts: Design) -> Design:
    """Returns the rows of all designs in the order of time."""
    order = np.argsort(np.concatenate([part.at for part in parts]), kind="stable")
    names = ("y", "X", "Z", "variance", "g", "at")
    rows: dict[str, Any] = {
        n: np.concatenate([getattr(part, n) for part in parts])[order] for n in names
    }
    return replace(parts[0], **rows | {"Z": _within(rows["Z"], rows["X"])})


class Body(Protocol):
    """The motion between frames by twists or an IMU."""

    def turns(self, frame_t_ns: NDArray[np.int64], offset_s: float) -> Floats:
        """Returns (k, 3) the mean rates from each frame to the next, rad/s, with frames `offset_s`
        later.

        NaN where nothing is known.
        """

    def design(
        self, recording: Recording, seen: CameraMotion, offset_s: float, bias: float
    ) -> Design:
        """Returns the design of the usable pairs.

        `bias` is the sigma of the velocity's bias, m/s, or of the specific force's, m/s^2.
        """


class Fit:
    """All unknowns of a design, by two-stage least squares.

    Of each column of X counts the part that the instruments explain. Where they explain nothing,
    the prior and its sigma stand.
    """

    def __init__(self, design: Design, blocks_most: int = BLOCKS_MOST) -> None:
        y, X, Z, variance, prior = design.y, design.X, design.Z, design.variance, design.prior
        self.g, self.frames = design.g, len(np.unique(design.at))
        count = len(y)
        extra: Floats = np.median(y**2, axis=0)
        weight = np.ones(count)
        X_rows, Z_rows = (c.reshape(-1, c.shape[2]) for c in (X, Z))
        exact = np.flatnonzero((Z_rows[:, : X.shape[2]] == X_rows).all(axis=0))
        halves = _halves(Z, X)
        for _ in range(ROUNDS):
            trust = weight[:, None] / (variance + extra)
            told = _told_by_others(halves, trust, exact)
            trusted = told.reshape(X_rows.shape) * trust.reshape(-1, 1)
            A = trusted.T @ X_rows + prior
            x = np.linalg.solve(A, trusted.T @ y.ravel())
            left = y - X @ x
            spread = 2.198 * np.median(left**2, axis=0)  # of a normal distribution the variance
            extra = np.maximum(spread - np.median(variance, axis=0), 0) + 1e-10
            d2 = np.sum(left**2 / (variance + extra), axis=1) / y.shape[1]
            weight = 1 / (1 + d2 / 9) ** 2
        inverse = np.linalg.inv(A)
        self._A, self._inverse, self._trust = A, inverse, trust
        self._y, self._X, self._Z = y, X, told
        self.blocks = int(np.clip(self.frames // BLOCK_FRAMES, BLOCKS_LEAST, blocks_most))
        self.x = np.asarray(x)
        self.cost = float(np.sum(np.log(spread)))
        self._known = inverse @ (prior + self._drifted(design)) @ inverse.T
        self.covariance = self.covariance_of(left) + self._known
        self.sigma = np.sqrt(np.diagonal(self.covariance))
        shared = variance / (variance + extra)  # share of the variance that the images add
        of_all = self._Z.reshape(-1, self._Z.shape[2])
        middle = (of_all * (trust * shared).reshape(-1, 1)).T @ of_all
        images = inverse @ middle @ inverse.T
        self.image_sigma = np.sqrt(np.maximum(np.diagonal(images), 0.0))

    def _drifted(self, design: Design) -> Floats | float:
        """Returns the covariance of the score by an IMU's own noise."""
        if design.drift is None:
            return 0.0
        score = (self._Z * self._trust[..., None])[:, :3]
        return design.drift.covariance_of(score, design.at)

    def covariance_of(self, left: Floats) -> Floats:
        """Returns the covariance of the unknowns from the residuals `left` (k, a).

        Residuals are summed over blocks of the drive and correlate between neighbours (Newey and
        West 1987), for errors that last seconds are not new in every row.
        """
        count = len(left)
        score = (self._Z * (left * self._trust)[..., None]).sum(axis=1)
        sums = np.zeros((self.blocks, self._Z.shape[2]))
        np.add.at(sums, np.arange(count) * self.blocks // count, score)
        both = sums[1:].T @ sums[:-1]
        meat = sums.T @ sums + NEIGHBOURS * (both + both.T)
        meat = meat * self.blocks / (self.blocks - 3)
        return np.asarray(self._inverse @ meat @ self._inverse.T)

    def beside(self, which: Sequence[int], values: Floats) -> float:
        """Returns d^2 between the estimates of some unknowns and these values.

        If the values are right, their residuals are uncorrelated with the instruments up to chance,
        which the residuals themselves give (Anderson and Rubin 1949). That holds however weak the
        instruments are.
        """
        some = np.asarray(which)
        others = np.setdiff1d(np.arange(len(self.x)), some)
        off = self.x[some] - values
        x = self.x.copy()
        x[some] = values
        x[others] += np.linalg.solve(
            self._A[np.ix_(others, others)], self._A[np.ix_(others, some)] @ off
        )
        left = self._y - self._X @ x
        Z = self._Z.reshape(-1, self._Z.shape[2])
        trusted = Z * self._trust.reshape(-1, 1)
        size = np.sqrt(np.sum(trusted * Z, axis=0)) + 1e-12
        scaled = trusted / size
        of_Z = scaled.T @ (Z / size) + RIDGE * np.eye(len(size))
        left = left - (self._Z / size) @ np.linalg.solve(of_Z, scaled.T @ left.ravel())
        covariance = (self.covariance_of(left) + self._known)[np.ix_(some, some)]
        return max(float(off @ np.linalg.solve(covariance, off)), 0.0)

    @property
    def beyond_doubt(self) -> float:
        """Returns the factor by which Student's t for these blocks exceeds 4 standard errors.

        With few blocks the standard errors are badly known themselves (Student 1908).
        """
        degrees = self.blocks / (1 + NEIGHBOURS)  # of the variance: neighbours count together
        return float(np.sqrt(degrees * np.expm1(SURE**2 / (degrees - 0.5))) / SURE)

    def known(self, which: int) -> float:
        """Returns the standard error of an unknown, or the one by the likelihood of zero, if
        larger.

        The latter is for drives that show little of it.
        """
        told = float(self._known[which, which])  # by no block: it is not doubted
        shown = max(float(self.covariance[which, which]) - told, 0.0)
        sigma = float(np.sqrt(self.beyond_doubt**2 * shown + told))
        if self.strength(which) < STRONG:
            d2 = self.beside([which], np.zeros(1))
            by_zero = abs(float(self.x[which])) / float(np.sqrt(d2 + 1e-12))
            sigma = max(sigma, self.beyond_doubt * by_zero)
        return sigma

    def covariance_known(self, which: Sequence[int]) -> Floats:
        """Returns their covariance likewise; UNTOLD is added where the drive shows nothing."""
        some = np.asarray(which)
        own = self.covariance[np.ix_(some, some)]
        strengths = np.array([self.strength(k) for k in which])
        covariance = own * self.beyond_doubt**2
        if strengths.min() < STRONG:
            x = self.x[some]
            d2 = float(x @ np.linalg.solve(own, x))
            covariance *= max(1.0, d2 / (self.beside(which, np.zeros(len(x))) + 1e-12))
        return np.asarray(covariance + np.diag(np.where(strengths < TELLS_SIGMAS, UNTOLD, 0.0)))

    def strength(self, which: int) -> float:
        """Returns the strength of an unknown's instrument, in standard errors.

        It is the smaller of two covariances of column and instrument: alone, and beyond what the
        other unknowns explain of both. Where it is small, as for the clock on a circle at constant
        speed, or for the scale beside a bias, the variation is noise; a weak instrument leads back
        to plain least squares, with its bias and its small standard error.
        """
        A, X, Z = self._A, self._X, self._Z
        others = np.arange(len(A)) != which
        of_x, of_z = -np.ones(len(A)), -np.ones(len(A))
        of_x[others] = np.linalg.solve(A[np.ix_(others, others)], A[others, which])
        of_z[others] = np.linalg.solve(A[np.ix_(others, others)].T, A[which, others])
        x, z = (c[:, :, which] - c[:, :, which].mean(axis=0) for c in (X, Z))
        found = []
        for both in (x * z, (X @ of_x) * (Z @ of_z)):
            together = np.sum(both * self._trust, axis=1)
            found.append(float(together.sum() / (np.linalg.norm(together) + 1e-12)))
        return min(found)

    def tells(self, which: int) -> bool:
        """Returns whether the drive shows anything of an unknown."""
        return self.strength(which) > TELLS_SIGMAS


def _within(Z: Floats, X: Floats) -> Floats:
    """Limits instruments to the range of their columns, for frozen pictures make them leap.

    A column that is its own instrument is not changed; further instruments belong to the first
    columns in their order.
    """
    low, high = np.quantile(X, WITHIN, axis=0)
    of = np.arange(Z.shape[2]) % X.shape[2]
    own = X[:, :, of] == Z
    return np.where(own, Z, np.clip(Z, low[:, of], high[:, of]))


def _halves(Z: Floats, X: Floats) -> list[tuple[NDArray[np.bool_], Floats, Floats]]:
    """Returns which rows are in the odd and in the even pieces of the drive, with their Z and X."""
    piece = np.arange(len(X)) // PIECE_FRAMES % 2
    return [(piece == own, Z[piece == own], X[piece == own]) for own in (0, 1)]


def _told_by_others(
    halves: list[tuple[NDArray[np.bool_], Floats, Floats]],
    trust: Floats,
    exact: NDArray[np.intp],
) -> Floats:
    """Returns (k, a, m) what the instruments predict of X, fitted in the other half of the pieces.

    Fitted where it is used, many useless instruments would each explain a little of the column's
    own noise, and seem to be of use (Angrist, Imbens and Krueger 1999).
    """
    told = np.empty((*trust.shape, halves[0][2].shape[2]))
    for (here, Z, _), (there, *others) in (halves, halves[::-1]):
        of_Z, of_X = (c.reshape(-1, c.shape[2]) for c in others)
        trusted = of_Z * trust[there].reshape(-1, 1)
        told[here] = Z @ _first_stage(trusted, of_Z, of_X, exact)
    return told


def _first_stage(trusted: Floats, Z: Floats, X: Floats, exact: NDArray[np.intp]) -> Floats:
    """Returns (q, m) that maps instruments to predicted columns of X; an exact column to itself."""
    others = np.setdiff1d(np.arange(X.shape[1]), exact)
    told_by = np.setdiff1d(np.arange(Z.shape[1]), exact)
    stage = np.zeros((Z.shape[1], X.shape[1]))
    stage[exact, exact] = 1.0
    trusted, Z = trusted[:, told_by], Z[:, told_by]
    size = np.sqrt(np.sum(trusted * Z, axis=0)) + 1e-12
    half = trusted / size
    of_Z = half.T @ (Z / size) + RIDGE * np.eye(len(told_by))
    stage[np.ix_(told_by, others)] = np.linalg.solve(of_Z, half.T @ X[:, others]) / size[:, None]
    return stage
