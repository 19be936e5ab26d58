# SPDX-License-Identifier: MIT
"""Tells whether the pixel noise is white, from pairs of views of the same points.

White noise is as large after five frames as after one. A tracker that drifts is off by more the
longer it follows a point. The filter takes each frame's noise for new and trusts such tracks too
much; the likelihood of one step cannot show that. The setting track-drift says how far tracks
wander. Errors that persist otherwise need a larger sigma: noise of variance s^2 that keeps the
share r from frame to frame averages out as white noise of s^2 (1 + r) / (1 - r).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pelorus.check.options import Settings
from pelorus.io.recording import Recording
from pelorus.math.motion import Times
from pelorus.program.console import progress
from pelorus.tracking import visual_motion
from pelorus.tracking.row_gaps import TOLD_ABOVE_PX, RowGaps, row_gaps
from pelorus.tracking.visual_motion import seen_pairs
from pelorus.wire.layout import Floats

DRIFT = "track-drift"
LASTS = 0.7  # r: the errors of real trackers stop growing
LAGS = (1, 2, 3, 5)
DRIFTS_ABOVE = 1.25  # ratio of sigma at lag 5 to lag 1: simulated white noise gives 0.97 to 1.05
KEEPS = 0.86  # r: trackers of KITTI drives keep 0.83 to 0.93; lags up to 5 cannot estimate it well
SIGMA_MOST_PX = 5.0
KNOWN_TO = 1.5  # factor: r within that range changes sigma by 0.8 to 1.3


@dataclass(frozen=True)
class TrackNoise:
    """The noise of a recording's tracks.

    It has the sigma by lag, px (NaN: too few points are seen twice), the one sigma that covers all
    lags, and how far tracks wander, px/sqrt(s).
    """

    by_lag: dict[int, float]
    stands_for_px: float
    rows: RowGaps | None = None
    points: float = 0.0  # a frame, median
    wanders_px: float = 0.0

    @property
    def rows_px(self) -> float:
        """Returns the least sigma that the rectification's error needs, px; 0 where that is small
        or unknown.

        All points of a region share the error in every frame, so motion and map bend to fit, and no
        likelihood shows it. The filter believes the mean of n points to be known to sigma /
        sqrt(n), which must be no better than the shared error.
        """
        if self.rows is None or self.rows.smooth_px <= TOLD_ABOVE_PX:
            return 0.0
        return self.rows.stands_for_px(self.points)

    @property
    def growth(self) -> float:
        """Returns the ratio of sigma at the longest known lag to that at the shortest."""
        known = [sigma for sigma in self.by_lag.values() if np.isfinite(sigma)]
        return known[-1] / known[0] if len(known) > 1 and known[0] > 0 else float("nan")

    @property
    def drifts(self) -> bool:
        return self.growth > DRIFTS_ABOVE

    def setting(self, given: Settings) -> dict[str, str]:
        """Returns the setting for the drift of tracks, unless the given one is about that.

        With `world` there is no such setting.
        """
        if not self.drifts or given.get("model") == "world":
            return {}
        told, was = LASTS * self.wanders_px, float(given.get(DRIFT, "0"))
        is_about_it = told / KNOWN_TO <= was <= 2 * self.wanders_px
        return {DRIFT: given[DRIFT] if is_about_it else f"{told:.2g}"}


def differs_clearly(found: float, given: float) -> bool:
    """Returns whether a sigma found clearly differs from the given one; False where it is NaN."""
    return bool(max(found / given, given / found) > KNOWN_TO)


def track_noise(recording: Recording) -> TrackNoise:
    """Measures the noise of a recording's tracks."""
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
    """Returns the drift d, px/sqrt(s).

    A point seen twice has four rows, each of variance 2 w. The drift is in what both pictures
    share, two of the four: sigma_lag^2 = w + lag tau d^2 / 4.
    """
    tau_s = float(np.median(np.diff(frame_t_ns))) * 1e-9 if len(frame_t_ns) > 1 else 0.0
    d2 = _fitted(by_lag, lambda lags: tau_s * lags / 4)[1]
    return float(np.sqrt(d2)) if d2 > 0 else 0.0


def _stands_for(by_lag: dict[int, float]) -> float:
    """Returns the white sigma that stands for sigma_lag^2 = w + s^2 (1 - r^lag)."""
    w, s2 = np.clip(_fitted(by_lag, lambda lags: 1 - KEEPS**lags), 0, None)
    stands = np.sqrt(w + s2 * (1 + KEEPS) / (1 - KEEPS))
    return float(min(stands, SIGMA_MOST_PX)) if np.isfinite(stands) else float("nan")


def _fitted(by_lag: dict[int, float], growth: Callable[[Floats], Floats]) -> Floats:
    """Returns (a, b) of sigma_lag^2 = a + b growth(lag), by least squares; NaN with too few
    lags.
    """
    lags = np.array([lag for lag, sigma in by_lag.items() if np.isfinite(sigma)], np.float64)
    if len(lags) < 2:
        return np.full(2, np.nan)
    expected = np.array([by_lag[int(lag)] ** 2 for lag in lags])
    columns = np.stack((np.ones(len(lags)), growth(lags)), axis=-1)
    return np.asarray(np.linalg.lstsq(columns, expected, rcond=None)[0])
