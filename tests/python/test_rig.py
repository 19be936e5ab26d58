# SPDX-License-Identifier: MIT
"""Lenses, rectification, and the calibrations of Kalibr, OpenCV and EuRoC: known points through
known cameras must come back as what a rectified pair sees of them.
"""

from __future__ import annotations

import json
import random
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
import pytest
from pelorus.errors import PelorusError
from pelorus.io.foreign import ForeignFileError
from pelorus.io.tracks import project
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig import read as rig_files
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rig import Rig
from pelorus.wire.frames import BodyAxes, Noise
from rigs import (
    IMU_NOISE,
    RADTAN,
    SIZE,
    Cameras,
    camchain,
    fisheye,
    lens,
    matrix,
    opencv_matrices,
    opencv_text,
    points,
    write_yaml,
)

FISHEYE_SIZE = (512, 512)
DAMAGES = 150


def assert_rectifies(rig: Rig, cameras: Cameras) -> None:
    """What the cameras see becomes what the HEADER's camera sees, to a thousandth of a pixel."""
    q_L = points()
    rectification = rig.rectification()
    header = rig.header(rectification, "x")
    assert rig.T_LB is not None
    s_B = se3.apply(se3.inverse(cameras.T_LB), q_L)
    q_C = se3.apply(Poses(header.R_CB, header.t_CB_m), s_B)
    due = project(header.camera, q_C)
    assert np.abs(rectification.pixels(cameras.see(q_L)) - due).max() < 1e-3
    assert header.camera.baseline_m == pytest.approx(np.linalg.norm(cameras.T_RL.p), abs=1e-9)


# --- lenses ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("cameras", [Cameras(), fisheye(), Cameras("none", coefficients=())])
def test_a_lens_bends_as_its_formula_says_and_back(cameras: Cameras) -> None:
    own = Lens(LensModel(cameras.model), cameras.left[:4], cameras.coefficients)  # type: ignore[arg-type]
    q = points()
    rays = q[:, :2] / q[:, 2:]
    due = lens(cameras.model, cameras.left, cameras.coefficients, q)
    assert np.abs(own.distort(rays) - due).max() < 1e-9
    assert np.abs(own.undistort(due) - rays).max() < 1e-9


def test_a_pixel_that_no_ray_reaches_is_none() -> None:
    own = Lens(LensModel.RADTAN, (400.0, 400.0, 320.0, 240.0), (-0.4, 0.0, 0.0, 0.0))
    found = own.undistort(np.array([[320.0, 240.0], [5000.0, 240.0]]))
    assert np.allclose(found[0], 0)
    assert np.isnan(found[1]).all()


# --- Kalibr ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cameras", "size"), [(Cameras(), SIZE), (fisheye(), FISHEYE_SIZE)], ids=["radtan", "fisheye"]
)
def test_kalibrs_camchain_rectifies_what_its_cameras_see(
    tmp_path: Path, cameras: Cameras, size: tuple[int, int]
) -> None:
    path = write_yaml(tmp_path / "camchain.yaml", camchain(cameras, size))
    rig = rig_files.read_rig([path])
    assert_rectifies(rig, cameras)
    assert rig.topics == ("/cam0/image_raw", "/cam1/image_raw")
    header = rig_files.read([path], "drive").header
    assert (header.image_width_px, header.image_height_px) == size
    assert header.body_axes is BodyAxes.FORWARD_LEFT_UP
    assert header.name == "drive"


def test_the_direction_of_a_transform_is_that_of_its_key(tmp_path: Path) -> None:
    cameras = Cameras()
    there = camchain(cameras)
    back = camchain(cameras)
    for camera in back.values():
        whole = np.linalg.inv(np.array(camera.pop("T_cam_imu")))
        camera["T_imu_cam"] = whole.tolist()
    one, other = (
        rig_files.read_rig([write_yaml(tmp_path / f"{k}.yaml", content)])
        for k, content in enumerate((there, back))
    )
    for rig in (one, other):
        assert rig.T_LB is not None
        assert np.allclose(rig.T_LB.p, cameras.T_LB.p, atol=1e-9)
        assert np.allclose(rig.T_LB.R, cameras.T_LB.R, atol=1e-9)


