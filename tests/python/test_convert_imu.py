# SPDX-License-Identifier: MIT
"""convert imu-npz: what arrives, what is drawn anew, what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Converted, Run, messages_of
from imu_drives import calib, noisy, npz_arrays, written
from pelorus.converters import imu_npz, renewal
from pelorus.converters.imu_npz import START_SIGMAS, Choices
from pelorus.evaluate import evaluation
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks, project
from pelorus.math import se3
from pelorus.wire.frames import (
    Header,
    Imu,
    Process,
    Start,
    StartFlag,
    Stereo,
    Text,
    Truth,
    TruthKnows,
)
from pelorus.wire.layout import Floats, unpack_symmetric


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return written(tmp_path / "drive.npz", npz_arrays(noisy()))


def convert(source: Path, **choices: Any) -> Recording:
    return imu_npz.convert(source, Choices(**choices))[0]


def test_everything_of_the_file_arrives(tmp_path: Path, source: Path, pelorus: Run) -> None:
    target = tmp_path / "drive.plr"
    pelorus("convert", "imu-npz", source, target, "--keep-ids")
    drive = noisy().recording
    header = messages_of(target, Header)[0]
    assert header.process is Process.IMU
    assert np.allclose(header.R_CB, drive.T_CB.R)
    assert np.allclose(header.t_CB_m, drive.T_CB.p)
    noise = header.noise
    told = (noise.gyro_noise, noise.accel_noise, noise.gyro_walk, noise.accel_walk, noise.gravity)
    assert told == (1e-3, 1e-2, 1e-4, 1e-3, 9.81)
    assert noise.pixel_sigma_px == 1.0
    batches = messages_of(target, Imu)
    assert [t for m in batches for t in m.times_ns] == drive.inertial.t_ns.tolist()
    a = np.concatenate([m.a_B_mps2 for m in batches])
    w = np.concatenate([m.w_B_radps for m in batches])
    assert np.array_equal(a, drive.inertial.a_B_mps2.astype(np.float32))
    assert np.array_equal(w, drive.inertial.w_B_radps.astype(np.float32))
    stereos = messages_of(target, Stereo)
    assert [m.t_ns for m in stereos] == drive.frame_t_ns.tolist()
    assert np.array_equal(np.concatenate([m.ids for m in stereos]), drive.tracks.id)
    pixels = np.concatenate([m.pixels for m in stereos])
    assert np.array_equal(pixels, drive.tracks.pixels.astype(np.float32))
    truths = messages_of(target, Truth)
    assert drive.truth_velocity is not None
    assert drive.truth_bias is not None
    assert np.allclose([m.R_WB for m in truths], drive.truth.R)
    assert np.allclose([m.p_WB_m for m in truths], drive.truth.p)
    assert np.allclose([m.velocity for m in truths], drive.truth_velocity)
    assert np.allclose([m.bias for m in truths], drive.truth_bias)
    assert all(m.knows == TruthKnows.VELOCITY | TruthKnows.BIAS for m in truths)


def test_start_is_the_state_of_init_with_the_sigmas_asked_for(
    tmp_path: Path, source: Path, pelorus: Run
) -> None:
    target = tmp_path / "drive.plr"
    pelorus("convert", "imu-npz", source, target, "--start-sigmas", "0.1,0.2,0.3,0.4,0.5")
    start, drive = messages_of(target, Start)[0], noisy().recording
    assert start.t_ns == drive.inertial.t_ns[0]
    assert np.allclose(start.R_WB, drive.truth.R[0])
    assert np.allclose(start.p_WB_m, drive.truth.p[0])
    assert drive.truth_velocity is not None
    assert drive.truth_bias is not None
    assert np.allclose(start.velocity, drive.truth_velocity[0]), "in body axes"
    assert np.allclose(start.bias_mean, drive.truth_bias[0]), "the accelerometer's first"
    assert start.flags == StartFlag.COVARIANCE | StartFlag.BIAS_PRIOR
    P = unpack_symmetric(start.covariance[None], 6)[0]
    assert np.allclose(P, np.diag([0.01] * 3 + [0.04] * 3))
    assert np.allclose(start.velocity_variance, 0.09)
    assert np.allclose(start.bias_variance, [0.16] * 3 + [0.25] * 3)


def test_readings_before_the_start_are_left_out(tmp_path: Path) -> None:
    arrays = npz_arrays(noisy())
    k = 20  # frame of the new start, which stands a little beside a reading
    arrays["init"] = np.concatenate(
        (arrays["truth_t"][k : k + 1] + 3e-7, arrays["truth"][k], arrays["bias"][k])
    )
    found = convert(written(tmp_path / "late.npz", arrays))
    frame_t_ns = noisy().recording.frame_t_ns
    assert found.start is not None
    assert found.start.t_ns == frame_t_ns[k], "a stamp that is rounded is that of the reading"
    assert found.inertial.t_ns[0] == found.start.t_ns
    assert np.array_equal(found.frame_t_ns, frame_t_ns[k:])


def runs(tracks: Tracks, id: int) -> int:
    return int((np.diff(tracks.frame[tracks.id == id]) > 1).sum()) + 1


def test_an_id_is_new_after_a_frames_absence(source: Path) -> None:
    kept, fresh = convert(source, keep_ids=True).tracks, convert(source).tracks
    assert max(runs(kept, id) for id in np.unique(kept.id)) > 1, "some come back"
    assert all(runs(fresh, id) == 1 for id in np.unique(fresh.id))
    assert len(np.unique(fresh.id)) == sum(runs(kept, id) for id in np.unique(kept.id))
    assert sorted(np.unique(fresh.id)) == list(range(len(np.unique(fresh.id))))
    begins = [fresh.frame[fresh.id == id][0] for id in np.unique(fresh.id)]
    assert (np.diff(begins) >= 0).all(), "ids count up as tracks begin"
    whole = {tuple(row) for row in kept.pixels.tolist()}
    assert {tuple(row) for row in fresh.pixels.tolist()} == whole


def exact_pixels(recording: Recording) -> Floats:
    """Where the simulator's landmarks truly are seen, by their own ids."""
    drive = noisy()
    T_CW = se3.compose(recording.T_CB, se3.inverse(recording.truth.at(recording.tracks.frame)))
    q = se3.apply(T_CW, drive.points_W[recording.tracks.id])
    return project(recording.header.camera, q)


