# SPDX-License-Identifier: MIT
"""The simulator: exact truth, noise as asked for, ids as told, the same bytes for a seed."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Run, messages_of
from drives import PERFECT
from pelorus.errors import PelorusError
from pelorus.io.tracks import project
from pelorus.math import motion, se3
from pelorus.simulate import drive, sensors
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.simulate import Options, Simulation, simulate
from pelorus.wire import framing
from pelorus.wire.frames import Header, Kind, Landmark, Role, Stereo, TwistTiming
from pelorus.wire.layout import Floats
from scipy.linalg import expm


def exact_pixels(simulation: Simulation) -> Floats:
    """Where each observation's landmark truly is, found by its id (which is its number)."""
    recording = simulation.recording
    tracks = recording.tracks
    at = np.searchsorted(recording.truth_t_ns, recording.frame_t_ns)[tracks.frame]
    T_CW = se3.compose(sensors.T_CB, se3.inverse(recording.truth.at(at)))
    q = se3.apply(T_CW, simulation.points_W[tracks.id])
    return project(recording.header.camera, q)


@pytest.mark.parametrize("timing", list(TwistTiming))
@pytest.mark.parametrize("twist_rate", [10.0, 70.0])
def test_truth_is_the_exact_integral_of_the_perfect_twists(
    timing: TwistTiming, twist_rate: float
) -> None:
    recording = simulate(replace(PERFECT, twist_timing=timing, twist_rate_hz=twist_rate)).recording
    path = recording.dead_reckoning()
    first = recording.truth.at(0)
    expected = se3.compose(se3.inverse(first), recording.truth)
    assert np.abs(path.p - expected.p).max() < 1e-10
    assert np.abs(path.R - expected.R).max() < 1e-11
    assert np.linalg.norm(expected.p[-1]) > 5
    eye = recording.truth.R @ np.swapaxes(recording.truth.R, 1, 2)
    assert np.abs(eye - np.eye(3)).max() < 1e-12


def test_the_power_series_is_the_matrix_exponential() -> None:
    chance = np.random.default_rng(1)
    rho, theta = chance.normal(size=(20, 3)), chance.uniform(-0.57, 0.57, (20, 3))
    found = drive.exp(rho, theta)
    for k in range(20):
        generator = np.zeros((4, 4))
        generator[:3, :3], generator[:3, 3] = se3.skew(theta[k]), rho[k]
        expected = expm(generator)
        assert np.allclose(found.R[k], expected[:3, :3], atol=1e-15)
        assert np.allclose(found.p[k], expected[:3, 3], atol=1e-14)
    with pytest.raises(ValueError, match="rad"):
        drive.exp(np.zeros((1, 3)), np.array([[2.0, 0, 0]]))


def test_perfect_pixels_are_the_projection_of_the_landmarks_within_the_image() -> None:
    simulation = simulate(replace(PERFECT, keep_ids=True, observations=200))
    pixels = simulation.recording.tracks.pixels
    assert np.abs(pixels - exact_pixels(simulation)).max() < 1e-9
    u, v = pixels[:, [0, 2]], pixels[:, [1, 3]]
    assert (u >= 0).all()
    assert (u < 640).all()
    assert (v >= 0).all()
    assert (v < 480).all()
    assert (pixels[:, 0] > pixels[:, 2]).all()
    depth = 420 * 0.2 / (pixels[:, 0] - pixels[:, 2])
    assert depth.min() > sensors.DEPTH_MIN_M
    assert depth.max() < 30.0


def test_noise_and_biases_have_the_size_asked_for() -> None:
    options = replace(
        PERFECT,
        duration_s=100.0,
        pixel_sigma_px=0.7,
        velocity_sigma_mps=0.3,
        gyro_sigma_radps=0.02,
        bias_velocity_sigma_mps=0.5,
        bias_gyro_sigma_radps=0.01,
        keep_ids=True,
    )
    noisy, perfect = simulate(options), simulate(replace(PERFECT, duration_s=100.0))
    pixels = noisy.recording.tracks.pixels - exact_pixels(noisy)
    assert pixels.std() == pytest.approx(0.7, rel=0.01)
    assert abs(pixels.mean()) < 0.01
    assert abs(np.corrcoef(pixels.T) - np.eye(4)).max() < 0.03
    v = noisy.recording.v_B_mps - perfect.recording.v_B_mps - noisy.bias_velocity_mps
    w = noisy.recording.w_B_radps - perfect.recording.w_B_radps - noisy.bias_gyro_radps
    assert v.std() == pytest.approx(0.3, rel=0.02)
    assert w.std() == pytest.approx(0.02, rel=0.02)
    assert abs(np.corrcoef(v[1:].ravel(), v[:-1].ravel())[0, 1]) < 0.03, "readings are white"
    assert (noisy.bias_velocity_mps == noisy.bias_velocity_mps[0]).all(), "no walk was asked for"
    drawn = np.array([simulate_biases(seed) for seed in range(200)])
    assert drawn[:, :3].std() == pytest.approx(0.5, rel=0.15)
    assert drawn[:, 3:].std() == pytest.approx(0.01, rel=0.15)


