# SPDX-License-Identifier: MIT
"""Calibrations of more than two cameras, and kinds that come from camera makers."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pelorus.io.foreign import ForeignFileError
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig import read as rig_files
from pelorus.rig.lens import LensModel
from rigs import (
    IMU_NOISE,
    SIZE,
    Cameras,
    camchain,
    fisheye,
    matrix,
    opencv_matrices,
    opencv_text,
    write_yaml,
)
from test_rig import assert_rectifies
from test_rig_formats import whole

COLOUR = {"intrinsics": [921.0, 921.0, 640.0, 360.0], "resolution": [1280, 720]}


def with_colour(cameras: Cameras, at: int) -> dict[str, Any]:
    """A camchain of three: the pair, and a colour camera between them at this place of the list."""
    pair = list(camchain(cameras).values())
    T = Poses(np.eye(3), np.array([-0.02, 0.0, 0.0]))
    colour = pair[0] | COLOUR | {"rostopic": "/colour", "T_cam_imu": whole_list(T, cameras)}
    del pair[1]["T_cn_cnm1"]
    pair[0]["rostopic"], pair[1]["rostopic"] = "/infra1", "/infra2"
    three = [*pair[:at], colour, *pair[at:]]
    return {f"cam{k}": one for k, one in enumerate(three)}


def whole_list(T: Poses, cameras: Cameras) -> list[list[float]]:
    return matrix(se3.compose(T, cameras.T_LB))


@pytest.mark.parametrize("at", [0, 1, 2])
def test_of_three_cameras_the_two_that_are_alike_are_the_pair(at: int, tmp_path: Path) -> None:
    cameras = Cameras()
    rig = rig_files.read_rig([write_yaml(tmp_path / "c.yaml", with_colour(cameras, at))])
    assert_rectifies(rig, cameras)
    assert rig.topics == ("/infra1", "/infra2")
    names = [f"cam{k}" for k in range(3) if k != at]
    assert f"{names[0]} (/infra1) and {names[1]} (/infra2) are taken of 3" in rig.remarks[0]
    assert "--cameras" in rig.remarks[0]


def test_others_of_three_are_taken_by_name_or_topic(tmp_path: Path) -> None:
    path = write_yaml(tmp_path / "c.yaml", with_colour(Cameras(), 0))
    for asked in (("cam0", "cam2"), ("/colour", "/infra2")):
        rig = rig_files.read_rig([path], cameras=asked)
        assert set(rig.topics) == {"/colour", "/infra2"}
        assert not rig.remarks
    with pytest.raises(ForeignFileError, match="has no camera called cam7; there are: cam0"):
        rig_files.read_rig([path], cameras=("cam0", "cam7"))
    with pytest.raises(ForeignFileError, match="two cameras, parted by a comma"):
        rig_files.read_rig([path], cameras=("cam1",))


def test_of_four_cameras_none_that_looks_backwards_is_of_the_pair(tmp_path: Path) -> None:
    cameras = Cameras()
    pair = list(camchain(cameras).values())
    del pair[1]["T_cn_cnm1"]
    back = Poses(np.diag([-1.0, 1.0, -1.0]), np.zeros(3))
    rear = pair[0] | {"T_cam_imu": whole_list(back, cameras), "rostopic": "/rear"}
    four = {"cam0": rear, "cam1": pair[0], "cam2": pair[1]}
    rig = rig_files.read_rig([write_yaml(tmp_path / "c.yaml", four)])
    assert_rectifies(rig, cameras)


def svo(cameras: Cameras, folder: Path) -> list[Path]:
    kind = {"radtan": "radial-tangential", "equidistant": "equidistant"}[cameras.model]
    T_RB = se3.compose(cameras.T_RL, cameras.T_LB)
    each = [
        {
            "camera": {
                "label": f"/rig/{side}",
                "image_width": SIZE[0],
                "image_height": SIZE[1],
                "type": "pinhole",
                "intrinsics": {"cols": 1, "rows": 4, "data": list(intrinsics)},
                "distortion": {
                    "type": kind,
                    "parameters": {"cols": 1, "rows": 4, "data": list(cameras.coefficients)},
                },
            },
            "T_B_C": {"cols": 4, "rows": 4, "data": np.ravel(whole(se3.inverse(T))).tolist()},
        }
        for side, intrinsics, T in (("a", cameras.left, cameras.T_LB), ("b", cameras.right, T_RB))
    ]
    imu = {"sigma_omega_c": 1.7e-4, "sigma_acc_c": 2e-3, "sigma_acc_bias_c": 0.0}
    content = {"label": "rig", "cameras": each, "imu_params": imu | {"delay_imu_cam": 0.003}}
    return [write_yaml(folder / "svo.yaml", content)]


@pytest.mark.parametrize("cameras", [Cameras(), fisheye()], ids=["radtan", "fisheye"])
def test_the_rig_of_svo_and_maplab_is_read(cameras: Cameras, tmp_path: Path) -> None:
    rig = rig_files.read_rig(svo(cameras, tmp_path))
    assert_rectifies(rig, cameras)
    assert rig.topics == ("/rig/a", "/rig/b")
    noise = rig.imu.noise
    assert (noise.gyro_noise, noise.accel_noise) == (1.7e-4, 2e-3)
    assert noise.accel_walk < 0  # a walk of 0 is one that nobody measured
    assert "delay_imu_cam is not used" in rig.imu.remarks[0]


def depthai(cameras: Cameras, folder: Path, knows_imu: bool = True) -> list[Path]:
    """Colour on socket 0, left on 1, right on 2; each stands where the next one says."""
    none = {"rotationMatrix": [[0.0] * 3] * 3, "translation": dict.fromkeys("xyz", 0.0)}

    def extrinsics(T: Poses, to: int) -> dict[str, Any]:
        p = {axis: 100 * float(x) for axis, x in zip("xyz", T.p, strict=True)}
        return {"rotationMatrix": T.R.tolist(), "translation": p, "toCameraSocket": to}

    def camera(intrinsics: tuple[float, ...], T: dict[str, Any]) -> dict[str, Any]:
        fx, fy, cx, cy = intrinsics
        fish = cameras.model == "equidistant"
        return {
            "cameraType": int(fish),
            "distortionCoeff": [*cameras.coefficients, *[0.0] * 10],
            "extrinsics": T,
            "intrinsicMatrix": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]],
            "width": SIZE[0],
            "height": SIZE[1],
        }

    T_RC = Poses(np.eye(3), np.array([-0.03, 0.0, 0.0]))
    colour = camera((921.0, 921.0, 640.0, 360.0), none | {"toCameraSocket": -1})
    T_CR = se3.inverse(T_RC)
    imu = extrinsics(cameras.T_LB, 1) if knows_imu else none | {"toCameraSocket": -1}
    content = {
        "cameraData": [
            [0, colour],
            [1, camera(cameras.left, extrinsics(cameras.T_RL, 2))],
            [2, camera(cameras.right, extrinsics(T_CR, 0))],
        ],
        "imuExtrinsics": imu,
        "stereoRectificationData": {"leftCameraSocket": 1, "rightCameraSocket": 2},
    }
    (folder / "oak.json").write_text(json.dumps(content))
    return [folder / "oak.json"]


@pytest.mark.parametrize("cameras", [Cameras(), fisheye()], ids=["radtan", "fisheye"])
def test_the_calibration_of_an_oak_is_read_in_centimetres(cameras: Cameras, tmp_path: Path) -> None:
    rig = rig_files.read_rig(depthai(cameras, tmp_path))
    assert_rectifies(rig, cameras)
    assert "CAM_B and CAM_C are taken, the stereo pair that it names" in rig.remarks[0]
    rig = rig_files.read_rig(depthai(cameras, tmp_path), cameras=("CAM_A", "2"))
    assert np.linalg.norm(rig.T_RL.p) == pytest.approx(0.03)


def test_an_oak_that_does_not_know_its_imu_asks_for_the_extrinsic(tmp_path: Path) -> None:
    cameras = Cameras()
    paths = depthai(cameras, tmp_path, knows_imu=False)
    with pytest.raises(ForeignFileError, match="does not say where the camera sits on the body"):
        rig_files.read(paths, "x")
    assert_rectifies(rig_files.read_rig(paths).on_body(cameras.T_LB), cameras)


def test_openvins_configuration_names_the_files_beside_it(tmp_path: Path) -> None:
    cameras = Cameras()
    write_yaml(tmp_path / "chain.yaml", camchain(cameras))
    write_yaml(tmp_path / "noise.yaml", {"imu0": IMU_NOISE})
    config = tmp_path / "estimator_config.yaml"
    config.write_text(
        "%YAML:1.0\nuse_stereo: true\nmax_cameras: 2\n"
        'relative_config_imu: "noise.yaml"\nrelative_config_imucam: "chain.yaml"\n'
    )
    rig = rig_files.read_rig([config])
    assert_rectifies(rig, cameras)
    assert rig.imu.noise.gyro_noise == IMU_NOISE["gyroscope_noise_density"]
    (tmp_path / "noise.yaml").unlink()
    with pytest.raises(ForeignFileError, match=r"noise\.yaml: cannot be read"):
        rig_files.read_rig([config])


def test_opencvs_translation_may_be_a_small_letter(tmp_path: Path) -> None:
    cameras = Cameras()
    matrices = opencv_matrices(cameras)
    matrices["t"] = matrices.pop("T")
    (tmp_path / "s.yml").write_text(opencv_text(**matrices))
    rig = rig_files.read_rig([tmp_path / "s.yml"], LensModel.RADTAN)
    assert_rectifies(rig.on_body(cameras.T_LB), cameras)


def test_kinds_that_are_not_read_are_refused_with_those_that_are(tmp_path: Path) -> None:
    path = tmp_path / "c.json"
    path.write_text(json.dumps({"cameras": [{"focalLengthX": 300.0, "imuToCamera": []}]}))
    with pytest.raises(ForeignFileError, match="calibration"):
        rig_files.read([path], "x")


def test_files_of_an_imu_alone_are_told_from_those_of_cameras(tmp_path: Path) -> None:
    imu = write_yaml(tmp_path / "imu.yaml", IMU_NOISE)
    cameras = write_yaml(tmp_path / "c.yaml", camchain(replace(Cameras())))
    assert rig_files.are_of_imu([imu])
    assert not rig_files.are_of_imu([cameras])
    assert not rig_files.are_of_imu([imu, cameras])
    assert not rig_files.are_of_imu([])