def test_a_seed_draws_noise_of_the_size_told_on_landmarks_that_stay(source: Path) -> None:
    old = convert(source, keep_ids=True)
    one, two = (convert(source, keep_ids=True, seed=seed) for seed in (1, 2))
    noise = [r.tracks.pixels - exact_pixels(r) for r in (old, one, two)]
    often = np.bincount(old.tracks.id)[old.tracks.id] > 30  # whose place is known well
    for part in noise[1:]:
        assert part[often].std() == pytest.approx(1.0, rel=0.05)
        assert abs(np.corrcoef(part[often].T) - np.eye(4)).max() < 0.1
    for a, b in ((0, 1), (0, 2), (1, 2)):
        shared = np.corrcoef(noise[a][often].ravel(), noise[b][often].ravel())[0, 1]
        assert abs(shared) < 0.1, "a draw has nothing of another"
    again = convert(source, keep_ids=True, seed=1)
    assert np.array_equal(again.tracks.pixels, one.tracks.pixels)


def test_a_seed_gives_the_same_tracks_other_ids(source: Path) -> None:
    plain, drawn = convert(source).tracks, convert(source, seed=3).tracks
    assert np.array_equal(plain.counts(), drawn.counts())
    assert sorted(np.unique(drawn.id)) == sorted(np.unique(plain.id))
    assert sorted(np.bincount(drawn.id)) == sorted(np.bincount(plain.id)), "tracks as long"
    begins = [drawn.frame[drawn.id == id][0] for id in np.unique(drawn.id)]
    assert (np.diff(begins) < 0).any(), "not in the order of beginning"


def test_a_seed_says_what_it_did(tmp_path: Path, source: Path, pelorus: Run) -> None:
    target = tmp_path / "drawn.plr"
    said = pelorus("convert", "imu-npz", source, target, "--seed", 1)
    assert "drawn anew" in said.out
    assert any("drawn anew" in m.text for m in messages_of(target, Text))


