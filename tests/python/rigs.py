# SPDX-License-Identifier: MIT
"""Stereo cameras with known lenses, and their calibrations as other programs write them.

What a lens does is written down here a second time, in plain formulas: nothing of it is the
project's or OpenCV's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pelorus.math import se3
from pelorus.math.se3 import Poses
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

RADTAN = (-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05)
FISHEYE = (0.0034, 0.0007, -0.0020, 0.0002)
SIZE = (752, 480)
RIGHT_OF_LEFT = Poses(
    Rotation.from_rotvec([0.01, -0.02, 0.015]).as_matrix(), np.array([-0.11, 0.001, -0.002])
)
# A camera that looks forward from a body with x forward, y left, z up, pitched down a little.
ON_BODY = Poses(
    Rotation.from_rotvec([0.1, 0.02, 0]).as_matrix()
    @ np.array([[0, -1.0, 0], [0, 0, -1], [1, 0, 0]]),
    np.array([0.02, 0.03, -0.1]),
)


@dataclass(frozen=True)
class Cameras:
    """`model` is Kalibr's name of it; T_RL brings the left camera's points to the right one."""

    model: str = "radtan"
    left: tuple[float, ...] = (458.654, 457.296, 367.215, 248.375)
    right: tuple[float, ...] = (457.587, 456.134, 379.999, 255.238)
    coefficients: tuple[float, ...] = RADTAN
    T_RL: Poses = RIGHT_OF_LEFT
    T_LB: Poses = ON_BODY

    def see(self, q_L: Floats) -> Floats:
        """(n, 3) points in the left camera -> (n, 4) px, uL vL uR vR, as the cameras take them."""
        return np.hstack(
            (
                lens(self.model, self.left, self.coefficients, q_L),
                lens(self.model, self.right, self.coefficients, se3.apply(self.T_RL, q_L)),
            )
        )


def lens(model: str, intrinsics: tuple[float, ...], D: tuple[float, ...], points: Floats) -> Floats:
    """(n, 3) -> (n, 2) px."""
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    r = np.hypot(x, y)
    if model == "radtan":
        k1, k2, p1, p2 = D
        radial = 1 + k1 * r**2 + k2 * r**4
        xd = x * radial + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2)
        yd = y * radial + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y
    elif model == "equidistant":
        theta = np.arctan(r)
        k1, k2, k3, k4 = D
        bent = theta * (1 + k1 * theta**2 + k2 * theta**4 + k3 * theta**6 + k4 * theta**8)
        scale = np.where(r > 1e-12, bent / np.maximum(r, 1e-12), 1.0)
        xd, yd = x * scale, y * scale
    else:
        xd, yd = x, y
    fx, fy, cx, cy = intrinsics
    return np.stack((fx * xd + cx, fy * yd + cy), axis=-1)


def fisheye() -> Cameras:
    """As of TUM's visual-inertial data set: 190 px for 512."""
    return Cameras(
        "equidistant",
        (190.978, 190.973, 254.93, 256.897),
        (190.442, 190.434, 252.597, 254.917),
        FISHEYE,
    )


def points(count: int = 200, seed: int = 1) -> Floats:
    """In sight of both, 2 to 20 m away."""
    chance = np.random.default_rng(seed)
    depth = chance.uniform(2, 20, count)
    x, y = chance.uniform(-0.6, 0.6, count), chance.uniform(-0.4, 0.4, count)
    return np.stack((x * depth, y * depth, depth), axis=-1)


def matrix(T: Poses) -> list[list[float]]:
    """4 x 4, to the digits that a file has."""
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = T
    return [[float(f"{value:.12g}") for value in row] for row in whole]


def write_yaml(path: Path, content: dict[str, Any]) -> Path:
    """As Kalibr does."""
    with path.open("w") as stream:
        YAML(typ="safe", pure=True).dump(content, stream)
    return path


def camchain(cameras: Cameras, size: tuple[int, int] = SIZE, **more: Any) -> dict[str, Any]:
    """Kalibr's camchain-imucam; `more` goes into both cameras."""
    both = [
        {
            "camera_model": "pinhole",
            "intrinsics": list(intrinsics),
            "distortion_model": cameras.model,
            "distortion_coeffs": list(cameras.coefficients),
            "resolution": list(size),
            "rostopic": f"/cam{k}/image_raw",
            "T_cam_imu": matrix(T),
            "timeshift_cam_imu": 0.0,
        }
        | more
        for k, (intrinsics, T) in enumerate(
            (
                (cameras.left, cameras.T_LB),
                (cameras.right, se3.compose(cameras.T_RL, cameras.T_LB)),
            )
        )
    ]
    both[1]["T_cn_cnm1"] = matrix(cameras.T_RL)
    return {"cam0": both[0], "cam1": both[1]}


IMU_NOISE = {
    "gyroscope_noise_density": 1.7e-4,
    "gyroscope_random_walk": 2e-5,
    "accelerometer_noise_density": 2e-3,
    "accelerometer_random_walk": 3e-3,
}


def opencv_text(**matrices: Any) -> str:
    """As cv::FileStorage writes it: a directive that is no YAML, and matrices with a tag."""
    lines = ["%YAML:1.0", "---"]
    for name, value in matrices.items():
        if isinstance(value, str):
            lines.append(f"{name}: {value}")
            continue
        array = np.atleast_2d(np.asarray(value, np.float64))
        numbers = ", ".join(f"{number:.16e}" for number in array.ravel())
        rows, columns = array.shape
        lines += [
            f"{name}: !!opencv-matrix",
            f"   rows: {rows}",
            f"   cols: {columns}",
            "   dt: d",
            f"   data: [ {numbers} ]",
        ]
    return "\n".join([*lines, ""])


def opencv_matrices(cameras: Cameras) -> dict[str, Any]:
    """K1 D1 K2 D2 R T imageSize."""

    def K(numbers: tuple[float, ...]) -> Floats:
        fx, fy, cx, cy = numbers
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    D = [*cameras.coefficients] + [0.0] * (cameras.model == "radtan")
    return {
        "K1": K(cameras.left),
        "D1": [D],
        "K2": K(cameras.right),
        "D2": [D],
        "R": cameras.T_RL.R,
        "T": cameras.T_RL.p[:, None],
        "imageSize": f"[ {SIZE[0]}, {SIZE[1]} ]",
    }