def test_the_second_camera_may_be_the_left_one(tmp_path: Path) -> None:
    cameras = Cameras()
    mirrored = Cameras(
        left=cameras.right,
        right=cameras.left,
        T_RL=se3.inverse(cameras.T_RL),
        T_LB=se3.compose(cameras.T_RL, cameras.T_LB),
    )
    content = camchain(mirrored, timeshift_cam_imu=0.25)
    rig = rig_files.read_rig([write_yaml(tmp_path / "c.yaml", content)])
    assert rig.swapped
    assert rig.topics == ("/cam1/image_raw", "/cam0/image_raw")
    assert_rectifies(rig, cameras)


def test_kalibrs_imu_file_gives_the_noise_and_its_time_shift_the_clock(tmp_path: Path) -> None:
    cameras = write_yaml(tmp_path / "c.yaml", camchain(Cameras(), timeshift_cam_imu=0.0125))
    imu = write_yaml(tmp_path / "imu.yaml", {"imu0": IMU_NOISE | {"update_rate": 200.0}})
    rig = rig_files.read_rig([cameras, imu])
    told = {"gyro_noise": 1.7e-4, "accel_noise": 2e-3, "gyro_walk": 2e-5, "accel_walk": 3e-3}
    assert vars(rig.imu.noise) == vars(Noise(**told))
    assert rig.on_body_clock(np.array([10**18])) == 10**18 + 12_500_000
    plain = write_yaml(tmp_path / "plain.yaml", IMU_NOISE)
    assert vars(rig_files.read_rig([cameras, plain]).imu.noise) == vars(rig.imu.noise)
    text = "gyroscope_noise_density: 1e-3\n"  # no number for a reader of YAML 1.1
    (tmp_path / "short.yaml").write_text(text)
    assert rig_files.read_rig([cameras, tmp_path / "short.yaml"]).imu.noise.gyro_noise == 1e-3


def test_a_camchain_without_an_imu_asks_for_the_extrinsic_and_takes_it(tmp_path: Path) -> None:
    content = camchain(Cameras())
    for camera in content.values():
        del camera["T_cam_imu"]
    path = write_yaml(tmp_path / "c.yaml", content)
    with pytest.raises(ForeignFileError, match="does not say where the camera sits on the body"):
        rig_files.read([path], "x")
    T_BC = se3.inverse(Cameras().T_LB)
    extrinsic = tmp_path / "body.json"
    extrinsic.write_text(json.dumps({"R_BC": T_BC.R.tolist(), "t_BC_m": T_BC.p.tolist()}))
    found = rig_files.read([path], "x", extrinsic)
    assert found.rig is not None
    assert_rectifies(found.rig, Cameras())


# --- OpenCV ---------------------------------------------------------------------------------------


def test_opencvs_stereo_calibration_in_one_file_or_two(tmp_path: Path) -> None:
    cameras = Cameras()
    everything = opencv_matrices(cameras)
    (tmp_path / "stereo.yml").write_text(opencv_text(**everything))
    outer = {name: everything.pop(name) for name in ("R", "T")}
    inner = {{"K1": "M1", "K2": "M2"}.get(name, name): value for name, value in everything.items()}
    (tmp_path / "intrinsics.yml").write_text(opencv_text(**inner))
    (tmp_path / "extrinsics.yml").write_text(opencv_text(**outer))
    one = rig_files.read_rig([tmp_path / "stereo.yml"])
    two = rig_files.read_rig([tmp_path / "extrinsics.yml", tmp_path / "intrinsics.yml"])
    for rig in (one, two):
        assert rig.left.width_px == SIZE[0]
        assert_rectifies(rig.on_body(cameras.T_LB), cameras)


def test_what_opencv_itself_writes_is_read(tmp_path: Path) -> None:
    path = str(tmp_path / "cv.yml")
    storage = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
    cameras = Cameras()
    for name, value in opencv_matrices(cameras).items():
        if name != "imageSize":
            storage.write(name, np.asarray(value, np.float64))
    storage.release()
    assert_rectifies(rig_files.read_rig([Path(path)]).on_body(cameras.T_LB), cameras)


def test_four_numbers_are_radtan_or_a_fisheye_only_if_somebody_says_so(tmp_path: Path) -> None:
    cameras = fisheye()
    path = tmp_path / "fisheye.yml"
    path.write_text(opencv_text(**opencv_matrices(cameras)))
    with pytest.raises(ForeignFileError, match="--lens radtan or --lens equidistant is expected"):
        rig_files.read_rig([path])
    rig = rig_files.read_rig([path], LensModel.EQUIDISTANT)
    assert_rectifies(rig.on_body(cameras.T_LB), cameras)


