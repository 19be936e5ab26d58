# SPDX-License-Identifier: MIT
"""Folders like EuRoC's, rendered through known lenses: what went in must come out."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from converted import Run, messages_of
from pelorus.io.tracks import triangulate
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.tracking import images
from pelorus.wire.frames import Header, Imu, Process, Stereo, Truth, Twist
from rendered import BEGIN_NS, FRAMES, HEIGHT, SPEED_MPS, WIDTH, Scene, write_picture
from rigs import IMU_NOISE, camchain, matrix, write_yaml
from scipy.spatial.transform import Rotation

IMU_HZ = 200
IMU_OF_BODY = Poses(Rotation.from_rotvec([0.0, 0.0, 0.3]).as_matrix(), np.array([0.1, 0.2, 0.3]))


def sensor(T_BS: Poses, **more: Any) -> dict[str, Any]:
    whole = np.array(matrix(T_BS)).ravel().tolist()
    return {"T_BS": {"cols": 4, "rows": 4, "data": whole}, **more}


def write_folder(top: Path, T_BI: Poses | None = None) -> Path:
    """`T_BI`: where the IMU sits on the folder's body; its axes unless told otherwise."""
    scene = Scene()
    T_BI = T_BI or Poses(np.eye(3), np.zeros(3))
    cameras = scene.cameras
    on_imu = (cameras.T_LB, se3.compose(cameras.T_RL, cameras.T_LB))
    for k, intrinsics in enumerate((cameras.left, cameras.right)):
        folder = top / "mav0" / f"cam{k}"
        for frame, t_ns in enumerate(scene.t_ns):
            write_picture(folder / "data" / f"{t_ns}.png", scene.pair(frame)[k])
        listed = "".join(f"{t},{t}.png\n" for t in scene.t_ns)
        (folder / "data.csv").write_text("#timestamp [ns],filename\n" + listed)
        content = sensor(
            se3.compose(T_BI, se3.inverse(on_imu[k])),
            camera_model="pinhole",
            intrinsics=list(intrinsics),
            distortion_model="radial-tangential",
            distortion_coefficients=list(cameras.coefficients),
            resolution=[WIDTH, HEIGHT],
        )
        write_yaml(folder / "sensor.yaml", content)
    write_imu(top / "mav0" / "imu0", T_BI)
    write_truth(top / "mav0" / "state_groundtruth_estimate0", T_BI)
    return top


