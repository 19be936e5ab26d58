# SPDX-License-Identifier: MIT
"""Reads Basalt's calibration: JSON with everything in value0.

T_imu_cam maps points of the camera to the IMU; the IMU's clock is the pictures' plus the offset; a
corrected reading is (I + S) of the measured one minus the bias.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig import several
from pelorus.rig.imu_model import Correction, ImuModel
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rig import Rig
from pelorus.wire.frames import Noise
from pelorus.wire.layout import Floats

# Names of the parameters after fx, fy, cx, cy.
LENSES: dict[str, tuple[LensModel, tuple[str, ...]]] = {
    "pinhole": (LensModel.NONE, ()),
    "pinhole-radtan8": (LensModel.RADTAN, ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
    "kb4": (LensModel.EQUIDISTANT, ("k1", "k2", "k3", "k4")),
    "ds": (LensModel.DS, ("xi", "alpha")),
    "eucm": (LensModel.EUCM, ("alpha", "beta")),
    "ucm": (LensModel.EUCM, ("alpha",)),  # with beta 1
}
NOISE = {
    "gyro_noise": "gyro_noise_std",
    "accel_noise": "accel_noise_std",
    "gyro_walk": "gyro_bias_std",
    "accel_walk": "accel_bias_std",
}


def is_calibration(content: Named) -> bool:
    """Returns whether it has Basalt's value0."""
    inner = content.content.get("value0")
    return isinstance(inner, dict) and "T_imu_cam" in inner


def read(content: Named, asked: Sequence[str] = ()) -> Rig:
    """Reads two cameras: those asked for by number, else the stereo pair."""
    whole = content.object("value0")
    poses = [_pose(one) for one in _each(whole, "T_imu_cam")]
    cameras = _each(whole, "intrinsics")
    sizes = whole.content.get("resolution", [])
    if min(len(poses), len(cameras)) < 2 or len(poses) != len(cameras):
        raise ForeignFileError(
            content.path,
            f"has {len(cameras)} cameras and {len(poses)} of T_imu_cam; two of each are expected",
        )
    lenses = [
        _lens(camera, sizes[k] if k < len(sizes) else [0, 0]) for k, camera in enumerate(cameras)
    ]
    known = [
        several.RigCamera((f"cam{k}",), lens, se3.inverse(T))
        for k, (lens, T) in enumerate(zip(lenses, poses, strict=True))
    ]
    rig = several.rig(content.path, known, asked)
    name = "cam_time_offset_ns"
    offset_s = whole.number(name) * 1e-9 if name in whole else 0.0
    return rig.with_imu(_imu(whole), offset_s)


def _each(whole: Named, name: str) -> list[Named]:
    value = whole.get(name)
    if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
        raise whole.error(name, value, "a list with an object for each camera is expected")
    return [Named(whole.path, one, f"value0.{name}[{k}]") for k, one in enumerate(value)]


def _pose(one: Named) -> Poses:
    p = np.array([one.number(f"p{axis}") for axis in "xyz"])
    q = np.array([one.number(f"q{axis}") for axis in "xyzw"])
    if abs(np.linalg.norm(q) - 1) > 1e-2:
        raise ForeignFileError(one.path, "the quaternion's norm is not 1", at=one.at)
    return Poses(scipy.spatial.transform.Rotation.from_quat(q).as_matrix(), p)


def _lens(camera: Named, size: list[int]) -> Lens:
    model, names = LENSES[camera.word("camera_type", tuple(LENSES))]
    numbers = camera.object("intrinsics")
    fx, fy, cx, cy = (numbers.number(name) for name in ("fx", "fy", "cx", "cy"))
    coefficients = tuple(numbers.number(name) for name in names)
    if camera.content["camera_type"] == "ucm":
        coefficients = (*coefficients, 1.0)
    return Lens(model, (fx, fy, cx, cy), coefficients, int(size[0]), int(size[1]))


def _imu(whole: Named) -> ImuModel:
    told = {name: _one(whole, key) for name, key in NOISE.items() if key in whole}
    a, w = np.zeros(9), np.zeros(12)
    if "calib_accel_bias" in whole:
        a = whole.array("calib_accel_bias", 9)
    if "calib_gyro_bias" in whole:
        w = whole.array("calib_gyro_bias", 12)
    lower = np.zeros((3, 3))
    lower[[0, 1, 2, 1, 2, 2], [0, 0, 0, 1, 1, 2]] = a[3:]
    square = w[3:].reshape(3, 3).T  # column-major
    found = Correction(np.eye(3) + lower, -a[:3], np.eye(3) + square, w_0=-w[:3])
    remark = f"{whole.path}: calib_accel_bias and calib_gyro_bias are applied to the readings"
    return ImuModel(Noise(**told), found, () if found.is_none else (remark,))


def _one(whole: Named, name: str) -> float:
    """Returns one number, or the root mean square of three."""
    value: Floats = np.atleast_1d(
        whole.array(name, 3) if isinstance(whole.get(name), list) else whole.array(name)
    )
    return float(np.sqrt(np.mean(value**2)))
