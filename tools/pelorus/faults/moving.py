# SPDX-License-Identifier: MIT
"""Measures how many of the seen points move by themselves.

Most points show one motion of the camera. Seen again some frames later, a point of the world is
where that motion puts it, and a bad match is off once. A point that moves is off in most of its
views, and the more the longer it is watched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pelorus.faults.two_views import TwoViews, two_views
from pelorus.io.tracks import Tracks
from pelorus.wire.frames import Camera

FAR_LAG = 3  # frames
OFF_D2 = 25.0  # of three degrees of freedom: one in 70,000 inliers
DRIFT_PX = 1.5  # allowed drift of a tracker between the views
VIEWS_LEAST = 4  # pairs that a track needs
MOST_OF_THEM = 0.5
TRACKS_LEAST = 10
MAD_TO_SIGMA, NOISE_LEAST, DRIFTS_ABOVE = 1.4826, 0.5, 1.5
SHARE_LEAST = 0.14
USUAL, USUAL_SIGMAS = 0.12, 2.3  # on roads 5 to 12 % drive, or are tracked as badly


@dataclass(frozen=True)
class Moving:
    """The share of moving tracks among those that are long enough."""

    tracks: int
    share: float

    @property
    def least(self) -> float:
        """Returns the share above which it is more than usual; few tracks allow for chance."""
        by_chance = USUAL_SIGMAS * float(np.sqrt(USUAL / max(self.tracks, 1)))
        return max(SHARE_LEAST, USUAL + by_chance)

    @property
    def more_than_usual(self) -> bool:
        return self.share > self.least


def moving(tracks: Tracks, camera: Camera, near: TwoViews) -> Moving:
    """Counts the moving tracks; `near` are views of neighbouring frames."""
    far = two_views(tracks, camera, FAR_LAG)
    _, number = np.unique(tracks.id, return_inverse=True)
    count = int(number.max()) + 1 if len(number) else 0
    whose = number[far.first]
    views = np.bincount(whose, minlength=count)
    least = max(OFF_D2 * _noise(tracks, near, far) ** 2, (DRIFT_PX / far.sigma_px) ** 2)
    off = np.bincount(whose, far.d2 > least, minlength=count)
    long = views >= VIEWS_LEAST
    if long.sum() < TRACKS_LEAST:
        return Moving(int(long.sum()), 0.0)
    # by views, so that a long track counts as much as it does in a filter
    moves = long & (off > MOST_OF_THEM * views)
    return Moving(int(long.sum()), float(views[moves].sum() / views[long].sum()))


def _noise(tracks: Tracks, near: TwoViews, far: TwoViews) -> float:
    """Returns the pixel noise in units of the far views' own, which moving points have widened.

    It comes from the difference of left and right rows in one frame. Where all tracks drift it is
    1, for rows do not show drift.
    """
    if far.sigma_px > DRIFTS_ABOVE * near.sigma_px:
        return 1.0
    rows = tracks.pixels[:, 1] - tracks.pixels[:, 3]
    sigma = MAD_TO_SIGMA * float(np.median(np.abs(rows - np.median(rows)))) / np.sqrt(2)
    return float(np.clip(sigma / far.sigma_px, NOISE_LEAST, 1.0))
