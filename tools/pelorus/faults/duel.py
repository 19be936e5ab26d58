# SPDX-License-Identifier: MIT
"""Which of two hypotheses explains the frames better: robust statistics of their errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pelorus.faults.likelihood import of_share
from pelorus.layout import Floats

TOO_FEW = "too few common tracks to judge"


@dataclass(frozen=True)
class Duel:
    """Medians over frames of both errors, and in how many frames the challenger's is smaller."""

    frames: int
    given: float
    challenger: float
    wins: int
    independent: int  # frames / lag: overlapping windows are no independent witnesses

    @property
    def share(self) -> float:
        return self.wins / self.frames if self.frames else 0.0

    @property
    def z(self) -> float:
        """Sign test: standard deviations by which the wins exceed a coin's."""
        return 2.0 * (self.share - 0.5) * float(np.sqrt(self.independent))

    @property
    def ratio(self) -> float:
        """2 ln of the likelihood of so many wins beside that of a coin's."""
        return of_share(self.share, self.independent, 0.5)

    def clearly_won(self, ratio: float, share: float, z: float) -> bool:
        return self.challenger < ratio * self.given and self.share >= share and self.z >= z


def duel(given: Floats, challenger: Floats, lag: int) -> Duel:
    """Errors of the same frames under either hypothesis; frames without both are left out."""
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
