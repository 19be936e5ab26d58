# SPDX-License-Identifier: MIT
"""Simulates the robot's measurements: noise, biases, tracks, bad matches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pelorus.simulate.scene import IMAGE_PX, View
from pelorus.wire.layout import Floats

OUTLIER_DISPARITY_MAX_PX = 60.0


def biases(sigma: float, walk: float, tau_s: Floats, chance: np.random.Generator) -> Floats:
    """Returns (n, 3) biases: drawn once, then a random walk of `walk` (unit^2/s)."""
    first = sigma * chance.standard_normal(3)
    steps = np.sqrt(walk * tau_s)[:, None] * chance.standard_normal((len(tau_s), 3))
    out = np.empty((len(tau_s) + 1, 3))
    out[0] = first
    for k, step in enumerate(steps):  # cumsum's order of operations is not specified
        out[k + 1] = out[k] + step
    return out


def white(sigma: float, count: int, chance: np.random.Generator) -> Floats:
    """Returns (count, 3) independent noise."""
    return sigma * chance.standard_normal((count, 3))


@dataclass
class SimulatedTracker:
    """Gives landmarks ids: kept while one is seen without a break, a new one afterwards.

    With `keep_ids` a landmark has one permanent id (its number), so loops close.
    """

    count: int  # landmarks of the scene
    most: int  # observations of a frame at most
    loss: float  # probability a frame that a track breaks
    keep_ids: bool
    chance: np.random.Generator

    def __post_init__(self) -> None:
        self._id = np.full(self.count, -1, np.int64)  # -1: not tracked
        self._next = 0

    def follow(self, visible: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Returns the landmarks of this frame, ascending; `ids` has theirs."""
        lost = self.chance.random(self.count) < self.loss
        preference = self.chance.random(self.count)
        tracked = (self._id >= 0) & visible & ~lost
        self._id[~tracked] = -1
        fresh = np.nonzero(visible & ~tracked & ~lost)[0]
        room = max(self.most - int(tracked.sum()), 0)
        chosen = np.sort(fresh[np.argsort(preference[fresh], kind="stable")][:room])
        self._id[chosen] = chosen if self.keep_ids else self._next + np.arange(len(chosen))
        self._next += len(chosen)
        return np.nonzero(self._id >= 0)[0]

    def ids(self, landmarks: NDArray[np.intp]) -> NDArray[np.int64]:
        return self._id[landmarks]


def measure(
    seen: View,
    landmarks: NDArray[np.intp],
    pixel_sigma: float,
    outliers: float,
    chance: np.random.Generator,
    bad: np.random.Generator,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Returns pixels (n, 4) with independent noise, and which of them are wrong matches."""
    count = len(landmarks)
    noise = pixel_sigma * chance.standard_normal((count, 4))
    wrong = bad.random(count) < outliers
    u, v = bad.uniform(0, IMAGE_PX[0], count), bad.uniform(0, IMAGE_PX[1], count)
    disparity = bad.uniform(0, OUTLIER_DISPARITY_MAX_PX, count)
    elsewhere = np.stack((u, v, u - disparity, v), axis=-1)
    return np.where(wrong[:, None], elsewhere, seen.pixels[landmarks]) + noise, wrong
