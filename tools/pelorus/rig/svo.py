# SPDX-License-Identifier: MIT
"""Reads SVO's and maplab's camera rigs: a list `cameras`, each with a `camera` and a T_B_C.

T_B_C maps points of the camera to the body, which is the IMU.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.rig import several
from pelorus.rig.imu_model import ImuModel
from pelorus.rig.kalibr import pose
from pelorus.rig.lens import COEFFICIENTS, Lens, LensModel
from pelorus.rig.rig import Rig
from pelorus.wire.frames import Noise

LENSES = {
    "none": LensModel.NONE,
    "radial-tangential": LensModel.RADTAN,
    "radtan": LensModel.RADTAN,
    "equidistant": LensModel.EQUIDISTANT,
}
NOISE = {
    "gyro_noise": "sigma_omega_c",
    "accel_noise": "sigma_acc_c",
    "gyro_walk": "sigma_omega_bias_c",
    "accel_walk": "sigma_acc_bias_c",
}
ON_BODY = "T_B_C"


def is_rig(content: Named) -> bool:
    """Returns whether it has a list of cameras with poses."""
    cameras = content.content.get("cameras")
    return isinstance(cameras, list) and any(
        isinstance(one, dict) and "camera" in one and ON_BODY in one for one in cameras
    )


def read(content: Named, asked: Sequence[str] = ()) -> Rig:
    """Reads two cameras: those asked for by label or number, else the stereo pair."""
    listed = content.get("cameras")
    if len(listed) < 2 or not all(isinstance(one, dict) for one in listed):
        raise ForeignFileError(content.path, f"has {len(listed)} camera; two are expected")
    each = [Named(content.path, one, f"cameras[{k}]") for k, one in enumerate(listed)]
    cameras = [_camera(one, k) for k, one in enumerate(each)]
    return replace(several.rig(content.path, cameras, asked), imu=_imu(content))


def _imu(content: Named) -> ImuModel:
    """Returns the IMU's densities, where SVO's file has nonzero ones."""
    if "imu_params" not in content:
        return ImuModel()
    imu = content.object("imu_params")
    told = {field: imu.number(key) for field, key in NOISE.items() if key in imu}
    remarks: tuple[str, ...] = ()
    if "delay_imu_cam" in imu and imu.number("delay_imu_cam"):
        remarks = (
            f"{content.path}: delay_imu_cam is not used; check estimates the clocks' offset",
        )
    return ImuModel(
        Noise(**{field: value for field, value in told.items() if value > 0}), remarks=remarks
    )


def _camera(one: Named, k: int) -> several.RigCamera:
    inner = one.object("camera")
    inner.word("type", ("pinhole",))
    size = int(inner.number("image_width")), int(inner.number("image_height"))
    fx, fy, cx, cy = inner.object("intrinsics").array("data", 4).tolist()
    model, D = _distortion(inner)
    lens = Lens(model, (fx, fy, cx, cy), D, *size)
    label = str(inner.content.get("label", ""))
    return several.RigCamera((f"cam{k}", label), lens, se3.inverse(pose(one, ON_BODY)))


def _distortion(camera: Named) -> tuple[LensModel, tuple[float, ...]]:
    if "distortion" not in camera:
        return LensModel.NONE, ()
    distortion = camera.object("distortion")
    model = LENSES[distortion.word("type", tuple(LENSES))]
    if model is LensModel.NONE:
        return model, ()
    parameters = distortion.object("parameters")
    count = len(parameters.get("data"))
    if count not in COEFFICIENTS[model]:
        expected = " or ".join(map(str, COEFFICIENTS[model]))
        raise parameters.error(
            "data", parameters.get("data"), f"{expected} numbers are expected for {model}"
        )
    return model, tuple(parameters.array("data", count).tolist())
