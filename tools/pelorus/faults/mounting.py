# SPDX-License-Identifier: MIT
"""Are the twists in the axes that the extrinsic means? All 48 ways to permute and mirror axes
compete with those given, for velocities and for rates of turn each by itself: a left-handed frame
mirrors them in different ways, and a wrong sign may be in one column alone.

A way to turn F wins if b -> F b explains what the images show and b does not: on the difference
d = b - F b, taken some frames beside, which has no part in the noise of this frame,

    T = sum d' (y - b) / sum d' d     is 0 if the axes are right, and -1 if F is:

far from the one, and clearly nearer to the other. Velocities must be the surer of it: what those of
a road are off by across the way lasts for seconds, and looks like other axes; turns have no such
errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pelorus import se3
from pelorus.faults.axes import ways
from pelorus.layout import Floats

BESIDE = (1, 2)
EXPLAINED_LEAST = 0.3
SURE, BEYOND = 6.0, 3.0  # standard errors by which T must lie below 0, and below the middle
SURE_OF_WAYS = 6.0  # the same below the middle, by velocities: whole blocks must agree in it
BLOCKS = 40
ROUNDS = 4
SAMPLES_MIN = 50
TILT_RAD, LEVER_M = 0.05, 1.0


@dataclass(frozen=True)
class Duel:
    """The best of all ways beside the given axes."""

    F: Floats
    effect: float  # T: 0 to -1
    sigma: float  # of T
    z: float  # standard errors by which the blocks of the drive lie below the middle
    by_ways: bool
    explained: float  # of what the images show on the axes in question, by F

    @property
    def won(self) -> bool:
        below = -0.5 - self.effect
        sure = -self.effect > SURE * self.sigma and below > BEYOND * self.sigma
        if self.by_ways:
            sure = below > 0 and self.z > SURE_OF_WAYS
        return sure and self.explained > EXPLAINED_LEAST


STAYS = Duel(np.eye(3), 0.0, float("inf"), 0.0, False, 0.0)


def best_axes(seen: Floats, told: Floats, turns: Floats | None = None) -> Duel:
    """`seen` (n, 3) by the images in body axes as given, `told` by the twists. Of velocities,
    `turns` (n, 3) are the images' own: what moves with them, a lever that is wrong, is left out.
    """
    good = np.isfinite(seen).all(axis=1) & np.isfinite(told).all(axis=1)
    if good.sum() < SAMPLES_MIN:
        return STAYS
    seen, told = seen[good], told[good]
    turned = None if turns is None else turns[good]
    candidates = ways()
    errors = [seen - told @ F.T for F in candidates]
    besides = [_beside(told @ F.T, turned) for F in candidates]
    first = [_cost(e, beside) for e, beside in zip(errors, besides, strict=True)]
    spread = min(first, key=lambda cost: cost[0])[1]
    costs = [_cost(e, beside, spread)[0] for e, beside in zip(errors, besides, strict=True)]
    best = int(np.argmin(costs))
    if best == 0:
        return STAYS
    found = _duel(candidates[best], seen, told, besides[0], spread)
    return replace(found, by_ways=turns is not None)


def _beside(told: Floats, turns: Floats | None) -> Floats:
    """(n, 3, 9) what is not asked for: a bias, a small tilt and a lever that is off."""
    bias = np.tile(np.eye(3), (len(told), 1, 1))
    arm = np.zeros_like(bias) if turns is None else se3.skew(turns)
    return np.concatenate((bias, -TILT_RAD * se3.skew(told), LEVER_M * arm), axis=2)


def _cost(error: Floats, nuisance: Floats, spread: Floats | None = None) -> tuple[float, Floats]:
    """Robust, of what no constant and no lever explains; and the spread of each axis."""
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
    A = np.einsum("nai,naj,na->ij", nuisance, nuisance, trust)
    A += np.diag([1e-9] * 3 + [1.0] * 6)  # tilt and lever are of their usual size
    return np.linalg.solve(A, np.einsum("nai,na,na->i", nuisance, error, trust))


def _duel(F: Floats, seen: Floats, told: Floats, nuisance: Floats, spread: Floats) -> Duel:
    trust = np.ones(told.shape) / spread

    def free(x: Floats) -> Floats:
        return np.asarray(x - nuisance @ _solved(x, nuisance, trust))

    error, d = free(seen - told), free(told - told @ F.T)
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
    below = np.bincount(at, along + 0.5 * power)  # under F half the power below zero
    spread_of = float(np.std(below, ddof=1)) + 1e-12
    z = -float(np.mean(below)) / spread_of * float(np.sqrt(blocks))
    other = ~np.isclose(np.diag(F), 1)
    left, shown = free(seen - told @ F.T)[:, other], free(seen)[:, other]
    share = np.sum(weight[:, None] * left**2) / (np.sum(weight[:, None] * shown**2) + 1e-12)
    return Duel(F, effect, sigma, z, False, 1 - float(share))
