# SPDX-License-Identifier: MIT
"""Is the pixels' noise new in every frame? Two views of the same points tell.

White noise is as large after five frames as after one. A tracker that drifts is off by more the
longer it follows a point, and the filter, which takes each frame's noise for new, believes such
tracks too much: the likelihood of one step cannot see that. The setting track-drift says how far
they wander. What they share and keep besides needs a larger sigma as well: noise of variance s^2
that keeps the share r from frame to frame averages out as white noise of s^2 (1 + r) / (1 - r).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pelorus import visual_motion
from pelorus.check.options import Settings
from pelorus.console import progress
from pelorus.layout import Floats
from pelorus.motion import Times
from pelorus.recording import Recording
from pelorus.row_gaps import TOLD_ABOVE_PX, RowGaps, row_gaps
from pelorus.visual_motion import seen_pairs

DRIFT = "track-drift"
LASTS = 0.7  # of it: errors of real trackers stop growing
LAGS = (1, 2, 3, 5)
DRIFTS_ABOVE = 1.25  # of sigma at lag 5 to that at lag 1: simulated white noise gives 0.97 to 1.05
KEEPS = 0.86  # r: trackers of KITTI drives keep 0.83 to 0.93; lags up to 5 cannot tell it well
SIGMA_MOST_PX = 5.0
KNOWN_TO = 1.5  # times: that range of r alone makes sigma 0.8 to 1.3 times as large


@dataclass(frozen=True)
class TrackNoise:
    """Sigma by lag, px (NaN: too few points are seen twice), the one that stands for all, and how
    far tracks wander in a second, px/sqrt(s).
    """

    by_lag: dict[int, float]
    stands_for_px: float
    rows: RowGaps | None = None
    points: float = 0.0  # of a frame, in the median
    wanders_px: float = 0.0

    @property
    def rows_px(self) -> float:
        """The least sigma that the rectification leaves, 0 where that is good or untold.

        All points of a region are off alike, in every frame, so that motion and map bend to fit,
        and no likelihood can see it. The filter believes the mean of n points to be known to
        sigma / sqrt(n): not better than the error that they share.
        """
        if self.rows is None or self.rows.smooth_px <= TOLD_ABOVE_PX:
            return 0.0
        return self.rows.stands_for_px(self.points)

    @property
    def growth(self) -> float:
        """From the shortest lag to the longest that can be told."""
        known = [sigma for sigma in self.by_lag.values() if np.isfinite(sigma)]
        return known[-1] / known[0] if len(known) > 1 and known[0] > 0 else float("nan")

    @property
    def drifts(self) -> bool:
        return self.growth > DRIFTS_ABOVE

    def setting(self, given: Settings) -> dict[str, str]:
        """What the filter is told of the drift, unless what was given is about that. `world` has no
        such setting.
        """
        if not self.drifts or given.get("model") == "world":
            return {}
        told, was = LASTS * self.wanders_px, float(given.get(DRIFT, "0"))
        is_about_it = told / KNOWN_TO <= was <= 2 * self.wanders_px
        return {DRIFT: given[DRIFT] if is_about_it else f"{told:.2g}"}


def told_apart(found: float, given: float) -> bool:
    """Is a sigma that only stands for something clearly another one than the given one? Not where
    it is unknown (NaN).
    """
    return bool(max(found / given, given / found) > KNOWN_TO)


def track_noise(recording: Recording) -> TrackNoise:
    """Of a recording's tracks."""
    camera = recording.header.camera
    by_lag = {}
    for lag in progress(LAGS, "noise of the tracks", len(LAGS)):
        seen = seen_pairs(recording.tracks, camera, lag)
        motion = visual_motion.estimate(seen, camera)
        by_lag[lag] = visual_motion.pixel_sigma(seen, camera, motion)
    tracks = recording.tracks
    points = float(np.median(tracks.counts())) if tracks.frame_count else 0.0
    wanders_px = _wanders(by_lag, recording.frame_t_ns)
    return TrackNoise(by_lag, _stands_for(by_lag), row_gaps(tracks), points, wanders_px)


def _wanders(by_lag: dict[int, float], frame_t_ns: Times) -> float:
    """d, px/sqrt(s): of the four rows of a point seen twice, each of variance 2 w, the drift is in
    what both pictures share, which is two of the four: sigma_lag^2 = w + lag tau d^2 / 4.
    """
    tau_s = float(np.median(np.diff(frame_t_ns))) * 1e-9 if len(frame_t_ns) > 1 else 0.0
    d2 = _fitted(by_lag, lambda lags: tau_s * lags / 4)[1]
    return float(np.sqrt(d2)) if d2 > 0 else 0.0


def _stands_for(by_lag: dict[int, float]) -> float:
    """sigma_lag^2 = w + s^2 (1 - r^lag), w, s^2 >= 0."""
    w, s2 = np.clip(_fitted(by_lag, lambda lags: 1 - KEEPS**lags), 0, None)
    stands = np.sqrt(w + s2 * (1 + KEEPS) / (1 - KEEPS))
    return float(min(stands, SIGMA_MOST_PX)) if np.isfinite(stands) else float("nan")


def _fitted(by_lag: dict[int, float], growth: Callable[[Floats], Floats]) -> Floats:
    """(a, b) of sigma_lag^2 = a + b growth(lag), by least squares; NaN where too few lags tell."""
    lags = np.array([lag for lag, sigma in by_lag.items() if np.isfinite(sigma)], np.float64)
    if len(lags) < 2:
        return np.full(2, np.nan)
    due = np.array([by_lag[int(lag)] ** 2 for lag in lags])
    columns = np.stack((np.ones(len(lags)), growth(lags)), axis=-1)
    return np.asarray(np.linalg.lstsq(columns, due, rcond=None)[0])
