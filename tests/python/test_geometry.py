# SPDX-License-Identifier: MIT
"""Rigid motions, dead reckoning, the camera, and the motion that images give."""

from __future__ import annotations

import numpy as np
import pytest
from drives import clean
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks, point_jacobian, project, triangulate
from pelorus.math import motion, se3
from pelorus.math.se3 import Poses
from pelorus.tracking import visual_motion
from pelorus.tracking.second_view import linearised, measured, predicted
from pelorus.wire.frames import Camera, Header, Stereo, TwistTiming
from scipy.linalg import expm

CAMERA = Camera(500.0, 480.0, 320.0, 240.0, 0.3)
CHANCE = np.random.default_rng(5)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 0.0099, 0.0101, 0.5, 3.0])
def test_exp_is_the_matrix_exponential_and_log_undoes_it(angle: float) -> None:
    axis = CHANCE.normal(size=3)
    theta = angle * axis / np.linalg.norm(axis)
    rho = CHANCE.normal(size=3)
    generator = np.zeros((4, 4))
    generator[:3, :3], generator[:3, 3] = se3.skew(theta), rho
    expected = expm(generator)
    T = se3.exp(rho, theta)
    assert np.allclose(T.R, expected[:3, :3], atol=1e-14)
    assert np.allclose(T.p, expected[:3, 3], atol=1e-13)
    assert np.allclose(se3.log(T), np.concatenate((rho, theta)), atol=1e-7)


def test_inverse_compose_and_apply_are_those_of_matrices() -> None:
    A = se3.exp(CHANCE.normal(size=(6, 3)), CHANCE.normal(size=(6, 3)))
    B = se3.exp(CHANCE.normal(size=(6, 3)), CHANCE.normal(size=(6, 3)))
    x = CHANCE.normal(size=(6, 3))
    through = se3.apply(se3.compose(A, B), x)
    assert np.allclose(through, se3.apply(A, se3.apply(B, x)))
    assert np.allclose(se3.apply(se3.inverse(A), se3.apply(A, x)), x)


@pytest.mark.parametrize(
    ("timing", "expected"),
    [(TwistTiming.START, [1.0, 2.0]), (TwistTiming.END, [2.0, 4.0]), (TwistTiming.MID, [1.5, 3.0])],
)
def test_timing_says_which_reading_holds(timing: TwistTiming, expected: list[float]) -> None:
    assert motion.held(np.array([[1.0], [2.0], [4.0]]), timing).ravel().tolist() == expected


def test_a_constant_twist_drives_a_circle() -> None:
    t_ns = np.arange(0, 10_000_000_001, 100_000_000)
    v, w = np.tile([2.0, 0, 0], (101, 1)), np.tile([0, 0, 0.5], (101, 1))
    path = motion.dead_reckoning(t_ns, v, w, TwistTiming.START)
    angle = 0.5 * t_ns * 1e-9
    circle = 4.0 * np.stack((np.sin(angle), 1 - np.cos(angle), np.zeros(101)), axis=-1)
    assert np.allclose(path.p, circle, atol=1e-12)


def test_between_readings_the_latest_one_holds_and_before_the_first_the_body_rests() -> None:
    t_ns = np.array([1_000_000_000, 2_000_000_000])
    v, w = np.array([[1.0, 0, 0], [0, 3.0, 0]]), np.zeros((2, 3))
    at = np.array([0, 1_000_000_000, 1_250_000_000, 2_500_000_000])
    path = motion.path_at(at, t_ns, v, w, TwistTiming.START)
    assert np.allclose(path.p[:, 0], [0, 0, 0.25, 1])
    assert np.allclose(path.p[:, 1], [0, 0, 0, 1.5])


def test_triangulation_undoes_projection_whose_jacobian_is_the_difference() -> None:
    q = np.stack((CHANCE.normal(size=50), CHANCE.normal(size=50), CHANCE.uniform(2, 30, 50)), -1)
    pixels = project(CAMERA, q)
    assert np.allclose(triangulate(CAMERA, pixels), q)
    D = point_jacobian(CAMERA, q)
    for column in range(3):
        step3 = np.zeros(3)
        step3[column] = 1e-6
        slope = (project(CAMERA, q + step3) - project(CAMERA, q - step3)) / 2e-6
        assert np.allclose(D[:, :, column], slope, rtol=1e-5, atol=1e-4)


