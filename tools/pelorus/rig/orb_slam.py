# SPDX-License-Identifier: MIT
"""Settings of ORB-SLAM2 and ORB-SLAM3: names with dots, in two generations.

of ORB-SLAM3 1.0   Camera1.fx, Camera2.fx, Stereo.T_c1_c2 or Stereo.b, IMU.T_b_c1
before             Camera.fx, LEFT.K and RIGHT.K with R and P, or Tlr, or Camera.bf; Tbc

T_b_c1 and Tbc bring points of the left camera to the IMU, T_c1_c2 and Tlr those of the right one to
the left one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig.camera_info import Info, Infos
from pelorus.rig.imu_model import ImuModel
from pelorus.rig.kalibr import matrix, pose
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rig import Rig
from pelorus.wire.frames import Noise

NOISE = {
    "gyro_noise": "IMU.NoiseGyro",
    "accel_noise": "IMU.NoiseAcc",
    "gyro_walk": "IMU.GyroWalk",
    "accel_walk": "IMU.AccWalk",
}
STEPS, ON_BODY = ("Stereo.T_c1_c2", "Tlr"), ("IMU.T_b_c1", "Tbc")
TYPES = ("PinHole", "Rectified", "KannalaBrandt8")


def is_settings(content: Named) -> bool:
    """Returns whether it has the left camera's focal length."""
    return "Camera1.fx" in content or "Camera.fx" in content


def read(content: Named) -> Rig:
    """Reads the pair, and the IMU where there is one."""
    T_BL = next((pose(content, name) for name in ON_BODY if name in content), None)
    T_LB = None if T_BL is None else se3.inverse(T_BL)
    if "LEFT.K" in content:
        infos = Infos(_info(content, "LEFT"), _info(content, "RIGHT"), rectified=False)
        rig = infos.rig()
        rig = rig if T_LB is None else rig.on_body(T_LB)
    else:
        rig = _pair(content, T_LB)
    told = {name: content.number(key) for name, key in NOISE.items() if key in content}
    return replace(rig, imu=ImuModel(Noise(**told)))


def _pair(content: Named, T_LB: Poses | None) -> Rig:
    first = "Camera1" if "Camera1.fx" in content else "Camera"
    kind = content.word("Camera.type", TYPES) if "Camera.type" in content else "PinHole"
    left = _lens(content, first, kind)
    step = next((name for name in STEPS if name in content), "")
    if step:
        right = _lens(content, "Camera2", kind)
        return Rig.of_cameras(content.path, left, right, se3.inverse(pose(content, step)), T_LB)
    if "Stereo.b" in content:
        baseline_m = content.number("Stereo.b")
    elif "Camera.bf" in content:
        baseline_m = content.number("Camera.bf") / left.intrinsics[0]
    else:
        raise ForeignFileError(
            content.path,
            f"is of one camera; {' or '.join(STEPS)}, Stereo.b, LEFT.K and RIGHT.K, or Camera.bf "
            "is expected",
        )
    if any(left.coefficients):
        raise ForeignFileError(
            content.path,
            f"has a baseline alone, and a distortion ({first}.k1); {' or '.join(STEPS)} is "
            "expected; with a baseline alone the pictures are rectified",
        )
    plain = Lens(LensModel.NONE, left.intrinsics, (), left.width_px, left.height_px)
    T_RL = Poses(np.eye(3), np.array([-baseline_m, 0.0, 0.0]))
    return Rig.of_cameras(content.path, plain, plain, T_RL, T_LB)


def _lens(content: Named, camera: str, kind: str) -> Lens:
    fx, fy, cx, cy = (content.number(f"{camera}.{name}") for name in ("fx", "fy", "cx", "cy"))
    size = ("Camera.width", "Camera.height")
    width, height = (int(content.number(name)) if name in content else 0 for name in size)
    names = ("k1", "k2", "k3", "k4") if kind == "KannalaBrandt8" else ("k1", "k2", "p1", "p2", "k3")
    D = [content.number(f"{camera}.{n}") if f"{camera}.{n}" in content else 0.0 for n in names]
    model = LensModel.NONE
    if kind == "KannalaBrandt8":
        model = LensModel.EQUIDISTANT
    elif kind == "PinHole" and any(D):
        model = LensModel.RADTAN
    coefficients = () if model is LensModel.NONE else tuple(D)
    return Lens(model, (fx, fy, cx, cy), coefficients, width, height)


def _info(content: Named, side: str) -> Info:
    D = content.object(f"{side}.D")
    count = int(D.number("rows") * D.number("cols"))
    return Info(
        content.path,
        side,
        matrix(content, f"{side}.K", 3, 3),
        D.array("data", count),
        matrix(content, f"{side}.R", 3, 3),
        matrix(content, f"{side}.P", 3, 4),
        "equidistant" if content.content.get("Camera.type") == "KannalaBrandt8" else "plumb_bob",
        int(content.number(f"{side}.width")) if f"{side}.width" in content else 0,
        int(content.number(f"{side}.height")) if f"{side}.height" in content else 0,
    )
