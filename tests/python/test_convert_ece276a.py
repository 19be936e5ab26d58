# SPDX-License-Identifier: MIT
"""The course's .npz: what arrives, what is mended, what is refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import COUNT, SHORT, Run, messages_of
from drives import (
    clean,
    npz_arrays,
    with_camera_position,
    with_stale_tracks,
    with_turned_axes,
)
from pelorus.converters import twist_noise
from pelorus.io.recording import Recording
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.wire.frames import (
    BodyAxes,
    Header,
    Noise,
    Start,
    Stereo,
    Text,
    Truth,
    Twist,
    TwistTiming,
)
from pelorus_course import ece276a


def save_npz(path: Path, recording: Recording, edition: int = 2021, **changes: Any) -> Path:
    arrays = npz_arrays(recording, edition)
    arrays.update(changes)
    np.savez_compressed(path, **{key: value for key, value in arrays.items() if value is not None})
    return path


def camera_poses(recording: Recording) -> Poses:
    """C_k: left camera to the first left camera, as KITTI has them."""
    T_WC = se3.compose(recording.truth, se3.inverse(recording.T_CB))
    return se3.compose(se3.inverse(T_WC.at(0)), T_WC)


def save_kitti(path: Path, poses: Poses) -> Path:
    rows = np.concatenate((poses.R, poses.p[:, :, None]), axis=2).reshape(-1, 12)
    np.savetxt(path, rows, fmt="%.9e")
    return path


@pytest.mark.parametrize("edition", [2019, 2021])
def test_everything_of_an_npz_arrives(tmp_path: Path, pelorus: Run, edition: int) -> None:
    drive = clean(**SHORT)
    source, target = save_npz(tmp_path / "drive.npz", drive, edition), tmp_path / "drive.plr"
    said = pelorus("convert", "ece276a", source, target)
    for subject in ("stale tracks", "twist timing"):
        assert f"{subject}: good" in said.out
    assert "twist noise: cannot tell" in said.out, "61 frames are too few"
    header = messages_of(target, Header)[0]
    assert np.allclose(header.R_CB, drive.T_CB.R)
    assert np.allclose(header.t_CB_m, drive.T_CB.p)
    assert vars(header.camera) == vars(drive.header.camera)
    assert header.body_axes is BodyAxes.FORWARD_LEFT_UP
    assert header.name == "drive"
    assert header.noise.pixel_sigma_px < 0
    assert header.noise.velocity_sigma_mps < 0, "61 frames are too few to tell"
    twists, stereos = messages_of(target, Twist), messages_of(target, Stereo)
    assert np.array_equal([m.v_B_mps for m in twists], drive.v_B_mps)
    assert np.array_equal([m.w_B_radps for m in twists], drive.w_B_radps)
    assert [m.t_ns for m in twists] == [m.t_ns for m in stereos]
    assert abs(stereos[1].t_ns - stereos[0].t_ns - 1e8) < 300  # a double holds 1.3e9 s to 240 ns
    assert np.array_equal(np.concatenate([m.ids for m in stereos]), drive.tracks.id)
    pixels = np.concatenate([m.pixels for m in stereos])
    assert np.array_equal(pixels, drive.tracks.pixels.astype(np.float32))
    assert not messages_of(target, Truth)
    assert not messages_of(target, Start)


def test_bad_matches_stay_in_and_only_absent_ones_are_left_out(tmp_path: Path) -> None:
    drive = clean(**SHORT)
    arrays = npz_arrays(drive)
    features = arrays["features"]
    features[:, 0, 0] = [100.0, 50.0, 100.0, 50.0]  # no disparity
    features[:, 1, 0] = [90.0, 50.0, 120.0, 50.0]  # a negative one
    features[:, 2, 0] = [-1.0, 50.0, -3.0, 50.0]  # one number is -1, not all four
    features[:, 3, 0] = -1.0
    source = save_npz(tmp_path / "x.npz", drive, features=features)
    tracks = ece276a.read(source).tracks
    first = set(tracks.id[tracks.frame == 0].tolist())
    assert {0, 1, 2} <= first
    assert 3 not in first


def test_each_fault_is_mended_whatever_the_keys_are_called(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(2)
    stale, repeated = with_stale_tracks(drive, range(7, 590, 9))
    broken = with_turned_axes(with_camera_position(stale))
    for edition in (2019, 2021):
        source, target = save_npz(tmp_path / "b.npz", broken, edition), tmp_path / "b.plr"
        said = pelorus("convert", "ece276a", source, target, "--force")
        assert said.out.count("FOUND") >= 3
        header = messages_of(target, Header)[0]
        assert np.allclose(header.R_CB, drive.T_CB.R, atol=1e-9)
        assert np.allclose(header.t_CB_m, drive.T_CB.p, atol=1e-9)
        assert header.body_axes is BodyAxes.FORWARD_LEFT_UP
        ids = np.concatenate([m.ids for m in messages_of(target, Stereo)])
        assert len(np.unique(ids)) == len(np.unique(drive.tracks.id)) + repeated
        told = [text.text for text in messages_of(target, Text)]
        assert any("tracks split" in text for text in told), "the recording says what was done"


def test_fix_none_leaves_the_file_as_it_is(tmp_path: Path, pelorus: Run) -> None:
    stale, _ = with_stale_tracks(clean(2), range(7, 590, 9))
    broken = with_turned_axes(with_camera_position(stale))
    source, target = save_npz(tmp_path / "b.npz", broken), tmp_path / "b.plr"
    arguments = ("--fix", "none", "--twist-timing", "mid")
    pelorus("convert", "ece276a", source, target, *arguments)
    header = messages_of(target, Header)[0]
    assert np.allclose(header.R_CB, broken.T_CB.R)
    assert np.allclose(header.t_CB_m, broken.T_CB.p)
    assert header.twist_timing is TwistTiming.MID
    ids = np.concatenate([m.ids for m in messages_of(target, Stereo)])
    assert np.array_equal(ids, broken.tracks.id)


NOISY = {"velocity_sigma_mps": 0.5, "gyro_sigma_radps": 0.05}


def untold(seed: int, **changes: Any) -> Recording:
    """A drive whose header says nothing of noise."""
    return clean(seed, **changes).with_header(noise=Noise())


@pytest.mark.parametrize("timing", [TwistTiming.START, TwistTiming.END, TwistTiming.MID])
@pytest.mark.parametrize("rate_hz", [10.0, 40.0])
def test_the_noise_of_the_twists_is_measured_and_biases_are_not_taken_for_it(
    timing: TwistTiming, rate_hz: float
) -> None:
    biases = {"bias_velocity_sigma_mps": 2.0, "bias_gyro_sigma_radps": 0.1}
    drive = untold(3, **NOISY, **biases, twist_timing=timing, twist_rate_hz=rate_hz)
    recording, finding = twist_noise.suggest(drive)
    assert finding.measured
    noise = recording.header.noise
    assert noise.velocity_sigma_mps == pytest.approx(0.5, rel=0.15)
    assert noise.gyro_sigma_radps == pytest.approx(0.05, rel=0.15)
    measured = ("velocity_sigma_mps", "gyro_sigma_radps")
    assert all(sigma < 0 for name, sigma in vars(noise).items() if name not in measured)


def test_what_the_images_cannot_tell_is_not_suggested() -> None:
    quiet = {"velocity_sigma_mps": 0.001, "gyro_sigma_radps": 0.0002}
    recording, finding = twist_noise.suggest(untold(3, **quiet))
    assert not finding.measured
    assert "no suggestion" in finding.action
    assert vars(recording.header.noise) == vars(Noise())
    noise = twist_noise.suggest(untold(3, **(quiet | {"gyro_sigma_radps": 0.05})))[0].header.noise
    assert noise.velocity_sigma_mps < 0
    assert noise.gyro_sigma_radps == pytest.approx(0.05, rel=0.15)


def test_a_sigma_that_is_given_stays() -> None:
    drive = untold(3, **NOISY).with_header(noise=Noise(velocity_sigma_mps=0.2))
    noise = twist_noise.suggest(drive)[0].header.noise
    assert noise.velocity_sigma_mps == 0.2
    assert noise.gyro_sigma_radps == pytest.approx(0.05, rel=0.15)


def test_the_header_suggests_the_noise_and_convert_says_so(tmp_path: Path, pelorus: Run) -> None:
    source = save_npz(tmp_path / "n.npz", with_camera_position(clean(3, **NOISY)))
    target = tmp_path / "n.plr"
    said = pelorus("convert", "ece276a", source, target)
    assert "the HEADER suggests velocity-sigma 0." in " ".join(said.out.split())
    noise = messages_of(target, Header)[0].noise
    assert noise.velocity_sigma_mps == pytest.approx(0.5, rel=0.15)
    assert noise.gyro_sigma_radps == pytest.approx(0.05, rel=0.15)
    assert any(text.text.startswith("twist noise") for text in messages_of(target, Text))
    pelorus("convert", "ece276a", source, target, "--fix", "none", "--force")
    assert messages_of(target, Header)[0].noise.velocity_sigma_mps < 0


def test_kitti_truth_comes_to_the_body_through_the_mended_extrinsic(
    tmp_path: Path, pelorus: Run
) -> None:
    drive = clean(1)
    poses = camera_poses(drive)
    truth = save_kitti(tmp_path / "poses.txt", poses.at(slice(0, 500)))  # fewer than frames
    source = save_npz(tmp_path / "a.npz", with_camera_position(drive))
    target = tmp_path / "a.plr"
    pelorus("convert", "ece276a", source, target, "--truth", truth)
    written, frames = messages_of(target, Truth), messages_of(target, Stereo)
    assert [m.t_ns for m in written] == [m.t_ns for m in frames[:500]]
    expected = se3.compose(se3.inverse(drive.truth.at(0)), drive.truth)
    assert np.allclose([m.p_WB_m for m in written], expected.p[:500], atol=1e-6)
    assert np.allclose([m.R_WB for m in written], expected.R[:500], atol=1e-7)


def changed(key: str, value: Any) -> dict[str, Any]:
    return {key: value}


def spoiled(key: str, at: tuple[int, ...], value: float) -> dict[str, Any]:
    array = np.array(npz_arrays(clean(**SHORT))[key], float)
    array[at] = value
    return {key: array}


BAD_NPZ = [
    (changed("features", None), "lacks the array features"),
    (changed("K", None), "lacks the array K; there are: angular_velocity"),
    (changed("imu_T_cam", None), "cam_T_imu or imu_T_cam"),
    (changed("angular_velocity", None), "angular_velocity or rotational_velocity"),
    (changed("features", np.zeros((3, 5, COUNT))), r"features has the shape \(3, 5, 61\)"),
    (changed("features", np.full((4, 5, COUNT), -1.0)), "holds no observation"),
    (changed("features", np.zeros((4, 5, COUNT - 1))), "4 x n x 61 is expected"),
    (changed("features", np.zeros((4, 5000, COUNT))), "5000 observations.*at most 4096"),
    (changed("linear_velocity", np.zeros((3, 7))), "3 x 61 is expected"),
    (changed("linear_velocity", np.full((3, COUNT), "fast")), "holds no numbers"),
    (changed("time_stamps", np.zeros((1, 0))), "time_stamps is empty"),
    (changed("time_stamps", np.ones((1, COUNT))), "does not ascend at 1"),
    (changed("time_stamps", 1e18 + np.arange(COUNT)[None] * 1e8), "seconds from 0"),
    (changed("b", np.array(0.0)), "baseline 0.0 m must be positive"),
    (changed("b", np.array([0.5, 0.6])), "one number is expected"),
    (changed("K", np.eye(4)), r"K has the shape \(4, 4\)"),
    (changed("imu_T_cam", np.diag([1.0, 1, 2, 1])), "is no rotation"),
    (changed("imu_T_cam", np.diag([1.0, 1, -1, 1])), "is no rotation"),
    (changed("imu_T_cam", np.eye(4) + np.eye(4, k=-3)), "last row of imu_T_cam"),
    (spoiled("linear_velocity", (1, 7), np.nan), r"linear_velocity\[1, 7\]: is not finite"),
    (spoiled("features", (2, 0, 3), np.inf), "is not finite"),
]


@pytest.mark.parametrize(("changes", "said"), BAD_NPZ, ids=[said[:30] for _, said in BAD_NPZ])
def test_a_misshapen_npz_is_refused_with_its_name_and_the_cause(
    tmp_path: Path, pelorus: Run, changes: dict[str, Any], said: str
) -> None:
    source = save_npz(tmp_path / "bad.npz", clean(**SHORT), **changes)
    outcome = pelorus("convert", "ece276a", source, tmp_path / "out.plr", status=1)
    assert "bad.npz" in outcome.err
    assert re.search(said, outcome.err), outcome.err
    assert list(tmp_path.glob("out*")) == []


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut short", b"no archive at all"])
@pytest.mark.parametrize("command", ["ece276a", "starry-night", "klt"])
def test_a_file_that_is_none_is_refused(
    tmp_path: Path, pelorus: Run, content: bytes, command: str
) -> None:
    source = tmp_path / "bad.file"
    source.write_bytes(content)
    outcome = pelorus("convert", command, source, tmp_path / "out.plr", status=1)
    assert "bad.file" in outcome.err
    pelorus("convert", command, tmp_path / "no.file", tmp_path / "out.plr", status=1)


def test_a_recording_is_no_npz_and_nobody_is_told_to_unpickle_it(
    tmp_path: Path, pelorus: Run
) -> None:
    source = tmp_path / "drive.plr"
    source.write_bytes(b"\x00\x12 something else")
    outcome = pelorus("convert", "ece276a", source, tmp_path / "out.plr", status=1)
    assert "drive.plr: is no .npz file" in outcome.err


def test_truth_that_does_not_fit_is_refused(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT)
    source, poses = save_npz(tmp_path / "d.npz", drive), camera_poses(drive)
    twice = Poses(np.concatenate((poses.R, poses.R)), np.concatenate((poses.p, poses.p)))
    long = save_kitti(tmp_path / "long.txt", twice)
    empty, narrow, words, letters = (
        tmp_path / f"{name}.txt" for name in ("empty", "narrow", "words", "letters")
    )
    empty.write_text("")
    narrow.write_text("1 2 3\n4 5 6\n")
    words.write_text("one two three\n")
    letters.write_text("a b c d e f g h i j k l\n")
    skewed = tmp_path / "skewed.txt"
    skewed.write_text("1 0.5 0 0 0 1 0 0 0 0 1 0\n")
    for path, said in (
        (long, "122 poses for 61 frames"),
        (empty, "the file is empty"),
        (narrow, "line 1: has 3 cells; 12 numbers are expected"),
        (words, "line 1: has 3 cells"),
        (letters, "line 1: holds something that is no number"),
        (skewed, "line 1: holds no rotation"),
        (tmp_path / "absent.txt", "cannot be read"),
    ):
        outcome = pelorus(
            "convert", "ece276a", source, tmp_path / "out.plr", "--truth", path, status=1
        )
        assert path.name in outcome.err
        assert said in outcome.err


def test_an_output_that_cannot_be_written_is_told_and_leaves_nothing(
    tmp_path: Path, pelorus: Run
) -> None:
    source = save_npz(tmp_path / "d.npz", clean(**SHORT))
    (tmp_path / "folder.plr").mkdir()
    for target in (tmp_path / "no" / "such" / "place.plr", tmp_path / "folder.plr"):
        outcome = pelorus("convert", "ece276a", source, target, status=1)
        assert target.name in outcome.err
        assert "cannot be written" in outcome.err
    assert not list(tmp_path.glob("*.part"))
