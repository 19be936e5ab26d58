# SPDX-License-Identifier: MIT
"""The relative pose error by distance travelled: how a trajectory drifts, wherever it begins.

For each start i and length L, with j the first frame at which the true distance since i is L or
more:

    E = (T_i^-1 T_j)^-1 (T*_i^-1 T*_j)        T the estimate, T* the truth

The figures are |p(E)| / L and the angle of R(E) / L, as RMS over the starts. Geiger, Lenz, Urtasun:
Are we ready for autonomous driving? The KITTI vision benchmark suite, 2012.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pelorus.evaluate.evaluation import Accuracy
from pelorus.math import se3
from pelorus.math.consistency import rms
from pelorus.wire.layout import Floats

STARTS_MOST = 2000
STARTS_LEAST = 10  # fewer say little, for they share most of their path
LENGTHS_MOST = 7
SHARE = 0.5  # of the path; longer ones have few distinct starts


class Drift(NamedTuple):
    """The drift over one length: RMS over `starts`."""

    length_m: float
    starts: int
    position_m: float
    rotation_deg: float

    @property
    def percent(self) -> float:
        return 100 * self.position_m / self.length_m


def drifts(accuracy: Accuracy) -> list[Drift]:
    """Returns the drifts over lengths 1, 2, 5, 10 ... up to half the path; short ones first."""
    steps = np.linalg.norm(np.diff(accuracy.truth.p, axis=0), axis=1)
    way = np.concatenate(([0.0], np.cumsum(steps)))
    found = (_drift(accuracy, way, length) for length in _lengths(float(way[-1])))
    return [drift for drift in found if drift is not None]


def _lengths(whole_m: float) -> Iterator[float]:
    if not np.isfinite(whole_m) or whole_m <= 0:
        return
    top = int(np.floor(np.log10(whole_m)))
    ladder = [n * 10.0**k for k in range(top - 3, top + 1) for n in (1, 2, 5)]
    yield from [length for length in ladder if length <= SHARE * whole_m][-LENGTHS_MOST:]


def _drift(accuracy: Accuracy, way: Floats, length_m: float) -> Drift | None:
    ends = np.searchsorted(way, way + length_m)
    starts = np.nonzero(ends < len(way))[0]
    starts = starts[:: -(-len(starts) // STARTS_MOST) or 1]
    if len(starts) < STARTS_LEAST:
        return None
    mine, expected = (
        se3.compose(se3.inverse(poses.at(starts)), poses.at(ends[starts]))
        for poses in (accuracy.estimate, accuracy.truth)
    )
    error = se3.compose(se3.inverse(mine), expected)
    angles = se3.log(error)[:, 3:]
    return Drift(length_m, len(starts), rms(error.p), float(np.degrees(rms(angles))))