def test_noise_that_is_added_is_told(source: Path) -> None:
    plain, more = convert(source), convert(source, extra_sigma_px=2.0)
    added = more.tracks.pixels - plain.tracks.pixels
    assert added.std() == pytest.approx(2.0, rel=0.05)
    assert more.header.noise.pixel_sigma_px == pytest.approx(np.sqrt(5))


def test_tracks_of_no_fixed_points_cannot_be_drawn_anew(tmp_path: Path, pelorus: Run) -> None:
    arrays = npz_arrays(noisy())
    chance, id = np.random.default_rng(1), arrays["stereo_id"]
    for t in np.unique(arrays["stereo_t"]):  # every id is everywhere
        rows = arrays["stereo_t"] == t
        id[rows] = chance.permutation(id[rows])
    bad = written(tmp_path / "bad.npz", arrays)
    target = tmp_path / "out.plr"
    pelorus("convert", "imu-npz", bad, target)
    target.unlink()
    said = pelorus("convert", "imu-npz", bad, target, "--seed", 1, status=1)
    assert "not those of points that stand still" in said.err
    assert not target.exists()


def test_a_frame_without_truth_cannot_be_drawn_anew(tmp_path: Path, pelorus: Run) -> None:
    arrays = npz_arrays(noisy())
    for key in ("truth", "truth_t", "bias", "bias_t"):
        arrays[key] = arrays[key][::2]
    bad = written(tmp_path / "half.npz", arrays)
    said = pelorus("convert", "imu-npz", bad, tmp_path / "out.plr", "--seed", 1, status=1)
    assert "30 frames have no truth of their time" in said.err


def test_the_readings_are_held_against_the_truth(tmp_path: Path, source: Path) -> None:
    fits = imu_npz.convert(source, Choices())[1][0]
    assert not fits.found
    arrays = npz_arrays(noisy())
    chance = np.random.default_rng(1)
    arrays["imu"] = (
        arrays["imu"]
        + chance.normal(0, 0.6, arrays["imu"].shape) * [0] * 3
        + (chance.normal(0, 0.6, arrays["imu"].shape) * [0, 0, 0, 1, 1, 1])
    )
    wild = imu_npz.convert(written(tmp_path / "wild.npz", arrays), Choices())[1][0]
    assert wild.found
    # 1e-2 sqrt(200) m/s^2 there were, and 0.6 more
    assert f"accelerometer by {np.hypot(0.1414, 0.6) / 0.1414:.0f}" in wild.evidence[:110]


BAD = [
    ({"imu": None}, "lacks the array imu"),
    ({"imu": np.zeros((7, 6))}, "imu has the shape (7, 6)"),
    ({"imu_t": lambda x: x[::-1]}, "imu_t does not ascend"),
    ({"imu_t": lambda x: x * 1e12}, "imu_t spans"),
    ({"imu": lambda x: np.where(np.arange(6) == 2, np.nan, x)}, "imu[0, 2]: is not finite"),
    ({"stereo_t": lambda x: x[::-1]}, "stereo_t goes back"),
    ({"stereo_t": np.empty(0)}, "no observation"),
    ({"stereo_id": lambda x: x * 0.0 - 1}, "stereo_id is -1"),
    ({"stereo_id": lambda x: x * 0}, "id 0 stands twice in the frame of 0.000000 s"),
    ({"stereo_px": lambda x: x[:, :3]}, "stereo_px has the shape"),
    ({"stereo_px": lambda x: x * np.inf}, "stereo_px"),
    ({"truth": lambda x: x * 2}, "truth row 0: the quaternion's norm is 2.0000"),
    ({"truth_t": lambda x: x[:-1]}, "truth has the shape"),
    ({"init": np.zeros(16)}, "init has the shape (16,)"),
    ({"init": np.zeros(17)}, "init row 0: the quaternion's norm is 0.0000"),
    ({"init": lambda x: x + 99 * (np.arange(17) == 0)}, "init is of 99.0"),
    ({"calib": np.array("{")}, "is no JSON"),
    ({"calib": np.zeros(3)}, "calib is 3 of type float64"),
    ({"calib": {"fx": None}}, "calib: lacks fx"),
    ({"calib": {"fx": "wide"}}, "calib: fx is 'wide'"),
    ({"calib": {"fx": -1}}, "must be positive"),
    ({"calib": {"T_imu_cam0": [1, 2]}}, "calib: T_imu_cam0 is [1, 2]; 4 x 4 finite numbers"),
    ({"calib": {"T_imu_cam0": np.zeros((4, 4)).tolist()}}, "T_imu_cam0 is no rotation"),
    ({"calib": {"baseline_m": 0.5}}, "that of a rectified pair is expected, baseline_m = 0.5"),
    ({"calib": {"gravity_world": [0, 9.81, 0]}}, "z of the world is up"),
    ({"calib": {"gyro_noise_density": 0}}, "gyro_noise_density is 0; a positive number"),
    ({"calib": {"cam_imu_time_offset_s": 0.01}}, "cam_imu_time_offset_s is 0.01"),
]