def simulate_biases(seed: int) -> Floats:
    options = replace(
        PERFECT,
        seed=seed,
        duration_s=0.1,
        landmarks=1,
        bias_velocity_sigma_mps=0.5,
        bias_gyro_sigma_radps=0.01,
    )
    found = simulate(options)
    return np.concatenate((found.bias_velocity_mps[0], found.bias_gyro_radps[0]))


def test_biases_walk_with_the_variance_a_second_asked_for() -> None:
    options = replace(
        PERFECT, duration_s=400.0, landmarks=1, bias_velocity_walk=0.01, bias_gyro_walk=1e-4
    )
    found = simulate(options)
    for bias, walk in ((found.bias_velocity_mps, 0.01), (found.bias_gyro_radps, 1e-4)):
        assert (bias[0] == 0).all()
        seconds = np.diff(bias[::100], axis=0)  # 100 twists are a second
        assert seconds.var() == pytest.approx(walk, rel=0.15)


def test_outliers_and_dropped_frames_come_in_the_fraction_asked_for() -> None:
    options = replace(PERFECT, duration_s=100.0, keep_ids=True, outliers=0.1, drop=0.2)
    found = simulate(options)
    recording = found.recording
    off = np.abs(recording.tracks.pixels - exact_pixels(found)).max(axis=1)
    assert found.outlier.mean() == pytest.approx(0.1, abs=0.01)
    assert off[~found.outlier].max() < 1e-9
    assert np.median(off[found.outlier]) > 50
    assert len(recording.frame_t_ns) == pytest.approx(0.8 * 1001, abs=50)
    assert len(recording.truth_t_ns) == 1001, "the truth goes on"
    assert len(recording.twist_t_ns) == 10001


def test_an_id_lasts_while_its_landmark_is_seen_and_never_comes_back() -> None:
    fresh = simulate(replace(PERFECT, duration_s=60.0, loss=0.05)).recording.tracks
    for id in np.unique(fresh.id):
        frames = fresh.frame[fresh.id == id]
        assert (np.diff(frames) == 1).all(), "a broken track has a new id"
    kept = simulate(replace(PERFECT, duration_s=60.0, loss=0.05, keep_ids=True)).recording.tracks
    assert kept.id.max() < 800
    assert len(np.unique(fresh.id)) > 2 * len(np.unique(kept.id))
    gaps = [np.diff(kept.frame[kept.id == id]).max(initial=1) for id in np.unique(kept.id)]
    assert max(gaps) > 50, "a second lap closes the loop"
    assert kept.counts().max() == 60


def test_known_landmarks_are_those_that_are_seen(tmp_path: Path, pelorus: Run) -> None:
    target = tmp_path / "known.plr"
    pelorus("simulate", target, "--known", "--duration", 5, "--known-sigma", 0.2)
    known = messages_of(target, Landmark)
    assert [m.id for m in known] == list(range(800))
    assert all(m.role is Role.KNOWN for m in known)
    assert np.allclose(known[0].covariance, [0.04, 0, 0.04, 0, 0, 0.04])
    simulation = simulate(Options(known=True, duration_s=5.0, known_sigma_m=0.2))
    assert np.array_equal([m.p_W_m for m in known], simulation.points_W)
    assert max(int(m.ids.max()) for m in messages_of(target, Stereo)) < 800


def test_changing_one_source_of_chance_leaves_the_others() -> None:
    plain = simulate(replace(PERFECT, keep_ids=True, velocity_sigma_mps=0.1))
    other = simulate(replace(PERFECT, keep_ids=True, velocity_sigma_mps=0.1, pixel_sigma_px=3.0))
    assert np.array_equal(plain.recording.v_B_mps, other.recording.v_B_mps)
    assert np.array_equal(plain.points_W, other.points_W)
    assert np.array_equal(plain.recording.tracks.id, other.recording.tracks.id)


def test_a_seed_gives_the_same_bytes_and_another_seed_others(tmp_path: Path, pelorus: Run) -> None:
    digests = []
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        target = tmp_path / f"{name}.plr"
        pelorus("simulate", target, "--duration", 3, "--seed", seed)
        digests.append(hashlib.sha256(target.read_bytes()).hexdigest())
    assert digests[0] == digests[1] != digests[2]


def test_the_header_tells_the_noise_that_there_is(tmp_path: Path, pelorus: Run) -> None:
    target = tmp_path / "x.plr"
    options = ("--duration", 2, "--pixel-sigma", 0.3, "--gyro-sigma", 0, "--twist-timing", "mid")
    pelorus("simulate", target, *options)
    header = messages_of(target, Header)[0]
    assert header.noise.pixel_sigma_px == 0.3
    assert header.noise.gyro_sigma_radps < 0, "no noise is no suggestion"
    assert header.twist_timing is TwistTiming.MID
    assert (header.image_width_px, header.image_height_px) == sensors.IMAGE_PX