def imu_times() -> list[int]:
    return [BEGIN_NS - 10**8 + k * 10**9 // IMU_HZ for k in range(IMU_HZ)]


# A filter starts from the truth's first pose: the readings before it are left out.
TRUTH_BEGINS_NS = BEGIN_NS - 3 * 10**7
EARLY = sum(t < TRUTH_BEGINS_NS for t in imu_times())


def write_imu(folder: Path, T_BI: Poses) -> None:
    folder.mkdir(parents=True)
    lines = [f"{t},0.1,0.2,{k},4.0,5.0,9.5\n" for k, t in enumerate(imu_times())]
    names = "#timestamp [ns],w_RS_S_x [rad s^-1],w y,w z,a_RS_S_x [m s^-2],a y,a z\n"
    (folder / "data.csv").write_text(names + "".join(lines))
    write_yaml(folder / "sensor.yaml", sensor(T_BI, sensor_type="imu", rate_hz=200, **IMU_NOISE))


def write_truth(folder: Path, T_BI: Poses) -> None:
    """Writes poses of the folder's body between the frames: 30 ms before and after each."""
    folder.mkdir(parents=True)
    of_imu = Scene().body()
    T_IB = se3.inverse(T_BI)
    lines = []
    for shift_s in (-0.03, 0.03):
        moved = Poses(of_imu.R, of_imu.p + SPEED_MPS * shift_s * np.eye(3)[2])
        R, p = se3.compose(moved, T_IB)
        for k, t in enumerate(Scene().t_ns):
            x, y, z, w = Rotation.from_matrix(R[k]).as_quat()
            row = [*p[k], w, x, y, z, *[0.0] * 9]
            lines.append(f"{t + round(shift_s * 1e9)},{','.join(map(repr, map(float, row)))}\n")
    names = "#timestamp, p_RS_R_x [m], and so on\n"
    (folder / "data.csv").write_text(names + "".join(sorted(lines)))
    write_yaml(folder / "sensor.yaml", sensor(Poses(np.eye(3), np.zeros(3))))


@pytest.fixture
def folder(tmp_path: Path, once: Callable[..., Path]) -> Path:
    own = tmp_path / "V9_01"
    shutil.copytree(once("euroc", write_folder), own)
    return own


def assert_on_surfaces(target: Path) -> None:
    """Every track's point, brought to the world by the truth, lies on wall or board."""
    header, stereos = messages_of(target, Header)[0], messages_of(target, Stereo)
    truth = {m.t_ns: m for m in messages_of(target, Truth)}
    T_BC = se3.inverse(Poses(header.R_CB, header.t_CB_m))
    off = []
    for frame in stereos:
        pose = truth[frame.t_ns]
        points = triangulate(header.camera, frame.pixels.astype(np.float64))
        p_W = se3.apply(se3.compose(Poses(pose.R_WB, pose.p_WB_m), T_BC), points)
        off.append(Scene().off_surface(p_W))
    off_m = np.concatenate(off)
    assert len(off_m) > 150
    assert np.median(off_m) < 0.08
    assert (off_m < 0.5).mean() > 0.95


def test_a_folder_of_pictures_arrives_as_tracks_of_a_rectified_pair_with_imu_and_truth(
    folder: Path, tmp_path: Path, pelorus: Run
) -> None:
    target = tmp_path / "out.plr"
    pelorus("convert", "euroc", folder, target)
    header = messages_of(target, Header)[0]
    assert header.process is Process.IMU
    assert header.name == "V9_01"
    assert (header.image_width_px, header.image_height_px) == (WIDTH, HEIGHT)
    assert header.noise.gyro_noise == IMU_NOISE["gyroscope_noise_density"]
    assert header.noise.accel_walk == IMU_NOISE["accelerometer_random_walk"]
    assert [m.t_ns for m in messages_of(target, Stereo)] == Scene().t_ns
    imu = messages_of(target, Imu)
    a = np.concatenate([m.a_B_mps2 for m in imu])
    w = np.concatenate([m.w_B_radps for m in imu])
    assert np.allclose(a, [4.0, 5.0, 9.5])
    assert np.allclose(w[:, 2], np.arange(EARLY, IMU_HZ))
    assert imu[0].t_ns == TRUTH_BEGINS_NS
    assert_on_surfaces(target)


def test_the_recordings_body_is_the_imu_wherever_it_sits_on_the_folders(
    tmp_path: Path, pelorus: Run
) -> None:
    target = tmp_path / "out.plr"
    write_folder(tmp_path / "x", IMU_OF_BODY)
    pelorus("convert", "euroc", tmp_path / "x" / "mav0", target)
    header = messages_of(target, Header)[0]
    camera = np.linalg.norm(header.t_CB_m)
    assert camera == pytest.approx(np.linalg.norm(Scene().cameras.T_LB.p), abs=1e-6)
    assert_on_surfaces(target)


def test_wheels_and_a_camchain_in_place_of_the_folders_imu_and_sensor_yaml(
    folder: Path, tmp_path: Path, pelorus: Run
) -> None:
    shutil.rmtree(folder / "mav0" / "imu0")
    for k in range(2):
        (folder / "mav0" / f"cam{k}" / "sensor.yaml").unlink()
    cameras = write_yaml(tmp_path / "c.yaml", camchain(Scene().cameras, (WIDTH, HEIGHT)))
    rows = [f"{t // 10**6}.{t % 10**6:06d},7.2\n" for t in Scene().t_ns]
    (tmp_path / "wheel.csv").write_text("stamp_ms,speed_kmh\n" + "".join(rows))
    target = tmp_path / "out.plr"
    words = ("--columns", "t=stamp_ms,v=speed_kmh", "--measured", "vx")
    pelorus(
        *("convert", "euroc", folder, target, "--calibration", cameras),
        *("--twists", tmp_path / "wheel.csv", *words),
    )
    header, twists = messages_of(target, Header)[0], messages_of(target, Twist)
    assert header.process is Process.TWIST
    assert [m.t_ns for m in twists] == Scene().t_ns
    assert np.allclose([m.v_B_mps for m in twists], [SPEED_MPS, 0, 0])
    assert header.noise.velocity_sigma_x_mps < 0
    assert header.noise.velocity_sigma_y_mps == header.noise.velocity_sigma_z_mps == 0.2
    assert header.noise.gyro_sigma_z_radps == pytest.approx(3.0)
    assert_on_surfaces(target)


def test_pictures_without_a_partner_are_left_out_if_they_are_few(
    folder: Path, tmp_path: Path, pelorus: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("data.csv", f"data/{Scene().t_ns[2]}.png"):
        (folder / "mav0" / "cam1" / name).unlink()
    target = tmp_path / "out.plr"
    monkeypatch.setattr("pelorus.tracking.images.ALONE_MAX", 0.3)
    pelorus("convert", "euroc", folder, target)
    assert len(messages_of(target, Stereo)) == FRAMES - 1
    assert "1 pictures have no partner" in pelorus("info", target).out
    monkeypatch.undo()
    outcome = pelorus("convert", "euroc", folder, tmp_path / "no.plr", status=1)
    assert "5 pairs, taken within 2 ms; 1 pictures have no partner; the nearest" in outcome.err


def _small(path: Path) -> None:
    for picture in path.glob("mav0/cam*/data/*.png"):
        cv2.imwrite(str(picture), np.zeros((HEIGHT // 2, WIDTH // 2), np.uint8))


def _later(path: Path) -> None:
    imu = path / "mav0/imu0/data.csv"
    imu.write_text(imu.read_text().replace("14036", "15036"))


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (lambda p: shutil.rmtree(p / "mav0/cam1"), "has no folders cam0 and cam1, nor mav0"),
        (lambda p: (p / "mav0/cam1/sensor.yaml").unlink(), "cam1/sensor.yaml: there is no such"),
        (lambda p: (p / "mav0/imu0/data.csv").unlink(), "--twists FILE, or --imu FILE is expected"),
        (
            lambda p: (p / f"mav0/cam0/data/{BEGIN_NS}.png").unlink(),
            f"1 are not there or cut off, {{folder}}/mav0/cam0/data/{BEGIN_NS}.png first",
        ),
        (
            lambda p: (p / "mav0/cam0/data.csv").write_text("a,b\n"),
            "a time in ns, a file are expected",
        ),
        (
            lambda p: (p / "mav0/cam0/data.csv").write_text("7,7.png\n"),
            "0 pairs, taken within 2 ms; 6 pictures have no partner, 1 are not there or cut off",
        ),
        (lambda p: (p / "mav0/imu0/data.csv").write_text("1,2,3\n"), "has 3 numbers; 7 a row are"),
        (lambda p: (p / "mav0/imu0/data.csv").write_bytes(b""), "imu0/data.csv: the file is empty"),
        (_small, f"188 x 120 pixels; {WIDTH} x {HEIGHT} are expected, for which the calibration"),
        (_later, "they do not overlap"),
    ],
)
def test_a_folder_that_lacks_something_is_told_what_and_where(
    folder: Path, tmp_path: Path, pelorus: Run, harm: Callable[[Path], object], said: str
) -> None:
    harm(folder)
    outcome = pelorus("convert", "euroc", folder, tmp_path / "out.plr", status=1)
    assert said.format(folder=folder) in outcome.err
    assert not list(tmp_path.glob("out*"))


def test_a_folder_of_tum_vi_has_its_calibration_beside_it(
    folder: Path, tmp_path: Path, pelorus: Run
) -> None:
    for name in ("cam0", "cam1", "imu0"):
        (folder / "mav0" / name / "sensor.yaml").unlink()
    (folder / "dso").mkdir()
    write_yaml(folder / "dso/camchain.yaml", camchain(Scene().cameras, (WIDTH, HEIGHT)))
    write_yaml(folder / "dso/imu_config.yaml", IMU_NOISE)
    pelorus("convert", "euroc", folder, tmp_path / "out.plr")
    header = messages_of(tmp_path / "out.plr", Header)[0]
    assert header.noise.gyro_noise == IMU_NOISE["gyroscope_noise_density"]
    assert_on_surfaces(tmp_path / "out.plr")


# --- what public copies are like ------------------------------------------------------------------


def _edit(path: Path, harm: Callable[[list[str]], list[str]]) -> None:
    """The lines behind the names."""
    names, *rows = path.read_text().splitlines()
    path.write_text("\n".join([names, *harm(rows), ""]))


def _moved(rows: list[str], by_ns: int) -> list[str]:
    """Times alone, not the files' names."""
    cut = [row.split(",", 1) for row in rows]
    return [f"{int(t) + by_ns},{rest}" for t, rest in cut]


def test_a_listed_picture_that_is_not_there_costs_its_pair_and_is_told(
    folder: Path, tmp_path: Path, pelorus: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    lost, cut = Scene().t_ns[3:5]
    (folder / f"mav0/cam1/data/{lost}.png").unlink()
    of_cut = folder / f"mav0/cam1/data/{cut}.png"
    of_cut.write_bytes(of_cut.read_bytes()[:3000])
    extra = folder / "mav0/cam0/data" / f"{lost + 7}.png"
    shutil.copy(folder / f"mav0/cam0/data/{lost}.png", extra)
    (folder / f"mav0/cam0/data/._{lost}.png").write_bytes(b"of a desktop")
    monkeypatch.setattr("pelorus.tracking.images.ALONE_MAX", 0.5)
    said = pelorus("convert", "euroc", folder, tmp_path / "out.plr").out
    assert [m.t_ns for m in messages_of(tmp_path / "out.plr", Stereo)] == [
        t for t in Scene().t_ns if t not in (lost, cut)
    ]
    assert f"cam1/data.csv: 2 pictures are not there or cut off, {lost}.png first" in said
    assert f"cam0/data.csv: does not list 1 pictures, {extra.name} first" in said
    assert "2 pictures have no partner and are left out" in said


def test_a_picture_of_another_kind_is_the_one_that_is_listed(
    folder: Path, tmp_path: Path, pelorus: Run
) -> None:
    for path in (folder / "mav0/cam0/data").iterdir():
        cv2.imwrite(str(path.with_suffix(".pgm")), images.gray(path))
        path.unlink()
    pelorus("convert", "euroc", folder, tmp_path / "out.plr")
    assert len(messages_of(tmp_path / "out.plr", Stereo)) == FRAMES


@pytest.mark.parametrize("apart_ns", [15_000, -400_000])
def test_cameras_whose_clocks_differ_a_little_are_paired_one_to_one(
    folder: Path, tmp_path: Path, pelorus: Run, apart_ns: int
) -> None:
    _edit(folder / "mav0/cam1/data.csv", lambda rows: _moved(rows, apart_ns))
    said = pelorus("convert", "euroc", folder, tmp_path / "out.plr").out
    assert [m.t_ns for m in messages_of(tmp_path / "out.plr", Stereo)] == Scene().t_ns
    assert f"times differ by up to {abs(apart_ns) / 1e6:.3g} ms: cam0's are taken" in said
    _edit(folder / "mav0/cam1/data.csv", lambda rows: _moved(rows, 21_000_000))
    said = pelorus("convert", "euroc", folder, tmp_path / "no.plr", status=1).err
    assert "0 pairs, taken within 2 ms; 12 pictures have no partner; the nearest times are" in said


def test_a_recording_may_begin_at_time_0(folder: Path, tmp_path: Path, pelorus: Run) -> None:
    for path in folder.glob("mav0/*/data.csv"):
        _edit(path, lambda rows: _moved(rows, 10**8 - BEGIN_NS))
    target = tmp_path / "out.plr"
    said = pelorus("convert", "euroc", folder, target).out
    assert "never set" not in said
    shift_ns = BEGIN_NS - 10**8
    assert [m.t_ns + shift_ns for m in messages_of(target, Stereo)] == Scene().t_ns
    assert {m.t_ns + shift_ns for m in messages_of(target, Truth)} >= set(Scene().t_ns)


def test_readings_and_poses_that_are_none_are_left_out_if_they_are_few(
    folder: Path, tmp_path: Path, pelorus: Run
) -> None:
    imu, truth = (
        folder / "mav0" / name / "data.csv" for name in ("imu0", "state_groundtruth_estimate0")
    )

    def broken(rows: list[str]) -> list[str]:
        rows = [*rows[:20], rows[20].replace("4.0", "nan"), rows[20], rows[20], *rows[21:-1]]
        return [f"0,{rows[0].split(',', 1)[1]}", *rows, rows[-1][:25]]

    _edit(imu, broken)
    _edit(truth, lambda rows: [rows[0], rows[1].replace(",0.03,", ",NaN,"), *rows[2:]])
    target = tmp_path / "out.plr"
    said = pelorus("convert", "euroc", folder, target).out
    assert sum(len(m.a_B_mps2) for m in messages_of(target, Imu)) == IMU_HZ - 1 - EARLY
    for words in (
        "imu0/data.csv: 1 of 203 rows are left out, line 204 first: has 3 numbers; 7 a row "
        "are expected",
        "imu0/data.csv: 1 of 202 rows are left out, line 23 first: holds a number that is not fin",
        "imu0/data.csv: 1 of 201 rows are left out, line 2 first: its time is 0: it was never set",
        "imu0/data.csv: 1 of 201 rows are left out, line 25 first: time does not ascend but rep",
        "state_groundtruth_estimate0/data.csv: 1 of 12 rows are left out, line 3 first: holds a",
    ):
        assert words in said
    _edit(imu, lambda rows: [row.replace(",4.0,", ",nan,") for row in rows[:30]] + rows[30:])
    said = pelorus("convert", "euroc", folder, tmp_path / "no.plr", status=1).err
    assert "line 2: holds a number that is not finite (" in said


def test_the_truth_of_a_motion_capture_is_brought_to_the_imu_and_positions_alone_are_none(
    folder: Path, tmp_path: Path, pelorus: Run
) -> None:
    own = folder / "mav0/state_groundtruth_estimate0"
    marker = Poses(Rotation.from_rotvec([0.2, -0.4, 0.9]).as_matrix(), np.array([0.3, -0.1, 0.05]))
    rows = []
    for line in (own / "data.csv").read_text().splitlines()[1:]:
        t, *numbers = line.split(",")
        w, x, y, z = map(float, numbers[3:7])
        R = Rotation.from_quat([x, y, z, w]).as_matrix()
        T = se3.compose(Poses(R, np.array(numbers[:3], float)), marker)
        x, y, z, w = Rotation.from_matrix(T.R).as_quat()
        rows.append(",".join([t, *(f"{n:.9f}" for n in (*T.p, w, x, y, z))]))
    shutil.rmtree(own)
    (folder / "mav0/vicon0").mkdir()
    (folder / "mav0/vicon0/data.csv").write_text("#timestamp [ns],p\n" + "\n".join(rows) + "\n")
    write_yaml(folder / "mav0/vicon0/sensor.yaml", sensor(marker))
    pelorus("convert", "euroc", folder, tmp_path / "out.plr")
    assert_on_surfaces(tmp_path / "out.plr")
    (folder / "mav0/vicon0").rename(folder / "mav0/leica0")
    said = pelorus("convert", "euroc", folder, tmp_path / "bare.plr").out
    assert "leica0: positions without attitude: not read as the truth" in said
    assert not messages_of(tmp_path / "bare.plr", Truth)
