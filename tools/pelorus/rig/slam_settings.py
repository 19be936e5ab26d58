# SPDX-License-Identifier: MIT
"""Settings of SLAM programs with the cameras of a pair: ORB-SLAM2 and 3, VINS-Fusion.

ORB-SLAM3 1.0      Camera1.fx, Camera2.fx, Stereo.T_c1_c2 or Stereo.b, IMU.T_b_c1
ORB-SLAM before    Camera.fx, LEFT.K and RIGHT.K with R and P, or Tlr, or Camera.bf; Tbc
VINS-Fusion        a configuration, and the files of its two cameras (camodocal's)

T_b_c1 and Tbc bring points of the left camera to the IMU, T_c1_c2 and Tlr those of the right one to
the left one. VINS-Fusion's body_T_cam0 maps points of the camera to the IMU; the IMU's clock is the
pictures' plus td.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pelorus.io import foreign
from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig.camera_info import Info, Infos
from pelorus.rig.imu_model import ImuModel, noise
from pelorus.rig.lens import Lens, LensModel, intrinsics
from pelorus.rig.rig import Rig

ORB_NOISE = ("IMU.NoiseGyro", "IMU.NoiseAcc", "IMU.GyroWalk", "IMU.AccWalk")
STEPS, ON_BODY = ("Stereo.T_c1_c2", "Tlr"), ("IMU.T_b_c1", "Tbc")
ORB_TYPES = ("PinHole", "Rectified", "KannalaBrandt8")
VINS_CAMERAS = ("cam0", "cam1")
VINS_MODELS = ("PINHOLE", "KANNALA_BRANDT", "MEI")
VINS_NOISE = ("acc_n", "gyr_n", "acc_w", "gyr_w")


# --- ORB-SLAM -------------------------------------------------------------------------------------


def is_orb(content: Named) -> bool:
    """Returns whether it has the left camera's focal length."""
    return "Camera1.fx" in content or "Camera.fx" in content


def orb(content: Named) -> Rig:
    """Reads the pair, and the IMU where there is one."""
    on_body = content.first_of(ON_BODY)
    T_LB = se3.inverse(content.pose(on_body)) if on_body else None
    if "LEFT.K" in content:
        rig = Infos(_orb_info(content, "LEFT"), _orb_info(content, "RIGHT"), False).rig()
        rig = rig if T_LB is None else rig.on_body(T_LB)
    else:
        rig = _orb_pair(content, T_LB)
    return replace(rig, imu=ImuModel(noise(content, ORB_NOISE)))


def _orb_pair(content: Named, T_LB: Poses | None) -> Rig:
    first = "Camera1" if "Camera1.fx" in content else "Camera"
    kind = content.word("Camera.type", ORB_TYPES) if "Camera.type" in content else "PinHole"
    left = _orb_lens(content, first, kind)
    if step := content.first_of(STEPS):
        right = _orb_lens(content, "Camera2", kind)
        return Rig.of_cameras(content.path, left, right, se3.inverse(content.pose(step)), T_LB)
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
    plain = replace(left, model=LensModel.NONE, coefficients=())
    T_RL = Poses(np.eye(3), np.array([-baseline_m, 0.0, 0.0]))
    return Rig.of_cameras(content.path, plain, plain, T_RL, T_LB)


def _orb_lens(content: Named, camera: str, kind: str) -> Lens:
    four = intrinsics(content, *(f"{camera}.{name}" for name in ("fx", "fy", "cx", "cy")))
    width, height = (int(content.number(f"Camera.{side}", 0.0)) for side in ("width", "height"))
    fisheye = kind == "KannalaBrandt8"
    names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
    D = tuple(content.number(f"{camera}.{name}", 0.0) for name in names)
    if not fisheye and not (kind == "PinHole" and any(D)):
        return Lens(LensModel.NONE, four, (), width, height)
    return Lens(LensModel.EQUIDISTANT if fisheye else LensModel.RADTAN, four, D, width, height)


def _orb_info(content: Named, side: str) -> Info:
    return Info(
        content.path,
        side,
        content.matrix(f"{side}.K", 3, 3),
        content.row(f"{side}.D"),
        content.matrix(f"{side}.R", 3, 3),
        content.matrix(f"{side}.P", 3, 4),
        "equidistant" if content.content.get("Camera.type") == "KannalaBrandt8" else "plumb_bob",
        int(content.number(f"{side}.width", 0.0)),
        int(content.number(f"{side}.height", 0.0)),
    )


# --- VINS-Fusion ----------------------------------------------------------------------------------


def is_vins(content: Named) -> bool:
    """Returns whether it is the configuration, or a camera's file."""
    return _is_config(content) or _is_camera(content)


def _is_config(content: Named) -> bool:
    return "cam0_calib" in content and "num_of_cam" in content


def _is_camera(content: Named) -> bool:
    return "model_type" in content and "projection_parameters" in content


def vins(contents: list[Named]) -> Rig:
    """Reads the configuration, and the cameras' files beside it if they are not given."""
    configs = [content for content in contents if _is_config(content)]
    if len(configs) != 1:
        raise ForeignFileError(
            contents[0].path,
            "is of one camera, and does not say where it stands; VINS-Fusion's configuration "
            "(body_T_cam0, cam0_calib) is expected with it",
        )
    config = configs[0]
    if config.number("num_of_cam") != 2:
        raise ForeignFileError(config.path, "is not of two cameras; num_of_cam: 2 is expected")
    T_B1, T_B2 = (config.pose(f"body_T_{camera}") for camera in VINS_CAMERAS)
    left, right = (
        _vins_lens(_vins_camera(config, contents, f"{camera}_calib")) for camera in VINS_CAMERAS
    )
    has_imu = config.number("imu", 1.0) != 0
    topics = [str(config.get(f"image{k}_topic")) for k in (0, 1) if f"image{k}_topic" in config]
    T_1B = se3.inverse(T_B1) if has_imu else None
    T_21 = se3.compose(se3.inverse(T_B2), T_B1)
    rig = Rig.of_cameras(config.path, left, right, T_21, T_1B, topics)
    told = ", ".join(name for name in VINS_NOISE if name in config)
    remark = f"{config.path}: {told} are sigmas of single readings: not used"
    imu = ImuModel(remarks=(remark,) if has_imu and told else ())
    return rig.with_imu(imu, config.number("td", 0.0))


def _vins_camera(config: Named, contents: list[Named], name: str) -> Named:
    path = config.path.parent / str(config.get(name))
    given = [one for one in contents if _is_camera(one) and one.path.name == path.name]
    return given[0] if given else Named(path, foreign.yaml_object(path))


def _vins_lens(camera: Named) -> Lens:
    model = camera.word("model_type", VINS_MODELS)
    size = int(camera.number("image_width")), int(camera.number("image_height"))
    K = camera.object("projection_parameters")
    if model == "KANNALA_BRANDT":
        fisheye = tuple(K.number(name) for name in ("k2", "k3", "k4", "k5"))
        return Lens(LensModel.EQUIDISTANT, intrinsics(K, "mu", "mv", "u0", "v0"), fisheye, *size)
    distortion = camera.object("distortion_parameters")
    D = tuple(distortion.number(name) for name in ("k1", "k2", "p1", "p2"))
    if model == "MEI":
        xi = camera.object("mirror_parameters").number("xi")
        return Lens(LensModel.OMNI, intrinsics(K, "gamma1", "gamma2", "u0", "v0"), (xi, *D), *size)
    four = intrinsics(K, "fx", "fy", "cx", "cy")
    return Lens(LensModel.RADTAN if any(D) else LensModel.NONE, four, D * any(D), *size)
