# SPDX-License-Identifier: MIT
"""Calibrations that list cameras with the place of each on an IMU: Basalt's, OKVIS's, SVO's.

Basalt        JSON with everything in value0; T_imu_cam maps points of the camera to the IMU; the
              IMU's clock is the pictures' plus the offset; a corrected reading is (I + S) of the
              measured one minus the bias
OKVIS, 2      T_SC maps points of the camera to the IMU; a picture was taken its delay before its
              stamp
SVO, maplab   each with a `camera` and a T_B_C, which maps its points to the body, which is the IMU
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig import several
from pelorus.rig.imu_model import NOISES, Correction, ImuModel, noise
from pelorus.rig.lens import Lens, LensModel, coefficients, intrinsics
from pelorus.rig.rig import Rig
from pelorus.wire.frames import Noise

# Names of the parameters after fx, fy, cx, cy.
BASALT_LENSES: dict[str, tuple[LensModel, tuple[str, ...]]] = {
    "pinhole": (LensModel.NONE, ()),
    "pinhole-radtan8": (LensModel.RADTAN, ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
    "kb4": (LensModel.EQUIDISTANT, ("k1", "k2", "k3", "k4")),
    "ds": (LensModel.DS, ("xi", "alpha")),
    "eucm": (LensModel.EUCM, ("alpha", "beta")),
    "ucm": (LensModel.EUCM, ("alpha",)),  # with beta 1
}
BASALT_NOISE = ("gyro_noise_std", "accel_noise_std", "gyro_bias_std", "accel_bias_std")
OKVIS_LENSES = {
    "none": LensModel.NONE,
    "radialtangential": LensModel.RADTAN,
    "radialtangential8": LensModel.RADTAN,
    "equidistant": LensModel.EQUIDISTANT,
}
OKVIS_NOISE = ("sigma_g_c", "sigma_a_c", "sigma_gw_c", "sigma_aw_c")
SVO_LENSES = {
    "none": LensModel.NONE,
    "radial-tangential": LensModel.RADTAN,
    "radtan": LensModel.RADTAN,
    "equidistant": LensModel.EQUIDISTANT,
}
SVO_NOISE = ("sigma_omega_c", "sigma_acc_c", "sigma_omega_bias_c", "sigma_acc_bias_c")


def is_basalt(content: Named) -> bool:
    """Returns whether it has Basalt's value0."""
    inner = content.content.get("value0")
    return isinstance(inner, dict) and "T_imu_cam" in inner


def is_okvis(content: Named) -> bool:
    """Returns whether it has OKVIS' list of cameras."""
    return _lists(content, "T_SC")


def is_svo(content: Named) -> bool:
    """Returns whether it has a list of cameras with poses."""
    return _lists(content, "camera", "T_B_C")


def _lists(content: Named, *names: str) -> bool:
    cameras = content.content.get("cameras")
    return isinstance(cameras, list) and any(
        isinstance(one, dict) and one.keys() >= set(names) for one in cameras
    )


def _each(content: Named, name: str) -> list[Named]:
    value = content.get(name)
    if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
        raise content.error(name, value, "a list with an object for each camera is expected")
    at = f"{content.at}.{name}" if content.at else name
    return [Named(content.path, one, f"{at}[{k}]") for k, one in enumerate(value)]


# --- Basalt ---------------------------------------------------------------------------------------


def basalt(content: Named, asked: Sequence[str] = ()) -> Rig:
    """Reads two cameras: those asked for by number, else the stereo pair."""
    whole = content.object("value0")
    poses = [_basalt_pose(one) for one in _each(whole, "T_imu_cam")]
    cameras = _each(whole, "intrinsics")
    sizes = whole.content.get("resolution", [])
    if min(len(poses), len(cameras)) < 2 or len(poses) != len(cameras):
        raise ForeignFileError(
            content.path,
            f"has {len(cameras)} cameras and {len(poses)} of T_imu_cam; two of each are expected",
        )
    known = [
        several.RigCamera(
            (f"cam{k}",),
            _basalt_lens(camera, sizes[k] if k < len(sizes) else [0, 0]),
            se3.inverse(T),
        )
        for k, (camera, T) in enumerate(zip(cameras, poses, strict=True))
    ]
    rig = several.rig(content.path, known, asked)
    return rig.with_imu(_basalt_imu(whole), whole.number("cam_time_offset_ns", 0.0) * 1e-9)


def _basalt_pose(one: Named) -> Poses:
    p = np.array([one.number(f"p{axis}") for axis in "xyz"])
    q = np.array([one.number(f"q{axis}") for axis in "xyzw"])
    if abs(np.linalg.norm(q) - 1) > 1e-2:
        raise ForeignFileError(one.path, "the quaternion's norm is not 1", at=one.at)
    return Poses.of_quaternions(q, p)


