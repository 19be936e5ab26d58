# SPDX-License-Identifier: MIT
"""Reads the configuration of OKVIS and OKVIS 2: a list of cameras, and an IMU's noise.

T_SC maps points of the camera to the IMU; a picture was taken its delay before its stamp.
"""

from __future__ import annotations

from collections.abc import Sequence

from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named, as_numbers
from pelorus.math import se3
from pelorus.rig import several
from pelorus.rig.imu_model import ImuModel
from pelorus.rig.kalibr import pose
from pelorus.rig.lens import COEFFICIENTS, Lens, LensModel
from pelorus.rig.rig import Rig
from pelorus.wire.frames import Noise

LENSES = {
    "none": LensModel.NONE,
    "radialtangential": LensModel.RADTAN,
    "radialtangential8": LensModel.RADTAN,
    "equidistant": LensModel.EQUIDISTANT,
}
NOISE = {
    "gyro_noise": "sigma_g_c",
    "accel_noise": "sigma_a_c",
    "gyro_walk": "sigma_gw_c",
    "accel_walk": "sigma_aw_c",
}
IMU = ("imu_params", "imu_parameters")
DELAYS = ("imageDelay", "image_delay")


def is_config(content: Named) -> bool:
    """Returns whether it has OKVIS' list of cameras."""
    cameras = content.content.get("cameras")
    return isinstance(cameras, list) and any(
        isinstance(one, dict) and "T_SC" in one for one in cameras
    )


def read(content: Named, asked: Sequence[str] = ()) -> Rig:
    """Reads two cameras: those asked for by number, else the stereo pair."""
    cameras = [
        Named(content.path, one, f"cameras[{k}]") for k, one in enumerate(content.get("cameras"))
    ]
    if len(cameras) < 2:
        raise ForeignFileError(content.path, "has one camera", expected="two are expected")
    known = [
        several.RigCamera((f"cam{k}",), _lens(camera), se3.inverse(pose(camera, "T_SC")))
        for k, camera in enumerate(cameras)
    ]
    rig = several.rig(content.path, known, asked)
    name = next((name for name in IMU if name in content), "")
    told = {}
    if name:
        imu = content.object(name)
        told = {field: imu.number(key) for field, key in NOISE.items() if key in imu}
    holders = [
        content,
        *(content.object(n) for n in ("camera_params", "camera_parameters") if n in content),
    ]
    delays = [one.number(name) for one in holders for name in DELAYS if name in one]
    return rig.with_imu(ImuModel(Noise(**told)), -delays[0] if delays else 0.0)


def _lens(camera: Named) -> Lens:
    model = LENSES[camera.word("distortion_type", tuple(LENSES))]
    name = "distortion_coefficients"
    found = as_numbers(camera.content.get(name, []))
    count = 0 if found is None else found.size
    if model is LensModel.NONE:
        count = 0
    if count not in COEFFICIENTS[model]:
        expected = " or ".join(map(str, COEFFICIENTS[model]))
        raise camera.error(
            name, camera.content.get(name), f"{expected} numbers are expected for {model}"
        )
    D = tuple(camera.array(name, count).tolist()) if count else ()
    (fx, fy), (cx, cy) = camera.array("focal_length", 2), camera.array("principal_point", 2)
    width, height = camera.size("image_dimension")
    return Lens(model, (float(fx), float(fy), float(cx), float(cy)), D, width, height)