# --- EuRoC's sensor.yaml --------------------------------------------------------------------------


def sensor_yaml(cameras: Cameras, k: int) -> dict[str, Any]:
    intrinsics = (cameras.left, cameras.right)[k]
    T_CB = (cameras.T_LB, se3.compose(cameras.T_RL, cameras.T_LB))[k]
    T_BS = np.array(matrix(se3.inverse(T_CB)))
    return {
        "sensor_type": "camera",
        "T_BS": {"cols": 4, "rows": 4, "data": T_BS.ravel().tolist()},
        "rate_hz": 20,
        "resolution": list(SIZE),
        "camera_model": "pinhole",
        "intrinsics": list(intrinsics),
        "distortion_model": "radial-tangential",
        "distortion_coefficients": list(RADTAN),
    }


def test_two_sensor_yaml_are_a_pair(tmp_path: Path) -> None:
    paths = [write_yaml(tmp_path / f"cam{k}.yaml", sensor_yaml(Cameras(), k)) for k in range(2)]
    assert_rectifies(rig_files.read_rig(paths), Cameras())


# --- pictures -------------------------------------------------------------------------------------


def test_rectified_pictures_show_points_where_rectified_pixels_say(tmp_path: Path) -> None:
    cameras = Cameras()
    path = write_yaml(tmp_path / "c.yaml", camchain(cameras))
    rectification = rig_files.read_rig([path]).rectification()
    spot = cameras.see(np.array([[0.5, 0.3, 4.0]]))
    across, down = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    pair = [
        (20 + 200 * np.exp(-((across - u) ** 2 + (down - v) ** 2) / 50)).astype(np.uint8)
        for u, v in spot.reshape(2, 2)
    ]
    due = rectification.pixels(spot).reshape(2, 2)
    assert due[0, 1] == pytest.approx(due[1, 1], abs=1e-6), "in one row"
    for picture, (u, v) in zip(rectification.pictures(*pair), due, strict=True):
        assert picture.min() >= 19, "no empty edge, on which a tracker would find corners"
        weight = np.maximum(picture.astype(float) - 25, 0)
        found = [(grid * weight).sum() / weight.sum() for grid in (across, down)]
        assert np.abs(np.array(found) - [u, v]).max() < 0.05


def test_a_pair_that_is_rectified_already_is_left_alone(tmp_path: Path) -> None:
    plain = (400.0, 400.0, 320.0, 240.0)
    cameras = Cameras("none", plain, plain, (), Poses(np.eye(3), np.array([-0.2, 0.0, 0.0])))
    path = write_yaml(tmp_path / "c.yaml", camchain(cameras, (640, 480)))
    assert rig_files.read([path], "x").rig is None
    turned = replace(cameras, T_RL=Cameras().T_RL)
    path = write_yaml(tmp_path / "c.yaml", camchain(turned, (640, 480)))
    assert rig_files.read([path], "x").rig is not None


# --- bad input ------------------------------------------------------------------------------------


def harmed(content: dict[str, Any], camera: str, **changes: Any) -> dict[str, Any]:
    kept = {name: value for name, value in content[camera].items() if changes.get(name, 0) != "-"}
    given = {name: value for name, value in changes.items() if value != "-"}
    return content | {camera: kept | given}


