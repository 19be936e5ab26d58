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

from pelorus.io import arrays
from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named, as_numbers, sane
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig import several, spheres
from pelorus.rig.imu_model import Correction, ImuModel
from pelorus.rig.lens import COEFFICIENTS, Lens, LensModel
from pelorus.rig.rig import Rig, rigid
from pelorus.wire.frames import Noise
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
MODELS = ("pinhole", *spheres.PARAMETERS)
FOCAL_MIN_PX = 1.0  # a smaller one is in another unit
AGREE = 1e-3  # m and rad: tolerance of two chains to the same camera
NOISE = {
    "gyro_noise": "gyroscope_noise_density",
    "accel_noise": "accelerometer_noise_density",
    "gyro_walk": "gyroscope_random_walk",
    "accel_walk": "accelerometer_random_walk",
}


def is_camchain(content: Named) -> bool:
    """Returns whether it has numbered cameras, as Kalibr writes them."""
    return "cam0" in content


def is_sensor(content: Named) -> bool:
    """Returns whether it is the sensor.yaml of one camera."""
    return "intrinsics" in content and "camera_model" in content


def is_imu(content: Named) -> bool:
    """Returns whether it is an IMU's noise."""
    return "imu0" in content or any(name in content for name in NOISE.values())


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
        found.append(se3.compose(pose(camera, STEP), found[-1]))
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
    steps = pose(second, STEP) if step is None and STEP in second else step
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
    rig = Rig.of_cameras(second.path, _lens(first), _lens(second), steps, T_1B)
    offset = _offset(second if rig.swapped else first)
    topics = [str(c.content["rostopic"]) for c in (first, second) if "rostopic" in c]
    ordered = tuple(reversed(topics)) if rig.swapped else tuple(topics)
    return replace(rig, offset_s=offset, topics=ordered)


# --- the IMU --------------------------------------------------------------------------------------


def with_imu(rig: Rig, content: Named) -> Rig:
    """Returns the rig on the IMU of the file: its noise, its errors, its clock, its place.

    Kalibr's models: a_m = M a, w_m = M C w + A C a. Times of IMU i are time_offset before those of
    imu0, on whose clock and body the camchain is; T_i_b maps points of imu0 to it.
    """
    own = content.object("imu0") if "imu0" in content else content
    model, remarks = imu(content), []
    offset_s = own.number("time_offset") if "time_offset" in own else 0.0
    if offset_s:
        remarks.append(f"time_offset: the pictures come {offset_s:g} s earlier on the IMU's clock")
    if "T_i_b" in own and rig.T_LB is not None:
        T_ib = pose(own, "T_i_b")
        if np.abs(se3.log(T_ib)).max() > AGREE:
            remarks.append("T_i_b: the body is this IMU, where it sits on imu0")
            rig = rig.on_body(se3.compose(rig.T_LB, se3.inverse(T_ib)))
    said = (*model.remarks, *(f"{content.path}: {remark}" for remark in remarks))
    return rig.with_imu(replace(model, remarks=said), rig.offset_s - offset_s)


def imu(content: Named) -> ImuModel:
    """Returns the IMU by itself."""
    own = content.object("imu0") if "imu0" in content else content
    told = {name: own.number(key) for name, key in NOISE.items() if key in own}
    for name, value in told.items():
        if value < 0:
            raise own.error(NOISE[name], value, "a number that is not negative is expected")
    correction, remarks = _correction(own)
    return ImuModel(Noise(**told), correction, tuple(f"{content.path}: {r}" for r in remarks))


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
        C = rotation(gyroscopes, "C_gyro_i") if "C_gyro_i" in gyroscopes else np.eye(3)
        W = C.T @ _inverse(gyroscopes, "M")
        if "A" in gyroscopes:
            G = -W @ matrix(gyroscopes, "A", 3, 3) @ C
    found = Correction(A=A, W=W, G=G)
    if not found.is_none:
        model = own.content.get("model", "scale-misalignment")
        remarks.append(f"model {model}: its errors are taken out of the readings")
    return found, remarks


def _inverse(content: Named, name: str) -> Floats:
    if name not in content:
        return np.eye(3)
    M = matrix(content, name, 3, 3)
    if not 0.5 < np.linalg.det(M) < 2:
        raise content.error(name, M.tolist(), "a matrix near the identity is expected")
    return np.asarray(np.linalg.inv(M))


