# SPDX-License-Identifier: MIT
"""Detects twists in other axes than the extrinsic's.

All 48 ways to permute and mirror axes compete with the given one, for velocities and for rates of
turn separately: a left-handed frame mirrors them in different ways, and a wrong sign may be in one
column alone.

A way F wins if b -> F b explains what the images show and b does not. On the difference d = b - F
b, taken some frames away, where it does not share the noise of this frame,

T = sum d' (y - b) / sum d' d     is 0 if the axes are right, and -1 if F is.

T must be far from 0, and clearly nearer to -1. Velocities need more significance: their errors
across a road last for seconds, and look like other axes; turns have no such errors. Where neither
suffices alone, both may agree on the axes of a whole body.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pelorus.faults.fit import TELLS_SIGMAS
from pelorus.faults.likelihood import of_estimate
from pelorus.math import se3
from pelorus.math.axes import ways
from pelorus.wire.layout import Floats

BESIDE = (1, 2)
EXPLAINED_LEAST = 0.3
SURE_SHARED = 4.0  # standard errors of the correlation of turns: what they explain, noise may hide
SURE, BEYOND = 6.0, 3.0  # standard errors by which T must lie below 0, and below the middle
SURE_OF_WAYS = 6.0  # standard errors below the middle, by blocks of the velocities
NEAR = 0.3  # distance to -1 of both T, where they decide together
BLOCKS = 40
ROUNDS = 4
SAMPLES_MIN = 50
TILT_RAD, LEVER_M = 0.05, 1.0


@dataclass(frozen=True)
class AxesDuel:
    """The best of all ways against the given axes."""

    F: Floats
    effect: float  # T: 0 to -1
    sigma: float  # of T
    z: float  # standard errors by which the blocks of the drive lie below the middle
    by_ways: bool
    explained: float  # share of the images' motion on the axes in question that F explains
    shared: float = 0.0  # standard errors of the correlation there, by F
    together: bool = False  # velocities and rates of turn agree

    @property
    def is_far(self) -> bool:
        """Returns whether the axes are far from the given ones, and nearer to F."""
        return -self.effect > SURE * self.sigma and -0.5 - self.effect > BEYOND * self.sigma

    @property
    def ratio(self) -> float:
        """Returns 2 ln of the likelihood ratio of F against the given axes.

        For velocities blocks must agree, and z has their standard error.
        """
        sigma = self.sigma
        if self.by_ways and not self.together:
            sigma = (-0.5 - self.effect) / self.z
        return of_estimate(self.effect, 0.0, -1.0, sigma)

    @property
    def won(self) -> bool:
        if self.together:
            return True
        if self.by_ways:
            is_sure = self.effect < -0.5 and self.z > SURE_OF_WAYS
            return is_sure and self.explained > EXPLAINED_LEAST
        return self.is_far and self.shared > SURE_SHARED


STAYS = AxesDuel(np.eye(3), 0.0, float("inf"), 0.0, False, 0.0)


class MotionPairs:
    """Rates or velocities by images and twists, and how well each of the 48 ways matches them.

    `seen` (n, 3) by the images in the given body axes, `by_twists` (n, 3). For velocities `turns`
    (n, 3) are the images' own: what correlates with them, a wrong lever, is left out.
    """

    def __init__(self, seen: Floats, by_twists: Floats, turns: Floats | None = None) -> None:
        good = np.isfinite(seen).all(axis=1) & np.isfinite(by_twists).all(axis=1)
        self.enough = bool(good.sum() >= SAMPLES_MIN)
        if not self.enough:
            return
        self._seen, self._by_twists = seen[good], by_twists[good]
        self._by_ways = turns is not None
        turned = None if turns is None else turns[good]
        errors = [self._seen - self._by_twists @ F.T for F in ways()]
        besides = [_beside(self._by_twists @ F.T, turned) for F in ways()]
        first = [_cost(e, beside) for e, beside in zip(errors, besides, strict=True)]
        self._spread = min(first, key=lambda cost: cost[0])[1]
        self._nuisance = besides[0]
        self.costs = [
            _cost(e, beside, self._spread)[0] for e, beside in zip(errors, besides, strict=True)
        ]

    def alone(self) -> AxesDuel:
        """Returns the best of all ways."""
        return self.beside(int(np.argmin(self.costs))) if self.enough else STAYS

    def beside(self, k: int) -> AxesDuel:
        """Returns the k-th of the ways against the given axes."""
        if k == 0:
            return STAYS
        found = _duel(ways()[k], self._seen, self._by_twists, self._nuisance, self._spread)
        return replace(found, by_ways=self._by_ways)


def best_of_both(way: MotionPairs, turn: MotionPairs) -> tuple[AxesDuel, AxesDuel]:
    """Returns the axes of velocities and of rates of turn.

    Each is decided alone where it is significant; otherwise both together for a whole body: a way
    that mirrors one velocity mirrors the two other turns.
    """
    if not (way.enough and turn.enough):
        return STAYS, STAYS
    alone = way.alone(), turn.alone()
    if any(found.won for found in alone):
        return alone
    all_ways = ways()
    of_turn = [_index_of(np.linalg.det(F) * F) for F in all_ways]
    best = int(np.argmin(np.array(way.costs) + np.array(turn.costs)[of_turn]))
    both = way.beside(best), turn.beside(of_turn[best])
    if not all(np.isfinite(found.sigma) for found in both):
        return STAYS, STAYS
    weight = np.array([found.sigma**-2 for found in both])
    effect = float(weight @ [found.effect for found in both]) / weight.sum()
    together = replace(both[0], effect=effect, sigma=float(weight.sum() ** -0.5))
    # where only the speed is excited, noise does not correlate with noise in any axes
    shared = sum(found.shared for found in both) / float(np.sqrt(2))
    near = all(abs(found.effect + 1) < NEAR for found in both)
    if not (together.is_far and near and shared > TELLS_SIGMAS):
        return STAYS, STAYS
    return replace(both[0], together=True), replace(both[1], together=True)


def _index_of(F: Floats) -> int:
    return next(k for k, other in enumerate(ways()) if np.array_equal(other, F))


def _beside(by_twists: Floats, turns: Floats | None) -> Floats:
    """Returns (n, 3, 9) the nuisances: a bias, a small tilt and a wrong lever."""
    bias = np.tile(np.eye(3), (len(by_twists), 1, 1))
    arm = np.zeros_like(bias) if turns is None else se3.skew(turns)
    return np.concatenate((bias, -TILT_RAD * se3.skew(by_twists), LEVER_M * arm), axis=2)


def _cost(error: Floats, nuisance: Floats, spread: Floats | None = None) -> tuple[float, Floats]:
    """Returns the robust cost beside bias and lever, and the spread of each axis."""
    given = spread
    weight = np.ones(len(error))
    scale: Floats = np.var(error, axis=0) + 1e-12
    for _ in range(ROUNDS):
        left = error - nuisance @ _solved(error, nuisance, weight[:, None] / scale)
        scale = 2.198 * np.median(left**2, axis=0) + 1e-12 if given is None else given
        d2 = np.sum(left**2 / scale, axis=1) / 3
        weight = 1 / (1 + d2 / 4) ** 2
    total = float(np.sum(np.log1p(d2 / 4))) + 0.5 * len(d2) * float(np.sum(np.log(scale)))
    return total, scale


def _solved(error: Floats, nuisance: Floats, trust: Floats) -> Floats:
    rows = nuisance.reshape(-1, nuisance.shape[2])
    trusted = rows * trust.reshape(-1, 1)
    A = trusted.T @ rows
    A += np.diag([1e-9] * 3 + [1.0] * 6)  # prior: tilt and lever have their usual size
    return np.asarray(np.linalg.solve(A, trusted.T @ error.ravel()))


def _duel(F: Floats, seen: Floats, by_twists: Floats, nuisance: Floats, spread: Floats) -> AxesDuel:
    trust = np.ones(by_twists.shape) / spread

    def free(x: Floats) -> Floats:
        return np.asarray(x - nuisance @ _solved(x, nuisance, trust))

    error, d = free(seen - by_twists), free(by_twists - by_twists @ F.T)
    moved = [np.roll(d, k, axis=0) for k in (*BESIDE, *(-k for k in BESIDE))]
    beside = free(np.mean(moved, axis=0))
    edge = max(BESIDE)
    beside[:edge] = beside[-edge:] = 0
    size = np.sum(error**2 / spread, axis=1)
    weight = 1 / (1 + size / (4 * np.median(size) + 1e-12))
    along = np.sum(beside * error / spread, axis=1) * weight
    power = np.sum(beside * d / spread, axis=1) * weight
    blocks = min(BLOCKS, len(along) // 10)
    at = np.arange(len(along)) * blocks // len(along)
    total = float(np.sum(power))
    if total <= 0:
        return STAYS
    effect = float(np.sum(along)) / total
    score = np.bincount(at, along - effect * power)
    sigma = float(np.sqrt(np.sum(score**2) * blocks / (blocks - 1))) / total
    below = np.bincount(at, along + 0.5 * power)  # under F half the power is below zero
    spread_of = float(np.std(below, ddof=1)) + 1e-12
    z = -float(np.mean(below)) / spread_of * float(np.sqrt(blocks))
    other = ~np.isclose(np.diag(F), 1)
    left, shown = free(seen - by_twists @ F.T)[:, other], free(seen)[:, other]
    same = np.sum(shown * (shown - left) / spread[other], axis=1) * weight
    sums = np.bincount(at, same)
    shared = float(np.sum(sums) / (np.sqrt(blocks) * np.std(sums, ddof=1) + 1e-12))
    share = np.sum(weight[:, None] * left**2) / (np.sum(weight[:, None] * shown**2) + 1e-12)
    return AxesDuel(F, effect, sigma, z, False, 1 - float(share), shared)