@pytest.mark.parametrize(
    ("camera", "changes", "said"),
    [
        (
            "cam0",
            {"camera_model": "fov"},
            "cam0: camera_model is 'fov'; pinhole or omni or eucm or",
        ),
        (
            "cam0",
            {"intrinsics": [1, 2, 3]},
            "cam0: intrinsics is [1, 2, 3]; 4 finite numbers are expected",
        ),
        ("cam0", {"intrinsics": [-1.0, 2, 3, 4]}, "[fx, fy, cx, cy] in px is expected"),
        ("cam1", {"distortion_model": "fov"}, "none or radtan or"),
        (
            "cam1",
            {"distortion_coeffs": [1, 2]},
            "4 or 5 or 8 or 12 or 14 numbers are expected for radt",
        ),
        ("cam1", {"distortion_coeffs": ["a", 2, 3, 4]}, "cam1: distortion_coeffs is ['a', 2, 3, 4"),
        ("cam0", {"resolution": "big"}, "resolution is 'big'; [width, height] in px is expected"),
        ("cam0", {"T_cam_imu": [[1, 0], [0, 1]]}, "T_cam_imu is [[1, 0], [0, 1]]; 4 x 4 finite"),
        ("cam0", {"T_imu_cam": matrix(Cameras().T_LB)}, "has T_cam_imu and T_imu_cam; one of them"),
        ("cam1", {"T_cn_cnm1": matrix(se3.inverse(Cameras().T_RL))}, "differ by 0.22 m and 0.05"),
        ("cam1", {"T_cn_cnm1": "-", "T_cam_imu": "-"}, "cam1 does not say where it stands"),
        ("cam0", {"timeshift_cam_imu": "late"}, "timeshift_cam_imu is 'late'; a finite number"),
    ],
)
def test_a_mistake_in_a_calibration_is_told_by_file_camera_and_key(
    tmp_path: Path, camera: str, changes: dict[str, Any], said: str
) -> None:
    path = write_yaml(tmp_path / "c.yaml", harmed(camchain(Cameras()), camera, **changes))
    with pytest.raises(ForeignFileError) as caught:
        rig_files.read([path], "x")
    assert str(caught.value).startswith(f"{path}: ")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the file is empty"),
        ("a: [1, 2\n", "is no YAML: "),
        ("- 1\n- 2\n", "is YAML without names"),
        ("a: 1\na: 2\n", "is no YAML: found duplicate key"),
        ("x: 1\n", "is no calibration that is known; Kalibr's camchain, sensor.yaml of"),
        ("cam0: 3\n", "has one camera, cam0; cam0 and cam1 are expected"),
        (
            "gyroscope_noise_density: 1e-3\n",
            "is of an IMU alone; one of the cameras is expected too",
        ),
        ("[" * 1500, "is nested too deep"),
        ("x: !!python/object:os.system 1\n", "is no YAML: could not determine a constructor"),
    ],
)
def test_what_is_no_calibration_is_told(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "c.yaml"
    path.write_text(text)
    with pytest.raises(ForeignFileError) as caught:
        rig_files.read([path], "x")
    assert said in str(caught.value)


WRONG: list[Any] = [
    *(0, -1, 1e300, 1e-300, float("nan"), float("inf"), 10**30, "x", "", None, True, [], {}, [[]]),
    *([1, [2]], {"rows": -1, "cols": -16, "data": [1] * 16}, {"rows": 1e30, "cols": 0}),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("cameras", [Cameras(), fisheye()], ids=["radtan", "fisheye"])
def test_a_wrong_value_anywhere_is_refused_or_read_and_never_something_else(
    tmp_path: Path, cameras: Cameras
) -> None:
    chance, refused = random.Random(1), 0
    for _ in range(DAMAGES):
        content: Any = camchain(cameras, FISHEYE_SIZE)
        place, key = content, cast(Any, "cam0")
        while isinstance(place[key], (dict, list)) and (place is content or chance.random() < 0.8):
            place = place[key]
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            key = chance.choice(keys)
        place[key] = chance.choice(WRONG)
        path = write_yaml(tmp_path / "c.yaml", content)
        try:
            rig = rig_files.of_rig(rig_files.read_rig([path]), "x").rig
            assert rig is not None
            rig.rectification().pixels(cameras.see(points(5)))
        except PelorusError:
            refused += 1
    assert DAMAGES // 2 < refused < DAMAGES


def test_metres_are_due_and_cameras_side_by_side(tmp_path: Path) -> None:
    def said(T_RL: Poses) -> str:
        path = tmp_path / "stereo.yml"
        path.write_text(opencv_text(**opencv_matrices(replace(Cameras(), T_RL=T_RL))))
        with pytest.raises(PelorusError) as caught:
            rig_files.read([path], "x")
        return str(caught.value)

    R = Cameras().T_RL.R
    assert "the cameras stand 110 apart; 0.001 to 5 m are expected: are these millimetres" in said(
        Poses(R, np.array([-110.0, 0, 0]))
    )
    assert "cameras side by side are expected" in said(Poses(R, np.array([-0.01, 0.2, 0])))
