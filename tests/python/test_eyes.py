# SPDX-License-Identifier: MIT
"""`pelorus.Tracker`: the library's eyes from Python."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from pelorus import Calibration, FilterError, PelorusError, Tracker
from pelorus.math.se3 import Poses
from pelorus.online import diagnosis
from pelorus.online.eyes import OpenCvEyes, open_eyes
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.read import Calibrated
from pelorus.tracker import PictureFault

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


def test_opencv_takes_cameras_that_own_eyes_cannot_and_it_is_told_with_the_remedy() -> None:
    rig = replace(Tracker.rectified(CAMERA, WIDTH, HEIGHT).rig, T_LB=Poses(np.eye(3), np.zeros(3)))
    header = rig.header(rig.rectification(), "taken as it is")
    eyes, why = open_eyes(Calibrated(header, rig), "own")
    assert not isinstance(eyes, OpenCvEyes)
    assert not why
    assert not diagnosis.of_eyes(why)
    omni = Lens(LensModel.OMNI, (200.0, 200.0, 80.0, 60.0), (1.0,), WIDTH, HEIGHT)
    odd = replace(rig, left=omni, right=omni)
    eyes, why = open_eyes(Calibrated(header, odd), "own")
    assert isinstance(eyes, OpenCvEyes)
    (told,) = diagnosis.of_eyes(why)
    assert told.level is diagnosis.Level.WARN
    assert "a lens omni" in told.message
    assert "rectify the pictures" in told.do
    large = replace(header, image_width_px=4000, image_height_px=3000)
    eyes, why = open_eyes(Calibrated(large, None), "own")
    assert isinstance(eyes, OpenCvEyes)
    assert why
    assert not open_eyes(Calibrated(header, odd), "opencv")[1]  # that is what was asked for


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