@pytest.mark.parametrize(("changes", "said"), BAD, ids=[said[:40] for _, said in BAD])
def test_what_is_wrong_is_refused_by_name(
    tmp_path: Path, pelorus: Run, changes: dict[str, Any], said: str
) -> None:
    arrays = npz_arrays(noisy())
    for key, change in changes.items():
        if change is None:
            del arrays[key]
        elif isinstance(change, dict):
            whole = calib(noisy(), **change)
            left = {name: value for name, value in whole.items() if value is not None}
            arrays[key] = np.array(json.dumps(left))
        else:
            arrays[key] = change(arrays[key]) if callable(change) else change
    source, target = written(tmp_path / "bad.npz", arrays), tmp_path / "out.plr"
    outcome = pelorus("convert", "imu-npz", source, target, status=1)
    assert "bad.npz" in outcome.err
    assert said in " ".join(outcome.err.split())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad.npz"]


@pytest.mark.parametrize("words", ["1", "1,2,3,4,0", "a,b,c,d,e", "1,2,3,4,nan", "1,2,3,4,5,6"])
def test_start_sigmas_are_five_positive_numbers(
    tmp_path: Path, source: Path, pelorus: Run, words: str
) -> None:
    target = tmp_path / "out.plr"
    outcome = pelorus("convert", "imu-npz", source, target, "--start-sigmas", words, status=1)
    assert "--start-sigmas" in outcome.err
    assert not target.exists()
    assert len(START_SIGMAS) == 5


# --- the real recordings --------------------------------------------------------------------------

SIMULATED = ["tum_corridor1-60-seed0", "udel_gore_zupt-60-seed0"]


@pytest.mark.parametrize("name", SIMULATED)
def test_a_simulators_recording_has_the_noise_that_it_tells(
    of_imu: Callable[[str], Converted], name: str
) -> None:
    recording, findings = of_imu(name)
    assert not findings[0].found
    assert "gyro is off by 1.0" in findings[0].evidence
    assert "accelerometer by 1.0" in findings[0].evidence
    t_ns, frame_t_ns = recording.inertial.t_ns, recording.frame_t_ns
    apart = np.abs(t_ns[np.searchsorted(t_ns, frame_t_ns)] - frame_t_ns)
    assert apart.max() > 2_000_000, "frames lie between readings"
    assert len(recording.truth_t_ns) == len(recording.frame_t_ns)


def test_a_second_draw_finds_the_landmarks_of_the_first(real: Callable[[str], Path]) -> None:
    source = real(f"imu/{SIMULATED[0]}.npz")
    recording = convert(source, keep_ids=True, seed=1)
    _, finding = renewal.renew(source, recording, np.random.default_rng(2))
    off = float(finding.evidence.split(" px off")[0].split()[-1])
    assert off == pytest.approx(1.0, abs=0.01)


def test_real_readings_are_noisier_than_their_data_sheet(
    of_imu: Callable[[str], Converted],
) -> None:
    recording, findings = of_imu("euroc-V102-real-imu")
    assert findings[0].found
    assert "accelerometer by 4.3" in findings[0].evidence
    assert recording.header.noise.accel_noise == 0.002, "the HEADER has what calib tells"
    path = evaluation.path_m(recording.truth)
    assert 60 < path < 90