def test_points_of_one_view_stand_where_the_motion_puts_them_in_the_other() -> None:
    """And both derivatives are the differences."""
    q = np.stack((CHANCE.normal(size=50), CHANCE.normal(size=50), CHANCE.uniform(2, 30, 50)), -1)
    T = se3.exp(CHANCE.normal(0, 0.3, (50, 3)), CHANCE.normal(0, 0.1, (50, 3)))
    x = measured(CAMERA, project(CAMERA, q))
    R, p = np.moveaxis(T.R, 0, -1), T.p.T
    h, by_x, by_motion = linearised(CAMERA, x.T, R, p)
    assert np.allclose(h.T, measured(CAMERA, project(CAMERA, se3.apply(T, q))))
    for k, unit in enumerate(1e-4 * np.eye(3)):
        ends = [predicted(CAMERA, x + side * unit, T.R, T.p) for side in (1, -1)]
        assert np.allclose(by_x[:, k].T, (ends[0] - ends[1]) / 2e-4, rtol=1e-5, atol=1e-6)
    for k, unit in enumerate(1e-6 * np.eye(6)):
        moved = [se3.compose(se3.exp(side * unit[:3], side * unit[3:]), T) for side in (1, -1)]
        ends = [predicted(CAMERA, x, *motion) for motion in moved]
        assert np.allclose(by_motion[:, k].T, (ends[0] - ends[1]) / 2e-6, rtol=1e-5, atol=1e-3)


def test_pairs_join_the_same_id_in_frames_k_and_k_plus_lag() -> None:
    frame = np.array([0, 0, 1, 1, 2, 3])
    id = np.array([7, 3, 7, 5, 3, 7])
    tracks = Tracks.from_rows(4, frame, id, np.ones((6, 4)))
    for lag in (1, 2, 3):
        pairs = tracks.pairs(lag)
        ids, later = tracks.id[pairs.first], tracks.frame[pairs.second]
        told = set(zip(pairs.frame.tolist(), ids.tolist(), later.tolist(), strict=True))
        there = set(zip(frame.tolist(), id.tolist(), strict=True))
        assert told == {(k, i, k + lag) for k, i in there if (k + lag, i) in there}


def test_images_alone_give_the_motion_of_the_camera() -> None:
    recording = clean(pixel_sigma_px=0.05, outliers=0.1)
    seen = visual_motion.seen_pairs(recording.tracks, recording.header.camera, 3)
    found = visual_motion.estimate(seen, recording.header.camera)
    T_CW = se3.compose(recording.T_CB, se3.inverse(recording.truth))
    true = se3.compose(T_CW.at(slice(3, None)), se3.inverse(T_CW.at(slice(None, -3))))
    error = np.linalg.norm(se3.log(se3.compose(se3.inverse(Poses(*found)), true)), axis=1)
    assert np.median(error) < 0.01
    assert np.percentile(error, 95) < 0.05


def test_an_observation_keeps_its_own_sigma_when_tracks_are_sorted_cut_and_renumbered() -> None:
    frame, id = np.array([1, 0, 0]), np.array([4, 7, 5])
    tracks = Tracks.from_rows(2, frame, id, np.ones((3, 4)), np.array([0.1, 0.2, 0.3]))
    assert tracks.sigma_px is not None
    assert tracks.sigma_px.tolist() == [0.3, 0.2, 0.1]
    renumbered = tracks.with_ids(np.array([9, 1, 4])).at(np.array([True, True, False]))
    assert renumbered.id.tolist() == [1, 9]
    assert renumbered.sigma_px is not None
    assert renumbered.sigma_px.tolist() == [0.2, 0.3]


def test_a_recording_writes_the_sigmas_of_its_observations() -> None:
    one, none = np.ones(1, np.intp), np.empty(0, np.int64)
    camera = Camera(500, 500, 320, 240, 0.1)
    tracks = Tracks(2, one, one, np.ones((1, 4)), np.array([0.25]))
    empty = np.empty((0, 3))
    drive = Recording(Header(camera), none, empty, empty, np.array([1, 2]), tracks)
    sigmas = [m.sigmas for m in drive.messages() if isinstance(m, Stereo)]
    assert [[] if own is None else own.tolist() for own in sigmas] == [[], [0.25]]
