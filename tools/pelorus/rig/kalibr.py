# SPDX-License-Identifier: MIT
"""Reads Kalibr's camchain and IMU files, and the similar sensor.yaml of an EuRoC folder.

The direction of a transform is in its name, and nothing else is assumed:

T_cam_imu    brings points of the IMU to the camera
T_imu_cam    the other way round (OpenVINS writes its Kalibr files so)
T_cn_cnm1    brings points of the camera before to this one
T_BS         of sensor.yaml: brings points of the sensor to the body
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig import several
from pelorus.rig.imu_model import Correction, ImuModel, noise
from pelorus.rig.lens import SPHERES, Lens, LensModel, coefficients
from pelorus.rig.rig import Rig
from pelorus.wire.layout import Floats

LENSES = {
    "none": LensModel.NONE,
    "radtan": LensModel.RADTAN,
    "radial-tangential": LensModel.RADTAN,
    "plumb_bob": LensModel.RADTAN,
    "equidistant": LensModel.EQUIDISTANT,
    "equi": LensModel.EQUIDISTANT,
}
TO_CAMERA, FROM_CAMERA = ("T_cam_imu",), ("T_imu_cam", "T_BS")
STEP = "T_cn_cnm1"
CAMERA = re.compile(r"cam\d+")
MODELS = ("pinhole", *SPHERES)
FOCAL_MIN_PX = 1.0  # a smaller one is in another unit
AGREE = 1e-3  # m and rad: tolerance of two chains to the same camera
NOISE = (
    *("gyroscope_noise_density", "accelerometer_noise_density"),
    *("gyroscope_random_walk", "accelerometer_random_walk"),
)


def is_camchain(content: Named) -> bool:
    """Returns whether it has numbered cameras, as Kalibr writes them."""
    return "cam0" in content


def is_sensor(content: Named) -> bool:
    """Returns whether it is the sensor.yaml of one camera."""
    return "intrinsics" in content and "camera_model" in content


def is_imu(content: Named) -> bool:
    """Returns whether it is an IMU's noise."""
    return "imu0" in content or bool(content.first_of(NOISE))


def camchain(content: Named, asked: Sequence[str] = ()) -> Rig:
    """Reads two cameras: those asked for by name or topic, else the stereo pair."""
    if "cam1" not in content:
        raise ForeignFileError(content.path, "has one camera, cam0; cam0 and cam1 are expected")
    names = [name for name in content.content if CAMERA.fullmatch(str(name))]
    cameras = [content.object(name) for name in sorted(names, key=lambda name: int(name[3:]))]
    if len(cameras) == 2 and not asked:
        return pair(cameras[0], cameras[1])
    known = [
        several.RigCamera((camera.at, str(camera.content.get("rostopic", ""))), _lens(camera), T)
        for camera, T in zip(cameras, _chained(cameras), strict=True)
    ]
    chosen = several.pair(content.path, known, asked)
    first, second = cameras[chosen.first], cameras[chosen.second]
    step = se3.compose(known[chosen.second].T, se3.inverse(known[chosen.first].T))
    return replace(pair(first, second, step), remarks=chosen.remarks)


def _chained(cameras: Sequence[Named]) -> list[Poses]:
    """Returns maps to each camera from the first one, or from the IMU if all name it."""
    on_body = [_on_body(camera) for camera in cameras]
    known = [T for T in on_body if T is not None]
    if len(known) == len(cameras):
        return known
    found = [se3.IDENTITY]
    for camera in cameras[1:]:
        if STEP not in camera:
            raise ForeignFileError(
                camera.path, f"does not say where it stands; {STEP} is expected", at=camera.at
            )
        found.append(se3.compose(camera.pose(STEP), found[-1]))
    return found


def topics(content: Named) -> set[str]:
    """Returns the topics of its cameras."""
    cameras = [one for one in content.content.values() if isinstance(one, dict)]
    return {str(one["rostopic"]) for one in cameras if "rostopic" in one}


def pair(first: Named, second: Named, step: Poses | None = None) -> Rig:
    """Reads two cameras of one file, or of one each.

    `step` maps points of the first to the second; by default the file has it.
    """
    T_1B, T_2B = _on_body(first), _on_body(second)
    steps = second.pose(STEP) if step is None and STEP in second else step
    if steps is None:
        if T_1B is None or T_2B is None:
            raise ForeignFileError(
                second.path,
                f"{second.at or 'the second camera'} does not say where it stands; {STEP} is "
                f"expected, or {' or '.join((*TO_CAMERA, *FROM_CAMERA))} of both cameras",
            )
        steps = se3.compose(T_2B, se3.inverse(T_1B))
    elif step is None and T_1B is not None and T_2B is not None:
        _require_same(second, steps, se3.compose(T_2B, se3.inverse(T_1B)))
    topics = [str(c.content["rostopic"]) for c in (first, second) if "rostopic" in c]
    rig = Rig.of_cameras(second.path, _lens(first), _lens(second), steps, T_1B, topics)
    left = second if rig.swapped else first
    # IMU time = camera time + shift
    return replace(rig, offset_s=left.number("timeshift_cam_imu", 0.0))