def _basalt_lens(camera: Named, size: list[int]) -> Lens:
    kind = camera.word("camera_type", tuple(BASALT_LENSES))
    model, names = BASALT_LENSES[kind]
    numbers = camera.object("intrinsics")
    four = intrinsics(numbers, "fx", "fy", "cx", "cy")
    D = (*(numbers.number(name) for name in names), *((1.0,) if kind == "ucm" else ()))
    return Lens(model, four, D, int(size[0]), int(size[1]))


def _basalt_imu(whole: Named) -> ImuModel:
    told = {}
    for name, key in zip(NOISES, BASALT_NOISE, strict=True):
        if key in whole:  # one number, or the root mean square of three
            axes = whole.array(key, 3) if isinstance(whole.get(key), list) else whole.array(key)
            told[name] = float(np.sqrt(np.mean(axes**2)))
    a, w = (
        whole.array(key, count) if key in whole else np.zeros(count)
        for key, count in (("calib_accel_bias", 9), ("calib_gyro_bias", 12))
    )
    lower = np.zeros((3, 3))
    lower[[0, 1, 2, 1, 2, 2], [0, 0, 0, 1, 1, 2]] = a[3:]
    square = w[3:].reshape(3, 3).T  # column-major
    found = Correction(np.eye(3) + lower, -a[:3], np.eye(3) + square, w_0=-w[:3])
    remark = f"{whole.path}: calib_accel_bias and calib_gyro_bias are applied to the readings"
    return ImuModel(Noise(**told), found, () if found.is_none else (remark,))


# --- OKVIS ----------------------------------------------------------------------------------------


def okvis(content: Named, asked: Sequence[str] = ()) -> Rig:
    """Reads two cameras: those asked for by number, else the stereo pair."""
    cameras = _each(content, "cameras")
    if len(cameras) < 2:
        raise ForeignFileError(content.path, "has one camera; two are expected")
    known = [
        several.RigCamera((f"cam{k}",), _okvis_lens(camera), se3.inverse(camera.pose("T_SC")))
        for k, camera in enumerate(cameras)
    ]
    rig = several.rig(content.path, known, asked)
    imu = content.first_of(("imu_params", "imu_parameters"))
    told = noise(content.object(imu), OKVIS_NOISE) if imu else Noise()
    inner = [content.object(n) for n in ("camera_params", "camera_parameters") if n in content]
    names = ("imageDelay", "image_delay")
    delays = [one.number(name) for one in (content, *inner) for name in names if name in one]
    return rig.with_imu(ImuModel(told), -delays[0] if delays else 0.0)


def _okvis_lens(camera: Named) -> Lens:
    model = OKVIS_LENSES[camera.word("distortion_type", tuple(OKVIS_LENSES))]
    D = coefficients(camera, "distortion_coefficients", model)
    fx, fy = camera.array("focal_length", 2).tolist()
    cx, cy = camera.array("principal_point", 2).tolist()
    return Lens(model, (fx, fy, cx, cy), D, *camera.size("image_dimension"))


# --- SVO and maplab -------------------------------------------------------------------------------


def svo(content: Named, asked: Sequence[str] = ()) -> Rig:
    """Reads two cameras: those asked for by label or number, else the stereo pair."""
    each = _each(content, "cameras")
    if len(each) < 2:
        raise ForeignFileError(content.path, f"has {len(each)} camera; two are expected")
    cameras = [_svo_camera(one, k) for k, one in enumerate(each)]
    return replace(several.rig(content.path, cameras, asked), imu=_svo_imu(content))


def _svo_imu(content: Named) -> ImuModel:
    """Returns the IMU's densities, where SVO's file has nonzero ones."""
    if "imu_params" not in content:
        return ImuModel()
    imu = content.object("imu_params")
    told = {name: value for name, value in vars(noise(imu, SVO_NOISE)).items() if value > 0}
    remark = f"{content.path}: delay_imu_cam is not used; check estimates the clocks' offset"
    delayed = imu.number("delay_imu_cam", 0.0) != 0
    return ImuModel(Noise(**told), remarks=(remark,) if delayed else ())


def _svo_camera(one: Named, k: int) -> several.RigCamera:
    inner = one.object("camera")
    inner.word("type", ("pinhole",))
    size = int(inner.number("image_width")), int(inner.number("image_height"))
    fx, fy, cx, cy = inner.object("intrinsics").array("data", 4).tolist()
    model, D = LensModel.NONE, tuple[float, ...]()
    if "distortion" in inner:
        distortion = inner.object("distortion")
        model = SVO_LENSES[distortion.word("type", tuple(SVO_LENSES))]
        if model is not LensModel.NONE:
            D = coefficients(distortion.object("parameters"), "data", model)
    lens = Lens(model, (fx, fy, cx, cy), D, *size)
    label = str(inner.content.get("label", ""))
    return several.RigCamera((f"cam{k}", label), lens, se3.inverse(one.pose("T_B_C")))
