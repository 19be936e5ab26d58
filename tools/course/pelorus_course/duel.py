# SPDX-License-Identifier: MIT
"""Compares two hypotheses by how well they explain the frames, with robust statistics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pelorus.faults.likelihood import of_share
from pelorus.wire.layout import Floats

TOO_FEW = "too few common tracks to judge"


@dataclass(frozen=True)
class Duel:
    """Medians of both errors over frames, and in how many frames the challenger's is smaller."""

    frames: int
    given: float
    challenger: float
    wins: int
    independent: int  # frames / lag, for windows overlap

    @property
    def share(self) -> float:
        return self.wins / self.frames if self.frames else 0.0

    @property
    def z(self) -> float:
        """Returns the sign test's z: by how many standard deviations the wins exceed a coin's."""
        return 2.0 * (self.share - 0.5) * float(np.sqrt(self.independent))

    @property
    def ratio(self) -> float:
        """Returns 2 ln of the likelihood ratio of so many wins against a coin."""
        return of_share(self.share, self.independent, 0.5)


def duel(given: Floats, challenger: Floats, lag: int) -> Duel:
    """Compares errors of the same frames under both hypotheses; both must have them."""
    both = np.isfinite(given) & np.isfinite(challenger)
    frames = int(both.sum())
    if not frames:
        return Duel(0, np.nan, np.nan, 0, 0)
    return Duel(
        frames,
        float(np.median(given[both])),
        float(np.median(challenger[both])),
        int(np.sum(challenger[both] < given[both])),
        frames // lag,
    )
