# SPDX-License-Identifier: MIT
"""`pelorus.Tracker`: the library's eyes from Python."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from pelorus import Calibration, FilterError, PelorusError, Tracker
from pelorus.eyes.front_end import Eyes, Motion, Seen
from pelorus.native import vision
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rig import Rig
from pelorus.tracker import PictureFault
from pelorus.wire.frames import Camera
from scipy.spatial.transform import Rotation

WIDTH, HEIGHT, DISPARITY = 160, 120, 7
CAMERA = Calibration(200.0, 200.0, (WIDTH - 1) / 2, (HEIGHT - 1) / 2, 0.1)
Gray = NDArray[np.uint8]


def wall() -> Gray:
    """Spots of all sizes, wider than a picture."""
    rng = np.random.default_rng(48)
    wide = np.zeros((HEIGHT, 2 * WIDTH))
    for side in (4, 8, 16):
        cells = rng.uniform(-1, 1, (HEIGHT // side + 1, 2 * WIDTH // side + 1))
        wide += np.kron(cells, np.ones((side, side)))[:HEIGHT, : 2 * WIDTH]
    blurred = (wide + np.roll(wide, 1, 0) + np.roll(wide, 1, 1) + np.roll(wide, (1, 1), (0, 1))) / 4
    return np.asarray(np.clip(128 + 40 * blurred, 0, 255), np.uint8)


def pair(shift: int) -> tuple[Gray, Gray]:
    """What the camera sees of it from so many pixels further on."""
    scene = wall()
    return (
        scene[:, shift : shift + WIDTH],
        scene[:, shift + DISPARITY : shift + DISPARITY + WIDTH],
    )


def test_a_wall_that_passes_by_is_followed() -> None:
    tracker = Tracker.rectified(CAMERA, WIDTH, HEIGHT, tracks=30)
    first = tracker.track(1, *pair(0))
    assert len(first.observations) >= 20
    assert np.abs(first.pixels[:, 0] - first.pixels[:, 2] - DISPARITY).max() < 0.2
    second = tracker.track(50_000_000, *pair(2))
    both, a, b = np.intersect1d(first.observations["id"], second.observations["id"], False, True)
    assert len(both) >= 15
    assert np.abs(second.pixels[b] - first.pixels[a] - [-2, 0, -2, 0]).max() < 0.3
    assert (second.sights["id"] == second.observations["id"]).all()
    assert (second.sights["sigma_px"] > 0).all()


def test_rows_may_differ_alike_and_a_few_that_differ_otherwise_are_left_out() -> None:
    left, right = pair(0)
    lower = np.roll(right, 1, 0)
    alike = Tracker.rectified(CAMERA, WIDTH, HEIGHT, tracks=30).track(1, left, lower)
    assert len(alike.observations) >= 20
    assert np.abs(alike.pixels[:, 3] - alike.pixels[:, 1] - 1).max() < 0.5
    right = right.copy()
    right[:, 100:] = lower[:, 100:]
    seen = Tracker.rectified(CAMERA, WIDTH, HEIGHT, tracks=30).track(1, left, right)
    assert len(seen.observations) >= 12
    assert np.abs(seen.pixels[:, 3] - seen.pixels[:, 1]).max() < 0.5
    assert seen.pixels[:, 2].max() < 104


def test_the_virtual_camera_of_a_rectified_pair_is_the_camera_itself() -> None:
    told = Tracker.rectified(CAMERA, WIDTH, HEIGHT).calibration()
    assert (told.fx_px, told.cx_px, told.cy_px) == (200.0, CAMERA.cx_px, CAMERA.cy_px)
    assert told.baseline_m == pytest.approx(0.1)
    assert (np.asarray(told.R_CB) == np.eye(3)).all()


def test_a_repeated_pair_is_said() -> None:
    tracker = Tracker.rectified(CAMERA, WIDTH, HEIGHT)
    first = tracker.track(1, *pair(0))
    again = tracker.track(2, *pair(0))
    assert PictureFault(again.report.left) is PictureFault.REPEATED
    assert (again.observations == first.observations).all()


def test_other_sizes_times_and_kinds_are_refused_with_the_remedy() -> None:
    tracker = Tracker.rectified(CAMERA, WIDTH, HEIGHT)
    left, right = pair(0)
    with pytest.raises(PelorusError, match="convert it to grey"):
        tracker.track(1, np.zeros((HEIGHT, WIDTH, 3), np.uint8), right)
    with pytest.raises(PelorusError, match="keep the upper eight"):
        tracker.track(1, left.astype(np.uint16), right)
    with pytest.raises(FilterError):
        tracker.track(1, left[:, :100], right[:, :100])
    tracker.track(5, left, right)
    with pytest.raises(FilterError):
        tracker.track(5, left, right)


def test_a_lens_that_is_not_followed_as_it_is_is_said() -> None:
    omni = Lens(LensModel.OMNI, (200.0, 200.0, 80.0, 60.0), (1.0,), WIDTH, HEIGHT)
    rig = Tracker.rectified(CAMERA, WIDTH, HEIGHT).rig
    with pytest.raises(PelorusError, match="rectify the pictures first"):
        Tracker(replace(rig, left=omni))


def seen_by(camera: Camera, rig: Rig | None, pairs: list[tuple[Gray, Gray]]) -> list[Seen]:
    """Returns what the front end of the desk tells of them."""
    rows, columns = pairs[0][0].shape
    eyes = Eyes(camera, (columns, rows), rig, corners=30)
    return [eyes.search(50_000_000 * k, *pair, None) for k, pair in enumerate(pairs)]


def passes_by(seen: list[Seen], step_px: float, disparity_px: float, off_px: float) -> None:
    """Asserts that the points of the wall went on by so much, with this disparity."""
    for before, now in pairwise(seen):
        both, a, b = np.intersect1d(before.ids, now.ids, return_indices=True)
        assert len(both) >= 12
        moved = now.pixels[b] - before.pixels[a] - [-step_px, 0, -step_px, 0]
        assert np.median(np.abs(moved)) < off_px
        assert np.median(now.pixels[:, 0] - now.pixels[:, 2]) == pytest.approx(
            disparity_px, abs=off_px
        )


PLAIN = Camera(200.0, 200.0, (WIDTH - 1) / 2, (HEIGHT - 1) / 2, 0.1)


def test_a_lens_that_the_library_does_not_take_is_rectified_at_the_desk() -> None:
    given = Tracker.rectified(CAMERA, WIDTH, HEIGHT).rig
    four = 200.0, 200.0, (WIDTH - 1) / 2, (HEIGHT - 1) / 2
    flat = Lens(LensModel.EUCM, four, (0.0, 1.0), WIDTH, HEIGHT)  # alpha = 0: a pinhole
    odd = replace(given, left=flat, right=flat)
    with pytest.raises(PelorusError, match="rectify the pictures first"):
        Tracker(odd)
    camera = odd.rectification().camera
    seen = seen_by(camera, odd, [pair(0), pair(2), pair(4)])
    zoom = camera.fx_px / 200.0
    passes_by(seen, 2 * zoom, DISPARITY * zoom, 0.2)


def test_pictures_that_are_too_large_are_shrunk_and_their_points_are_told_in_their_pixels(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fits = seen_by(PLAIN, None, [pair(0), pair(2), pair(4)])
    passes_by(fits, 2, DISPARITY, 0.2)
    large = [tuple(np.kron(one, np.ones((2, 2), np.uint8)) for one in pair(k)) for k in (0, 2, 4)]
    less = vision.Limits(WIDTH * HEIGHT, vision.limits().tracks)
    monkeypatch.setattr(vision, "limits", lambda _precision="float32": less)
    twice = Camera(400.0, 400.0, 2 * PLAIN.cx_px + 0.5, 2 * PLAIN.cy_px + 0.5, 0.1)
    seen = seen_by(twice, None, large)  # type: ignore[arg-type]
    for one, small in zip(seen, fits, strict=True):
        assert np.array_equal(one.ids, small.ids)
        assert np.abs(one.pixels - (2 * small.pixels + 0.5)).max() < 1e-3


def test_a_copy_of_a_tracker_goes_on_by_itself() -> None:
    tracker = Tracker.rectified(CAMERA, WIDTH, HEIGHT, tracks=30)
    tracker.track(1, *pair(0))
    other = tracker.copy()
    one = other.track(2, *pair(2))
    assert np.array_equal(tracker.track(2, *pair(2)).observations, one.observations)
    tracker.forget()
    assert other.track(3, *pair(4)).report.followed > tracker.track(3, *pair(4)).report.followed


def followed(shifts: Sequence[int], motions: Sequence[Motion | None]) -> int:
    """Returns how many points are found again where they went, from pair to pair, of a wall that is
    shown from so far on.
    """
    eyes, count = Eyes(PLAIN, (WIDTH, HEIGHT), corners=30), 0
    found = [
        eyes.search(50_000_000 * k, *pair(shift), motion)
        for k, (shift, motion) in enumerate(zip(shifts, motions, strict=True))
    ]
    for (a, b), way in zip(pairwise(found), np.diff(shifts), strict=True):
        _, before, after = np.intersect1d(a.ids, b.ids, return_indices=True)
        went = b.pixels[after, 0] - a.pixels[before, 0]
        count += int((np.abs(went + way) < 0.5).sum())
    return count


def aside(shift: int) -> Motion:
    """Returns how the wall passes a camera that shows it from so many pixels further on."""
    return np.eye(3), np.array([-shift * CAMERA.baseline_m / DISPARITY, 0, 0])


def test_a_motion_that_is_told_wrong_costs_few_points() -> None:
    shifts = [0, 2, 4, 6]
    turn = Rotation.from_rotvec([0, 0.4, 0]).as_matrix()
    alone = followed(shifts, [None] * 4)
    assert alone > 45
    assert followed(shifts, [aside(2)] * 4) > 45
    assert followed(shifts, [(turn, np.ones(3))] * 4) >= 0.8 * alone


def test_a_right_motion_finds_points_that_go_farther_than_they_are_searched_for() -> None:
    shifts = [40, 0, 40, 0]  # neither near the last place nor where they were going
    right = [aside(0), aside(-40), aside(40), aside(-40)]
    assert followed(shifts, [None] * 4) < 10
    assert followed(shifts, right) > 30


def test_a_velocity_is_three_and_three_numbers() -> None:
    tracker = Tracker.rectified(CAMERA, WIDTH, HEIGHT, tracks=30, row_time_s=1e-4)
    with pytest.raises(PelorusError, match="velocity"):
        tracker.track(1, *pair(0), velocity=(np.zeros(2), np.zeros(3)))
    still = tracker.track(1, *pair(0), velocity=(np.zeros(3), np.zeros(3)))
    tracker.forget()
    moving = tracker.track(2, *pair(0), velocity=((1.0, 0, 0), np.zeros(3)))
    depth = CAMERA.fx_px * CAMERA.baseline_m / DISPARITY
    rows = still.pixels[:, 1] - (HEIGHT - 1) / 2
    due = CAMERA.fx_px / depth * 1e-4 * rows
    assert np.abs(moving.pixels[:, 0] - still.pixels[:, 0] - due).max() < 0.05
