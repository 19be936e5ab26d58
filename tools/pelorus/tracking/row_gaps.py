# SPDX-License-Identifier: MIT
"""Measures how well a pair is rectified by its tracks: a point's rows should be equal.

An error that varies smoothly over the picture is not the tracker's noise but the calibration's, of
the lens or of the cameras' orientation. All points of a region share it, in every frame; along the
row, where disparities are measured, it is probably as large, and cannot be seen.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pelorus.io.tracks import Tracks
from pelorus.wire.layout import Floats

OBSERVATIONS_MIN = 200
TRACKS_MIN = 30
FAR_PX = 2.0  # from the median; beyond it is a bad match
ROUNDS = 10
TERMS = 6  # 1, x, y, x^2, x y, y^2
TOLD_ABOVE_PX = 0.15  # good calibrations stay below


class RowGaps(NamedTuple):
    """Parts of vL - vR, px: the smooth part (RMS, largest), and each match's remainder (RMS)."""

    smooth_px: float
    largest_px: float
    rest_px: float

    @property
    def shared_px(self) -> float:
        """Returns the part of it in one picture's pixels."""
        return self.smooth_px / float(np.sqrt(2))

    def stands_for_px(self, points: float) -> float:
        """Returns the pixel sigma with which a frame's mean is no better than this error."""
        return self.shared_px * float(np.sqrt(points))


def row_gaps(tracks: Tracks) -> RowGaps | None:
    """Fits a polynomial of second degree over the left picture, with weights against bad matches.

    What chance makes of persistent noise of a track is subtracted. None where there are too few
    observations.
    """
    gap = tracks.pixels[:, 1] - tracks.pixels[:, 3]
    near = np.abs(gap - np.median(gap)) < FAR_PX if len(gap) else np.zeros(0, np.bool_)
    lives = len(np.unique(tracks.id[near]))
    if near.sum() < OBSERVATIONS_MIN or lives < TRACKS_MIN:
        return None
    gap, at = gap[near], tracks.pixels[near, :2]
    x, y = ((at - at.mean(axis=0)) / np.maximum(at.std(axis=0), 1.0)).T
    columns: Floats = np.stack((np.ones(len(x)), x, y, x * x, x * y, y * y), axis=-1)
    weight = np.ones(len(gap))
    for _ in range(ROUNDS):
        terms = np.linalg.lstsq(columns * weight[:, None], gap * weight, rcond=None)[0]
        rest = gap - columns @ terms
        rest_px = 1.4826 * float(np.median(np.abs(rest)))
        weight = 1 / (1 + (rest / (2 * rest_px + 1e-6)) ** 2)
    smooth = columns @ terms
    chance = TERMS * rest_px**2 / lives
    by_fit = max(float(np.mean(smooth**2)) - chance, 0.0)
    return RowGaps(float(np.sqrt(by_fit)), float(np.percentile(np.abs(smooth), 99)), rest_px)