# --- matrices -------------------------------------------------------------------------------------


def pose(content: Named, name: str) -> Poses:
    """Reads a transform of 4 x 4 or 3 x 4 numbers."""
    value = content.get(name)
    rows = value.get("rows") if isinstance(value, dict) else np.size(np.array(value, object)) // 4
    if rows == 3 or (isinstance(value, list) and len(value) == 3):
        M = np.vstack((matrix(content, name, 3, 4), [0, 0, 0, 1]))
    else:
        M = matrix(content, name, 4, 4)
    return rigid(content.path, name, M)


def rotation(content: Named, name: str) -> Floats:
    """Reads a rotation of 3 x 3 numbers, which files round."""
    R = arrays.rotation(content.path, name, matrix(content, name, 3, 3))
    return np.asarray(se3.nearest_rotation(R))


def matrix(content: Named, name: str, rows: int, columns: int) -> Floats:
    """Reads a matrix.

    It may be rows of numbers, one list of all (msckf_vio), or the object with rows, cols and data
    of OpenCV and EuRoC.
    """
    value = content.get(name)
    if isinstance(value, dict):
        inner = content.object(name)
        value = as_numbers(inner.get("data"))
        size = [inner.number("rows"), inner.number("cols")]
        if size == [rows, columns] and value is not None and value.shape == (rows * columns,):
            value = value.reshape(rows, columns)
    found = as_numbers(value)
    if found is not None and found.shape == (rows * columns,):
        found = found.reshape(rows, columns)
    if found is None or found.shape != (rows, columns) or not sane(found):
        raise content.error(
            name, content.get(name), f"{rows} x {columns} finite numbers are expected"
        )
    return found


def _on_body(camera: Named) -> Poses | None:
    given = [name for name in (*TO_CAMERA, *FROM_CAMERA) if name in camera]
    if not given:
        return None
    if len(given) > 1:
        raise ForeignFileError(
            camera.path, f"has {' and '.join(given)}; one of them is expected", at=camera.at
        )
    T = pose(camera, given[0])
    return T if given[0] in TO_CAMERA else se3.inverse(T)


def _require_same(second: Named, steps: Poses, other: Poses) -> None:
    off = se3.log(se3.compose(steps, se3.inverse(other)))
    if np.abs(off).max() > AGREE:
        raise ForeignFileError(
            second.path,
            f"{STEP} and the cameras' transforms to the IMU differ by "
            f"{np.linalg.norm(off[:3]):.3g} m and {np.linalg.norm(off[3:]):.3g} rad",
            at=second.at,
            expected="they should agree: is one of them of another calibration, or inverted?",
        )


def _lens(camera: Named) -> Lens:
    kind = camera.word("camera_model", MODELS) if "camera_model" in camera else "pinhole"
    count = spheres.PARAMETERS.get(kind, 0)
    given = camera.array("intrinsics", count + 4).tolist()
    sphere, numbers = given[:count], given[count:]
    if min(numbers[:2]) < FOCAL_MIN_PX:
        raise camera.error("intrinsics", given, "[fx, fy, cx, cy] in px is expected")
    model = LENSES[camera.word("distortion_model", tuple(LENSES))]
    if "resolution" not in camera:
        width, height = 0, 0
    else:
        width, height = camera.size("resolution")
    D = _coefficients(camera, model)
    if count and (D and (kind != "omni" or model is not LensModel.RADTAN)):
        raise camera.error("distortion_model", model.value, f"none is expected beside {kind}")
    found = LensModel(kind) if count else model
    return Lens(found, tuple(numbers), (*sphere, *D), width, height)


def _coefficients(camera: Named, model: LensModel) -> tuple[float, ...]:
    if model is LensModel.NONE:
        return ()
    both = ("distortion_coeffs", "distortion_coefficients")
    name = next((name for name in both if name in camera), both[0])
    value = camera.get(name)
    found = as_numbers(value)
    if found is None or found.ndim != 1 or len(found) not in COEFFICIENTS[model]:
        expected = " or ".join(map(str, COEFFICIENTS[model]))
        raise camera.error(name, value, f"{expected} numbers are expected for {model}")
    return tuple(camera.array(name, len(found)).tolist())


def _offset(camera: Named) -> float:
    name = "timeshift_cam_imu"  # IMU time = camera time + shift
    return camera.number(name) if name in camera else 0.0
