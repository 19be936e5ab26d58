# SPDX-License-Identifier: MIT
"""Lenses that go by a sphere, and the errors of an IMU, as calibrations of other programs say."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pelorus.math import se3
from pelorus.math.inertial import Inertial
from pelorus.math.se3 import Poses
from pelorus.rig import read as rig_files
from pelorus.rig.lens import Lens, LensModel
from rigs import (
    IMU_NOISE,
    Cameras,
    camchain,
    matrix,
    write_yaml,
)
from scipy.spatial.transform import Rotation
from test_rig_formats import PLAIN, basalt

Floats = NDArray[np.float64]


# --- lenses that go by a sphere -------------------------------------------------------------------


def omni(rays: Floats, numbers: tuple[float, ...]) -> Floats:
    xi, k1, k2, p1, p2 = numbers
    X = np.column_stack((rays, np.ones(len(rays))))
    X /= np.linalg.norm(X, axis=1)[:, None]
    x, y = X[:, 0] / (X[:, 2] + xi), X[:, 1] / (X[:, 2] + xi)
    r2 = x * x + y * y
    bend = 1 + k1 * r2 + k2 * r2 * r2
    return np.stack(
        (
            x * bend + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * bend + 2 * p2 * x * y + p1 * (r2 + 2 * y * y),
        ),
        axis=-1,
    )


def double_sphere(rays: Floats, numbers: tuple[float, ...]) -> Floats:
    xi, alpha = numbers
    x, y, z = rays[:, 0], rays[:, 1], np.ones(len(rays))
    d1 = np.sqrt(x * x + y * y + z * z)
    d2 = np.sqrt(x * x + y * y + (xi * d1 + z) ** 2)
    return np.asarray(rays / (alpha * d2 + (1 - alpha) * (xi * d1 + z))[:, None])


def enhanced(rays: Floats, numbers: tuple[float, ...]) -> Floats:
    alpha, beta = numbers
    d = np.sqrt(beta * (rays**2).sum(axis=1) + 1)
    return np.asarray(rays / (alpha * d + 1 - alpha)[:, None])


@pytest.mark.parametrize(
    ("model", "formula", "numbers"),
    [
        (LensModel.OMNI, omni, (1.8162, -0.0523, 0.537, -3.6e-4, -2.6e-4)),
        (LensModel.OMNI, omni, (0.895, -0.275, -0.0064, -1e-4, -2.8e-3)),
        (LensModel.DS, double_sphere, (-0.24, 0.57)),
        (LensModel.DS, double_sphere, (0.31, 0.66)),
        (LensModel.EUCM, enhanced, (0.62, 1.08)),
    ],
)
def test_a_lens_by_way_of_a_sphere_bends_as_its_formula_says_and_back(
    model: LensModel, formula: Callable[[Floats, Any], Floats], numbers: tuple[float, ...]
) -> None:
    f, middle = 380.0, np.array([367.0, 248.0])
    lens = Lens(model, (f, f + 1, 367.0, 248.0), numbers)
    chance = np.random.default_rng(4)
    rays = chance.uniform(-1.5, 1.5, (400, 2))
    due = formula(rays, numbers) * [f, f + 1] + middle
    assert np.abs(lens.distort(rays) - due).max() < 1e-9
    assert np.abs(lens.undistort(due) - rays).max() < 1e-7
    assert np.isnan(lens.undistort(np.array([[9e4, 0.0]]))).all()


@pytest.mark.parametrize("model", ["omni", "ds", "eucm"])
def test_kalibr_and_basalt_name_the_numbers_of_a_sphere(model: str, tmp_path: Path) -> None:
    first = {"omni": [1.2], "ds": [-0.2, 0.55], "eucm": [0.6, 1.1]}[model]
    content = camchain(Cameras("radtan"), camera_model=model)
    for camera in content.values():
        camera["intrinsics"] = [*first, *camera["intrinsics"]]
        if model != "omni":
            camera |= {"distortion_model": "none", "distortion_coeffs": []}
    rig = rig_files.read_rig([write_yaml(tmp_path / "c.yaml", content)])
    D = Cameras().coefficients if model == "omni" else ()
    assert rig.left.coefficients == (*first, *D)
    assert rig.left.model == model
    assert rig.rectification().camera.fx_px > 100
    if model == "omni":
        return
    path = basalt(PLAIN, tmp_path)[0]
    content = json.loads(path.read_text())
    names = {"ds": ("xi", "alpha"), "eucm": ("alpha", "beta")}[model]
    for camera in content["value0"]["intrinsics"]:
        camera["camera_type"] = model
        camera["intrinsics"] |= dict(zip(names, first, strict=True))
    path.write_text(json.dumps(content))
    assert rig_files.read_rig([path]).left.coefficients == tuple(first)


# --- the errors of an IMU -------------------------------------------------------------------------


def readings() -> Inertial:
    chance = np.random.default_rng(6)
    a, w = chance.normal((0, 0, 9.8), 3, (40, 3)), chance.normal(0, 1, (40, 3))
    return Inertial(np.arange(40), a, w)


def test_kalibrs_models_of_an_imu_are_taken_out_of_its_readings_and_told(tmp_path: Path) -> None:
    right = readings()
    M_a = np.array([[1.013, 0, 0], [-0.02, 0.99, 0], [0.004, 0.01, 1.02]])
    M_g = np.array([[0.98, 0, 0], [0.011, 1.01, 0], [-0.006, 0.003, 1.015]])
    A = np.array([[1e-3, -2e-4, 0], [3e-4, 1e-4, 2e-3], [0, 1e-3, -5e-4]])
    C = Rotation.from_rotvec([0.02, -0.03, 0.01]).as_matrix()
    measured = Inertial(
        right.t_ns,
        right.a_B_mps2 @ M_a.T,
        right.w_B_radps @ (M_g @ C).T + right.a_B_mps2 @ (A @ C).T,
    )
    imu = IMU_NOISE | {
        "model": "scale-misalignment-size-effect",
        "accelerometers": {"M": M_a.tolist(), "rx_i": [0, 0, 0], "ry_i": [0, 0, 0.01]},
        "gyroscopes": {"M": M_g.tolist(), "A": A.tolist(), "C_gyro_i": C.tolist()},
        "time_offset": -0.0071,
    }
    cameras = write_yaml(tmp_path / "c.yaml", camchain(Cameras(), timeshift_cam_imu=0.01))
    rig = rig_files.read_rig([cameras, write_yaml(tmp_path / "imu.yaml", {"imu0": imu})])
    found = rig.imu.correction.of(measured)
    assert np.abs(found.a_B_mps2 - right.a_B_mps2).max() < 1e-9
    assert np.abs(found.w_B_radps - right.w_B_radps).max() < 1e-9
    assert rig.offset_s == pytest.approx(0.0171), "the pictures' clock, on this IMU's"
    told = " ".join(rig.imu.remarks)
    for said in ("scale-misalignment-size-effect: its errors are taken out", "rx_i, ry_i: where",
                 "time_offset: the pictures come -0.0071 s earlier"):  # fmt: skip
        assert said in told
    plain = {"imu0": IMU_NOISE | {"T_i_b": np.eye(4).tolist(), "time_offset": 0.0}}
    rig = rig_files.read_rig([cameras, write_yaml(tmp_path / "imu.yaml", plain)])
    assert rig.imu.remarks == ()
    assert rig.imu.correction.is_none


def test_a_second_imu_stands_where_kalibr_says(tmp_path: Path) -> None:
    T_ib = Poses(Rotation.from_rotvec([0.4, 0.1, -0.3]).as_matrix(), np.array([0.1, -0.2, 0.05]))
    cameras = write_yaml(tmp_path / "c.yaml", camchain(Cameras()))
    imu = {"imu0": IMU_NOISE | {"T_i_b": matrix(T_ib)}}
    rig = rig_files.read_rig([cameras, write_yaml(tmp_path / "imu.yaml", imu)])
    due = se3.compose(Cameras().T_LB, se3.inverse(T_ib))
    assert rig.T_LB is not None
    assert np.abs(se3.log(se3.compose(rig.T_LB, se3.inverse(due)))).max() < 1e-9


def test_basalts_biases_are_taken_off(tmp_path: Path) -> None:
    path = basalt(Cameras(), tmp_path)[0]
    content = json.loads(path.read_text())
    a = [0.1, -0.2, 0.3, 0.01, 0.002, 0.003, -0.02, 0.004, 0.03]
    w = [0.01, 0.02, -0.03, 0.01, 0.002, 0.003, 0.004, -0.02, 0.006, 0.007, 0.008, 0.03]
    content["value0"] |= {"calib_accel_bias": a, "calib_gyro_bias": w}
    path.write_text(json.dumps(content))
    imu, raw = rig_files.read_rig([path]).imu, readings()
    S_a = np.array([[0.01, 0, 0], [0.002, -0.02, 0], [0.003, 0.004, 0.03]])
    S_g = np.array([[0.01, 0.004, 0.007], [0.002, -0.02, 0.008], [0.003, 0.006, 0.03]])
    found = imu.correction.of(raw)
    assert np.allclose(found.a_B_mps2, raw.a_B_mps2 @ (np.eye(3) + S_a).T - a[:3])
    assert np.allclose(found.w_B_radps, raw.w_B_radps @ (np.eye(3) + S_g).T - w[:3])
    assert "calib_accel_bias and calib_gyro_bias are applied" in imu.remarks[0]
