# SPDX-License-Identifier: MIT
"""What the rows of a pair tell of its rectification."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from pelorus.check.halves_alike import with_shared_rows
from pelorus.check.outcome import NOTHING
from pelorus.check.parameters import Tuned
from pelorus.check.tracks_noise import TrackNoise
from pelorus.io.tracks import Tracks
from pelorus.tracking.row_gaps import row_gaps

FRAMES, POINTS = 12, 60


def tracks(bend: NDArray[np.float64], noise_px: float = 0.1, points: int = POINTS) -> Tracks:
    """Points all over 800 x 400 px; vL - vR is bend . (1, x, y, x y), x and y from -1 to 1."""
    chance = np.random.default_rng(1)
    n = FRAMES * points
    xy = chance.uniform(-1, 1, (n, 2))
    x, y = xy.T
    gap = np.stack((x * 0 + 1, x, y, x * y), axis=-1) @ bend
    left = 200 * xy * (2, 1) + (400, 200)
    right = left - np.stack((chance.uniform(1, 30, n), gap), axis=-1)
    pixels = np.hstack((left, right)) + chance.normal(0, noise_px, (n, 4))
    frame = np.repeat(np.arange(FRAMES), points)
    return Tracks.from_rows(FRAMES, frame, np.tile(np.arange(points), FRAMES), pixels)


def test_a_bent_pair_is_told_from_noise_and_bad_matches_do_not_count() -> None:
    bent = tracks(np.array([0.2, 0.3, 0.0, 0.9]))
    found = row_gaps(bent)
    assert found is not None
    assert abs(found.smooth_px - np.sqrt(0.2**2 + 0.3**2 / 3 + 0.9**2 / 9)) < 0.02
    assert abs(found.rest_px - 0.1 * np.sqrt(2)) < 0.02
    assert 0.9 < found.largest_px < 1.5
    wrong = bent.pixels.copy()
    wrong[::9, 3] += 1.5
    with_bad = row_gaps(Tracks(FRAMES, bent.frame, bent.id, wrong))
    assert with_bad is not None
    assert abs(with_bad.smooth_px - found.smooth_px) < 0.06


def test_noise_alone_is_no_bend() -> None:
    for noise_px in (0.1, 0.5):
        found = row_gaps(tracks(np.zeros(4), noise_px))
        assert found is not None
        assert found.smooth_px < 0.1 * noise_px


def test_what_one_number_shares_grows_with_the_points_that_it_must_stand_for() -> None:
    found = row_gaps(tracks(np.array([0.4, 0, 0, 0])))
    assert found is not None
    assert abs(found.stands_for_px(49) - 7 * 0.4 / np.sqrt(2)) < 0.05


def test_few_tracks_tell_nothing() -> None:
    assert row_gaps(tracks(np.zeros(4), points=10)) is None
    none = np.zeros(0, np.int64)
    assert row_gaps(Tracks(0, none, none, np.zeros((0, 4)))) is None


class AnyBench:
    """Where a run is wanted that is less sure than the one before."""

    def run(self, _: object) -> object:
        return replace(NOTHING, pose_log_det=0.0)


def test_the_pixel_sigma_is_no_smaller_than_what_the_rectification_leaves() -> None:
    def sigma(bend: list[float], given: str) -> float:
        noise = TrackNoise({}, float("nan"), row_gaps(tracks(np.array(bend))), 49)
        tuned = Tuned({"pixel-sigma": given}, NOTHING, NOTHING, noise)
        return float(with_shared_rows(cast(Any, AnyBench()), tuned).settings["pixel-sigma"])

    shared_px = 7 * 0.4 / np.sqrt(2)
    assert abs(sigma([0.4, 0, 0, 0], "0.3") - shared_px) < 0.05
    assert sigma([0.4, 0, 0, 0], "1.6") == 1.6  # about that
    assert sigma([0.4, 0, 0, 0], "5") == 5
    assert sigma([0.1, 0, 0, 0], "0.3") == 0.3  # as good as pairs are
