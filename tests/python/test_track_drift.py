# SPDX-License-Identifier: MIT
"""Tracks stay on the point of their birth: patches found again, and how far tracks wander."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from followed_pairs import WHERE, followed_in
from numpy.typing import NDArray
from opencv_tracker import patches
from opencv_tracker.settings import Settings
from opencv_tracker.tracker import track as track_by_opencv
from pelorus.io.tracks import Tracks
from pelorus.tracking import images

Floats = NDArray[np.float64]

WINDOW_PX = 15
SIDE_PX = 320
AHEAD = 1.03  # a wall ahead grows by so much from one frame to the next
TURN_DEG = 0.5  # and turns
FRAMES = 12
DISPARITY_PX = 8.0
Pair = tuple[images.Gray, images.Gray]


def texture(seed: int) -> Floats:
    """Blobs of a few px and finer ones."""
    noise = np.random.default_rng(seed).normal(size=(2, 4 * SIDE_PX, 4 * SIDE_PX))
    coarse, fine = (
        cv2.GaussianBlur(layer, (0, 0), sigma) * sigma
        for layer, sigma in zip(noise, (6, 2.5), strict=True)
    )
    return np.asarray(128 + 120 * (coarse + fine), np.float64)


def warped(source: Floats, M: Floats, seed: int) -> images.Gray:
    """The middle of `source` at M^-1 of each pixel, (2, 3), with a camera's noise."""
    to_source = cv2.invertAffineTransform(M)
    u, v = np.meshgrid(np.arange(SIDE_PX, dtype=float), np.arange(SIDE_PX, dtype=float))
    at = np.stack((u.ravel(), v.ravel(), np.ones(u.size)), axis=-1) @ to_source.T + 1.5 * SIDE_PX
    seen = patches._sample(source, np.asarray(at, np.float64)).reshape(SIDE_PX, SIDE_PX)
    noise = np.random.default_rng(seed).normal(0, 1.5, seen.shape)
    return np.clip(np.round(seen + noise), 0, 255).astype(np.uint8)


def about_middle(scale: float, turn_deg: float, shift_px: float = 0.0) -> Floats:
    """Growth and turn about the picture's middle, then a shift to the left."""
    M = cv2.getRotationMatrix2D((SIDE_PX / 2, SIDE_PX / 2), turn_deg, scale)
    M[0, 2] -= shift_px
    return np.asarray(M, np.float64)


def moved(M: Floats, points: Floats) -> Floats:
    return points @ M[:, :2].T + M[:, 2]


def test_a_patch_is_found_grown_turned_and_in_another_light() -> None:
    source = texture(1)
    first = warped(source, about_middle(1, 0), 1)
    M = about_middle(1.3, 12)
    then = np.clip(0.7 * warped(source, M, 2) + 40, 0, 255).astype(np.uint8)
    points = np.stack(np.meshgrid([100, 150, 200.0], [100, 160, 220.0]), -1).reshape(-1, 2)
    cut = patches.cut(patches.smooth(first), points.astype(np.float32), WINDOW_PX)
    guess = moved(M, points) + np.random.default_rng(3).uniform(-1, 1, points.shape)
    found = patches.find(patches.smooth(then), cut, guess.astype(np.float32), WINDOW_PX)
    assert np.linalg.norm(found.points - moved(M, points), axis=1).max() < 0.1
    assert np.abs(found.patches.A - M[:, :2]).max() < 0.05
    assert found.likeness.min() > 0.97
    other = patches.smooth(warped(texture(9), M, 2))
    assert patches.find(other, cut, guess.astype(np.float32), WINDOW_PX).likeness.max() < 0.9


def test_a_patch_that_has_doubled_is_cut_anew_and_others_are_kept() -> None:
    image = patches.smooth(warped(texture(1), about_middle(1, 0), 1))
    points = np.array([[100, 100], [200, 200]], np.float32)
    cut = patches.cut(image, points, WINDOW_PX)
    cut.A[1] *= 2
    before = cut.grey.copy()
    renewed = patches.renewed(cut, image, points + 7, WINDOW_PX)
    assert np.array_equal(renewed.grey[0], before[0])
    assert not np.array_equal(renewed.grey[1], before[1])
    assert np.array_equal(renewed.A, np.tile(np.eye(2), (2, 1, 1)))


def by_opencv(pairs: list[Pair]) -> Tracks:
    return track_by_opencv(pairs, WHERE, Settings())


def wander_px(follow: Callable[[list[Pair]], Tracks]) -> tuple[float, float]:
    """Returns the median distance of tracks on a wall ahead from their birth, young and old."""
    source = texture(5)
    ways = [about_middle(AHEAD**k, TURN_DEG * k) for k in range(FRAMES)]
    shifted = [about_middle(AHEAD**k, TURN_DEG * k, DISPARITY_PX) for k in range(FRAMES)]
    pairs = [
        (warped(source, L, 10 + k), warped(source, R, 50 + k))
        for k, (L, R) in enumerate(zip(ways, shifted, strict=True))
    ]
    tracks = follow(pairs)
    on_wall = np.empty((len(tracks), 2))
    for k, M in enumerate(ways):
        rows = tracks.frame == k
        on_wall[rows] = moved(
            np.asarray(cv2.invertAffineTransform(M), np.float64), tracks.pixels[rows, :2]
        )
    off: list[float] = []
    ages: list[int] = []
    for id in np.unique(tracks.id):
        rows = np.nonzero(tracks.id == id)[0]
        way = np.linalg.norm(on_wall[rows] - on_wall[rows[0]], axis=1)
        off += (way * AHEAD ** tracks.frame[rows]).tolist()  # as it looks in that frame
        ages += range(len(rows))
    by_age = np.array(off), np.array(ages)
    young, old = (by_age[0][(by_age[1] >= a) & (by_age[1] <= b)] for a, b in ((1, 1), (8, FRAMES)))
    assert min(len(young), len(old)) > 30
    return float(np.median(young)), float(np.median(old))


def test_tracks_do_not_wander_from_the_point_of_their_birth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for follow in (followed_in, by_opencv):
        young, old = wander_px(follow)
        assert old < 0.1
        assert young < 0.1
    monkeypatch.setattr(
        patches,
        "find",
        lambda _, births, points, __: patches.Refined(points, births, np.ones(len(points))),
    )
    assert wander_px(by_opencv)[1] > 2 * old
