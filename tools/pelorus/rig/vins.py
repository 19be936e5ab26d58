# SPDX-License-Identifier: MIT
"""Reads VINS-Fusion's configuration, and the files of its two cameras (camodocal's).

body_T_cam0 maps points of the camera to the IMU; the IMU's clock is the pictures' plus td.
"""

from __future__ import annotations

from dataclasses import replace

from pelorus.io import foreign
from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.rig.imu_model import ImuModel
from pelorus.rig.kalibr import pose
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rig import Rig

CAMERAS = ("cam0", "cam1")
MODELS = ("PINHOLE", "KANNALA_BRANDT", "MEI")
NOISE = ("acc_n", "gyr_n", "acc_w", "gyr_w")


def is_config(content: Named) -> bool:
    """Returns whether it is the main file."""
    return "cam0_calib" in content and "num_of_cam" in content


def is_camera(content: Named) -> bool:
    """Returns whether it is a camera's file."""
    return "model_type" in content and "projection_parameters" in content


def read(contents: list[Named]) -> Rig:
    """Reads the configuration, and the cameras' files beside it if they are not given."""
    configs = [content for content in contents if is_config(content)]
    if len(configs) != 1:
        raise ForeignFileError(
            contents[0].path,
            "is of one camera, and does not say where it stands",
            expected="VINS-Fusion's configuration (body_T_cam0, cam0_calib) is expected with it",
        )
    config = configs[0]
    if config.number("num_of_cam") != 2:
        raise ForeignFileError(config.path, "is not of two cameras; num_of_cam: 2 is expected")
    T_B1, T_B2 = (pose(config, f"body_T_{camera}") for camera in CAMERAS)
    T_21 = se3.compose(se3.inverse(T_B2), T_B1)
    has_imu = "imu" not in config or config.number("imu") != 0
    lenses = [_lens(_camera(config, contents, f"{camera}_calib")) for camera in CAMERAS]
    T_1B = se3.inverse(T_B1) if has_imu else None
    rig = Rig.of_cameras(config.path, lenses[0], lenses[1], T_21, T_1B)
    names = ("image0_topic", "image1_topic")
    topics = tuple(str(config.get(name)) for name in names if name in config)
    told = [name for name in NOISE if name in config]
    remarks: tuple[str, ...] = ()
    if has_imu and told:
        remarks = (f"{config.path}: {', '.join(told)} are sigmas of single readings: not used",)
    return replace(
        rig,
        imu=ImuModel(remarks=remarks),
        offset_s=config.number("td") if "td" in config else 0.0,
        topics=tuple(reversed(topics)) if rig.swapped else topics,
    )


def _camera(config: Named, contents: list[Named], name: str) -> Named:
    file = str(config.get(name))
    path = config.path.parent / file
    for content in contents:
        if is_camera(content) and content.path.name == path.name:
            return content
    return Named(path, foreign.yaml_object(path))


def _lens(camera: Named) -> Lens:
    model = camera.word("model_type", MODELS)
    size = int(camera.number("image_width")), int(camera.number("image_height"))
    K = camera.object("projection_parameters")
    if model == "KANNALA_BRANDT":
        fx, fy, cx, cy = (K.number(name) for name in ("mu", "mv", "u0", "v0"))
        fisheye = tuple(K.number(name) for name in ("k2", "k3", "k4", "k5"))
        return Lens(LensModel.EQUIDISTANT, (fx, fy, cx, cy), fisheye, *size)
    distortion = camera.object("distortion_parameters")
    D = tuple(distortion.number(name) for name in ("k1", "k2", "p1", "p2"))
    if model == "MEI":
        fx, fy, cx, cy = (K.number(name) for name in ("gamma1", "gamma2", "u0", "v0"))
        xi = camera.object("mirror_parameters").number("xi")
        return Lens(LensModel.OMNI, (fx, fy, cx, cy), (xi, *D), *size)
    fx, fy, cx, cy = (K.number(name) for name in ("fx", "fy", "cx", "cy"))
    return Lens(LensModel.RADTAN if any(D) else LensModel.NONE, (fx, fy, cx, cy), D * any(D), *size)
