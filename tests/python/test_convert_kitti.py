# SPDX-License-Identifier: MIT
"""KITTI's folders, raw and of the odometry benchmark, rendered: what went in must come out."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run, messages_of
from numpy.typing import NDArray
from pelorus.io.tracks import triangulate
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Config, Header, Stereo, Truth, Twist, TwistTiming
from pelorus.wire.settings import IDS
from rendered import FRAMES, HEIGHT, RATE_HZ, SPEED_MPS, WIDTH, Scene, write_picture
from rigs import Cameras
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

PLAIN = (220.0, 220.0, 187.0, 119.0)
BASELINE_M, ASIDE_M = 0.3, 0.06  # of the pair, and of its left camera from camera 0
EARTH_M = 6378137.0
LATITUDE, LONGITUDE = 49.0, 8.4
ROLL, PITCH, YAW = 0.05, -0.1, 2.0


def turned(*vector: float) -> Floats:
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


VELO = Poses(turned(1.2, -1.2, 1.2), np.array([0.0, -0.07, -0.27]))
IMU = Poses(turned(0.01, 0.0, -0.02), np.array([-0.8, 0.3, -0.8]))
RECT = Poses(turned(0.01, 0.02, -0.005), np.zeros(3))


def scene() -> Scene:
    shift = Poses(np.eye(3), np.array([-BASELINE_M, 0, 0]))
    return Scene(Cameras("none", PLAIN, PLAIN, (), shift))


@pytest.fixture
def pairs(kept: Callable[..., Any]) -> list[Any]:
    found: list[Any] = kept("rectified pairs", lambda: [scene().pair(k) for k in range(FRAMES)])
    return found


def projection(shift_m: float) -> Floats:
    fx, fy, cx, cy = PLAIN
    return np.array([[fx, 0, cx, -fx * shift_m], [0, fy, cy, 0], [0, 0, 1, 0]])


def line(name: str, numbers: Any) -> str:
    return f"{name}: {' '.join(f'{x:.12e}' for x in np.ravel(numbers))}\n"


def stamps(count: int = FRAMES, late_s: float = 0.0) -> str:
    begin = "2011-09-30 12:40:2"
    times = [5.069324302 + late_s + k / RATE_HZ for k in range(count)]
    return "".join(f"{begin}{t:.9f}\n" for t in times)


BEGIN_NS = 1317386425069324302  # of the first of them


def velocity_B() -> Floats:
    """The camera goes along its own z."""
    R_CB = (RECT.R @ VELO.R) @ IMU.R
    return np.asarray(SPEED_MPS * R_CB[2])


def write_raw(date: Path, pairs: list[Any]) -> Path:
    drive = date / "2011_09_30_drive_0099_sync"
    for side, name in enumerate(("image_00", "image_01")):
        for k, pair in enumerate(pairs):
            write_picture(drive / name / "data" / f"{k:010d}.png", pair[side])
        (drive / name / "timestamps.txt").write_text(stamps())
    data = drive / "oxts" / "data"
    data.mkdir(parents=True)
    R_EB = Rotation.from_euler("ZYX", [YAW, PITCH, ROLL])
    level = Rotation.from_euler("ZYX", [0, PITCH, ROLL]).apply(velocity_B())
    scale = np.cos(np.radians(LATITUDE))
    for k in range(FRAMES):
        east, north, up = R_EB.apply(velocity_B()) * k / RATE_HZ
        y0 = np.log(np.tan(np.radians(90 + LATITUDE) / 2))
        y = y0 + north / (scale * EARTH_M)
        numbers = np.zeros(30)
        numbers[0] = np.degrees(2 * np.arctan(np.exp(y))) - 90
        numbers[1] = LONGITUDE + np.degrees(east / (scale * EARTH_M))
        numbers[2:6] = 112.0 + up, ROLL, PITCH, YAW
        numbers[8:11] = level
        numbers[17:20] = 0.01, 0.02, 0.03
        (data / f"{k:010d}.txt").write_text(" ".join(f"{x:.15g}" for x in numbers) + "\n")
    (drive / "oxts" / "timestamps.txt").write_text(stamps(late_s=0.004))
    (date / "calib_cam_to_cam.txt").write_text(
        "calib_time: 09-Jan-2012 14:00:15\n"
        + line("S_rect_00", [WIDTH, HEIGHT])
        + line("R_rect_00", RECT.R)
        + line("P_rect_00", projection(0.0))
        + line("P_rect_01", projection(BASELINE_M))
    )
    for name, T in (("velo_to_cam", VELO), ("imu_to_velo", IMU)):
        (date / f"calib_{name}.txt").write_text(line("R", T.R) + line("T", T.p))
    return drive


def write_odometry(top: Path, pairs: list[Any]) -> Path:
    """The colour cameras, which stand beside camera 0, whose poses are told."""
    sequence = top / "sequences" / "42"
    for side, name in enumerate(("image_2", "image_3")):
        for k, pair in enumerate(pairs):
            write_picture(sequence / name / f"{k:06d}.png", pair[side])
    (sequence / "times.txt").write_text("".join(f"{k / RATE_HZ:e}\n" for k in range(FRAMES)))
    (sequence / "calib.txt").write_text(
        line("P0", projection(0.0))
        + line("P2", projection(ASIDE_M))
        + line("P3", projection(ASIDE_M + BASELINE_M))
    )
    (top / "poses").mkdir()
    rows = [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, SPEED_MPS * k / RATE_HZ] for k in range(FRAMES)]
    np.savetxt(top / "poses" / "42.txt", rows)
    return sequence


def assert_points_are_right(target: Path) -> None:
    camera = messages_of(target, Header)[0].camera
    assert camera.baseline_m == pytest.approx(BASELINE_M)
    off = []
    for k, frame in enumerate(messages_of(target, Stereo)):
        points = triangulate(camera, frame.pixels.astype(np.float64))
        points[:, 2] += SPEED_MPS * k / RATE_HZ
        off.append(scene().off_surface(points))
    off_m = np.concatenate(off)
    assert len(off_m) > 150
    assert np.median(off_m) < 0.05


def test_a_raw_drive_arrives_with_its_oxts_as_twists_and_truth(
    pairs: list[Any], tmp_path: Path, pelorus: Run
) -> None:
    drive, target = write_raw(tmp_path / "date", pairs), tmp_path / "out.plr"
    pelorus("convert", "kitti", drive, target, "--fix", "none")
    header = messages_of(target, Header)[0]
    T_CB = se3.compose(RECT, se3.compose(VELO, IMU))
    assert np.allclose(header.R_CB, T_CB.R)
    assert np.allclose(header.t_CB_m, T_CB.p)
    assert header.twist_timing is TwistTiming.END
    (wanted,) = messages_of(target, Config)  # what is known of the truth's attitude
    assert wanted.settings == {IDS["start-sigma"]: 0.01}
    assert (header.image_width_px, header.image_height_px) == (WIDTH, HEIGHT)
    twists = messages_of(target, Twist)
    assert np.allclose([m.v_B_mps for m in twists], velocity_B())
    assert np.allclose([m.w_B_radps for m in twists], [0.01, 0.02, 0.03])
    assert twists[0].t_ns == BEGIN_NS + 4_000_000
    frames = messages_of(target, Stereo)
    assert frames[0].t_ns == BEGIN_NS
    truth = {m.t_ns: m for m in messages_of(target, Truth)}
    first, last = (truth[t.t_ns] for t in (frames[1], frames[-1]))
    way = first.R_WB.T @ (last.p_WB_m - first.p_WB_m)
    assert np.allclose(way, velocity_B() * (FRAMES - 2) / RATE_HZ, atol=1e-5)
    assert np.allclose(first.R_WB, Rotation.from_euler("ZYX", [YAW, PITCH, ROLL]).as_matrix())
    assert_points_are_right(target)
    words = ("--force", "--fix", "none", "--twist-timing", "start")
    pelorus("convert", "kitti", drive, target, *words)
    assert messages_of(target, Header)[0].twist_timing is TwistTiming.START


def test_a_sequence_of_the_benchmark_gets_twists_from_its_poses_and_says_so(
    pairs: list[Any], tmp_path: Path, pelorus: Run
) -> None:
    sequence, target = write_odometry(tmp_path, pairs), tmp_path / "out.plr"
    words = ("--velocity-sigma", "0", "--gyro-sigma", "0", "--fix", "none")
    outcome = pelorus("convert", "kitti", sequence, target, *words)
    assert "the twists are made from the truth, with white noise of 0 m/s" in outcome.out
    assert "the twists are made from the truth" in pelorus("info", target).out
    assert np.allclose([m.v_B_mps for m in messages_of(target, Twist)], [SPEED_MPS, 0, 0])
    truth = messages_of(target, Truth)
    assert np.allclose(truth[-1].p_WB_m, [SPEED_MPS * (FRAMES - 1) / RATE_HZ, 0, 0])
    assert_points_are_right(target)


def test_noise_of_made_twists_is_what_was_asked_for_and_the_header_tells_it(
    pairs: list[Any], tmp_path: Path, pelorus: Run
) -> None:
    sequence, target = write_odometry(tmp_path, pairs), tmp_path / "out.plr"
    drawn = []
    for seed in range(12):
        pelorus("convert", "kitti", sequence, target, "--seed", seed, "--force")
        twists = messages_of(target, Twist)
        drawn.append([[*(m.v_B_mps - [SPEED_MPS, 0, 0]), *m.w_B_radps] for m in twists])
    sigma = np.std(drawn, axis=(0, 1))
    assert np.allclose(sigma[:3], 0.5, rtol=0.2)
    assert np.allclose(sigma[3:], 0.05, rtol=0.2)
    noise = messages_of(target, Header)[0].noise
    assert (noise.velocity_sigma_mps, noise.gyro_sigma_radps) == (0.5, 0.05)


def test_own_twists_take_the_place_of_made_ones(
    pairs: list[Any], tmp_path: Path, pelorus: Run
) -> None:
    sequence, target = write_odometry(tmp_path, pairs), tmp_path / "out.plr"
    shutil.rmtree(tmp_path / "poses")
    outcome = pelorus("convert", "kitti", sequence, target, status=1)
    assert "the benchmark has no twists, and there is no " in outcome.err
    assert "poses/42.txt to make some from; --twists FILE, --imu FILE or --truth" in outcome.err
    speeds = tmp_path / "speed.csv"
    speeds.write_text("t_s,v_mps\n" + "".join(f"{k / 10},{SPEED_MPS}\n" for k in range(FRAMES)))
    words = ("--twists", speeds, "--columns", "v=v_mps", "--measured", "vx")
    outcome = pelorus("convert", "kitti", sequence, target, *words)
    assert np.allclose([m.v_B_mps for m in messages_of(target, Twist)], [SPEED_MPS, 0, 0])


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("calib_cam_to_cam.txt", "x: 1\n", "lacks P_rect_00; there are: x"),
        ("calib_cam_to_cam.txt", "P_rect_00: 1 2\n", "P_rect_00 has 2 numbers; 12 finite ones are"),
        ("calib_velo_to_cam.txt", "R: a\n", "R holds something that is no number"),
        ("calib_imu_to_velo.txt", "R: 1 0 0 0 1 0 0 0 2\nT: 1 2 3\n", "R is no rotation"),
        (
            "{}/oxts/timestamps.txt",
            stamps(3),
            "has 3 times; 6 are expected, one for each file in data",
        ),
        ("{}/oxts/timestamps.txt", "soon\n" * 6, "line 1: 'soon' is no time; 2011-09-30 12:40:25"),
        ("{}/image_00/timestamps.txt", stamps(1) * 6, "line 2: time does not ascend"),
        ("{}/oxts/data/0000000002.txt", "1 2 3\n", "line 1: has 3 numbers; 30 a row are"),
    ],
)
def test_a_raw_drive_that_lacks_something_is_told_what_and_where(
    pairs: list[Any], tmp_path: Path, pelorus: Run, name: str, content: str, said: str
) -> None:
    drive = write_raw(tmp_path / "date", pairs)
    path = drive.parent / name.format(drive.name)
    path.write_text(content)
    outcome = pelorus("convert", "kitti", drive, tmp_path / "out.plr", status=1)
    assert f"{path}: {said}" in outcome.err
    assert not list(tmp_path.glob("out*"))


def test_a_folder_that_is_none_of_kittis_is_told(tmp_path: Path, pelorus: Run) -> None:
    (tmp_path / "photos").mkdir()
    for folder, said in (
        (tmp_path, "has no image_0 and image_1 or image_2 and image_3; a raw drive (..._sync"),
        (tmp_path / "nix", "cannot be read as a folder: No such file"),
    ):
        outcome = pelorus("convert", "kitti", folder, tmp_path / "out.plr", status=1)
        assert said in outcome.err


def test_the_start_of_a_real_sequence_is_tracked(
    real: Callable[[str], Path], tmp_path: Path, pelorus: Run
) -> None:
    source = real("images/kitti-06-start/poses.txt").parent
    sequence = tmp_path / "sequences" / "06"
    sequence.mkdir(parents=True)
    for name, folder in (("image_0", "image_l"), ("image_1", "image_r")):
        (sequence / name).symlink_to(source / folder)
    P = (source / "calib.txt").read_text().splitlines()
    (sequence / "calib.txt").write_text("".join(f"P{k}: {row}\n" for k, row in enumerate(P)))
    (sequence / "times.txt").write_text("".join(f"{k * 0.10362:.6f}\n" for k in range(51)))
    (tmp_path / "poses").mkdir()
    shutil.copy(source / "poses.txt", tmp_path / "poses" / "06.txt")
    target = tmp_path / "out.plr"
    pelorus("convert", "kitti", sequence, target)
    assert messages_of(target, Header)[0].camera.baseline_m == pytest.approx(0.537, abs=0.001)
    frames = messages_of(target, Stereo)
    assert len(frames) == 51
    assert np.median([len(m.ids) for m in frames]) > 30