def test_frames_of_a_slow_camera_stand_later_in_the_file(tmp_path: Path, pelorus: Run) -> None:
    target = tmp_path / "slow.plr"
    pelorus("simulate", target, "--duration", 3, "--camera-delay", 0.055)
    received, _ = framing.read_file(target)
    latest = 0
    delays = []
    for frame in received:
        message = frame.message
        if message.kind == Kind.TWIST:
            latest = message.t_ns  # type: ignore[attr-defined]
        elif isinstance(message, Stereo) and latest < 2_900_000_000:
            delays.append(latest - message.t_ns)
    assert set(delays) == {50_000_000}  # the last twist before 55 ms have passed


@pytest.mark.parametrize("timing", list(TwistTiming))
@pytest.mark.parametrize("lead_ns", [1, 416, 1_000_000])
def test_frames_stand_so_much_before_a_twist_with_the_pose_of_their_time(
    timing: TwistTiming, lead_ns: int
) -> None:
    options = replace(PERFECT, twist_timing=timing, duration_s=5.0)
    there = simulate(options).recording
    before = simulate(replace(options, frame_lead_ns=lead_ns)).recording
    assert before.frame_t_ns[0] == 0
    assert set(there.frame_t_ns[1:] - before.frame_t_ns[1:]) == {lead_ns}
    assert (before.truth_t_ns == before.frame_t_ns).all()
    back = se3.compose(se3.inverse(before.truth), there.truth)
    ends = np.searchsorted(there.twist_t_ns, there.frame_t_ns[1:])
    held = motion.held(np.hstack((there.v_B_mps, there.w_B_radps)), timing)[ends - 1]
    assert np.allclose(se3.log(back)[1:], lead_ns * 1e-9 * held, rtol=1e-6, atol=1e-13)


def test_frames_before_the_readings_of_an_imu_stand_on_its_way(
    tmp_path: Path, pelorus: Run
) -> None:
    target = tmp_path / "lead.plr"
    options = ("--imu-rate", 200, "--duration", 4, "--frame-lead", 1_000_000, "--drop", 0)
    pelorus("simulate", target, *options)
    frames = [message.t_ns for message in messages_of(target, Stereo)]
    assert frames[:3] == [0, 99_000_000, 199_000_000]
    drive_of = Options(imu=SimulatedImu(imu_rate_hz=200), duration_s=4)
    there, before = (
        simulate(replace(drive_of, frame_lead_ns=lead)).recording for lead in (0, 1_000_000)
    )
    assert there.truth_velocity is not None
    way = np.linalg.norm(there.truth.p - before.truth.p, axis=1)[1:]
    assert np.allclose(way, 1e-3 * np.linalg.norm(there.truth_velocity, axis=1)[1:], atol=1e-5)


def test_a_lead_of_a_whole_twist_is_refused() -> None:
    with pytest.raises(PelorusError, match="--frame-lead is 10000000: less than from one twist"):
        simulate(replace(PERFECT, twist_rate_hz=100.0, frame_lead_ns=10_000_000))


def test_readings_hold_as_the_timing_says_in_the_profile() -> None:
    t_ns = np.arange(0, 2_000_000_001, 100_000_000)
    way = drive.drive(t_ns, TwistTiming.MID, 2.0, 30.0)
    steps = motion.steps(t_ns, way.v_B_mps, way.w_B_radps, TwistTiming.MID)
    again = se3.compose(way.poses.at(slice(None, -1)), steps)
    assert np.allclose(again.p, way.poses.p[1:])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"duration_s": 0.0}, "--duration is 0.0: a positive number"),
        ({"twist_rate_hz": 25.0}, "--twist-rate is 25.0: a whole multiple"),
        ({"twist_rate_hz": 5.0}, "--twist-rate"),
        ({"outliers": 1.0}, "--outliers is 1.0: a fraction"),
        ({"pixel_sigma_px": -1.0}, "--pixel-sigma is -1.0"),
        ({"gyro_sigma_radps": float("nan")}, "--gyro-sigma is nan"),
        ({"landmarks": 0}, "--landmarks is 0"),
        ({"observations": 5000}, "--observations is 5000"),
        ({"duration_s": 1e9}, "at most 1000000 frames"),
        ({"lap_s": 0.001}, "--lap is 0.001"),
        ({"seed": -1}, "--seed is -1"),
    ],
)
def test_options_that_make_no_sense_are_refused_by_name(
    changes: dict[str, float], said: str
) -> None:
    with pytest.raises(PelorusError, match=said):
        simulate(replace(Options(), **changes))  # type: ignore[arg-type]