# --- the IMU --------------------------------------------------------------------------------------


def with_imu(rig: Rig, content: Named) -> Rig:
    """Returns the rig on the IMU of the file: its noise, its errors, its clock, its place.

    Kalibr's models: a_m = M a, w_m = M C w + A C a. Times of IMU i are time_offset before those of
    imu0, on whose clock and body the camchain is; T_i_b maps points of imu0 to it.
    """
    own = content.object("imu0") if "imu0" in content else content
    model, remarks = imu(content), []
    offset_s = own.number("time_offset", 0.0)
    if offset_s:
        remarks.append(f"time_offset: the pictures come {offset_s:g} s earlier on the IMU's clock")
    if "T_i_b" in own and rig.T_LB is not None:
        T_ib = own.pose("T_i_b")
        if np.abs(se3.log(T_ib)).max() > AGREE:
            remarks.append("T_i_b: the body is this IMU, where it sits on imu0")
            rig = rig.on_body(se3.compose(rig.T_LB, se3.inverse(T_ib)))
    said = (*model.remarks, *(f"{content.path}: {remark}" for remark in remarks))
    return rig.with_imu(replace(model, remarks=said), rig.offset_s - offset_s)


def imu(content: Named) -> ImuModel:
    """Returns the IMU by itself."""
    own = content.object("imu0") if "imu0" in content else content
    for name in NOISE:
        if own.number(name, 0.0) < 0:
            raise own.error(name, own.get(name), "a number that is not negative is expected")
    correction, remarks = _correction(own)
    return ImuModel(noise(own, NOISE), correction, tuple(f"{content.path}: {r}" for r in remarks))


def _correction(own: Named) -> tuple[Correction, list[str]]:
    """Returns the inverse of the errors that the model knows, and remarks."""
    A, W, G = np.eye(3), np.eye(3), np.zeros((3, 3))
    remarks = []
    if "accelerometers" in own:
        accelerometers = own.object("accelerometers")
        A = _inverse(accelerometers, "M")
        unused = [name for name in ("rx_i", "ry_i", "rz_i") if name in accelerometers]
        if unused:
            remarks.append(f"{', '.join(unused)}: where each accelerometer sits is not used")
    if "gyroscopes" in own:
        gyroscopes = own.object("gyroscopes")
        C = gyroscopes.rotation("C_gyro_i") if "C_gyro_i" in gyroscopes else np.eye(3)
        W = C.T @ _inverse(gyroscopes, "M")
        if "A" in gyroscopes:
            G = -W @ gyroscopes.matrix("A", 3, 3) @ C
    found = Correction(A=A, W=W, G=G)
    if not found.is_none:
        model = own.content.get("model", "scale-misalignment")
        remarks.append(f"model {model}: its errors are taken out of the readings")
    return found, remarks


def _inverse(content: Named, name: str) -> Floats:
    if name not in content:
        return np.eye(3)
    M = content.matrix(name, 3, 3)
    if not 0.5 < np.linalg.det(M) < 2:
        raise content.error(name, M.tolist(), "a matrix near the identity is expected")
    return np.asarray(np.linalg.inv(M))


def _on_body(camera: Named) -> Poses | None:
    given = [name for name in (*TO_CAMERA, *FROM_CAMERA) if name in camera]
    if not given:
        return None
    if len(given) > 1:
        raise ForeignFileError(
            camera.path, f"has {' and '.join(given)}; one of them is expected", at=camera.at
        )
    T = camera.pose(given[0])
    return T if given[0] in TO_CAMERA else se3.inverse(T)


def _require_same(second: Named, steps: Poses, other: Poses) -> None:
    off = se3.log(se3.compose(steps, se3.inverse(other)))
    if np.abs(off).max() > AGREE:
        raise ForeignFileError(
            second.path,
            f"{STEP} and the cameras' transforms to the IMU differ by "
            f"{np.linalg.norm(off[:3]):.3g} m and {np.linalg.norm(off[3:]):.3g} rad; they should "
            "agree: is one of them of another calibration, or inverted?",
            at=second.at,
        )


def _lens(camera: Named) -> Lens:
    kind = camera.word("camera_model", MODELS) if "camera_model" in camera else "pinhole"
    count = SPHERES.get(kind, 0)
    given = camera.array("intrinsics", count + 4).tolist()
    sphere, numbers = given[:count], given[count:]
    if min(numbers[:2]) < FOCAL_MIN_PX:
        raise camera.error("intrinsics", given, "[fx, fy, cx, cy] in px is expected")
    model = LENSES[camera.word("distortion_model", tuple(LENSES))]
    width, height = camera.size("resolution") if "resolution" in camera else (0, 0)
    both = ("distortion_coeffs", "distortion_coefficients")
    D = coefficients(camera, camera.first_of(both) or both[0], model)
    if count and (D and (kind != "omni" or model is not LensModel.RADTAN)):
        raise camera.error("distortion_model", model.value, f"none is expected beside {kind}")
    found = LensModel(kind) if count else model
    return Lens(found, tuple(numbers), (*sphere, *D), width, height)
