# SPDX-License-Identifier: MIT
"""Calibrations of the factory: a ZED's (SN12345.conf), an OAK's (DepthAI's eepromToJsonFile).

A ZED has sections for each resolution, in millimetres. R = Exp(RX, CV, RZ) turns points of the left
camera to the right one, which stands Baseline, TY, TZ from it: q_R = R q_L - (Baseline, TY, TZ).

An OAK's lengths are in cm. cameraData lists sockets, each with a camera. Its extrinsics map its
points to the camera of the socket that they name, q_to = R q + t, and so do imuExtrinsics with
points of the IMU; a socket of -1 is none. stereoRectificationData names the sockets of the stereo
pair.
"""

from __future__ import annotations

import configparser
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig import several
from pelorus.rig.lens import Lens, LensModel, intrinsics, intrinsics_in
from pelorus.rig.rig import Rig
from pelorus.wire.layout import Floats

SIZES = {
    "2k": (2208, 1242),
    "fhd1200": (1920, 1200),
    "fhd": (1920, 1080),
    "hd": (1280, 720),
    "svga": (960, 600),
    "vga": (672, 376),
}
RADTAN, RATIONAL = ("k1", "k2", "p1", "p2", "k3"), ("k4", "k5", "k6")
CM = 1e-2
NO_SOCKET = -1
PERSPECTIVE, FISHEYE = 0, 1
FISHEYE_COEFFICIENTS = 4
SOCKETS = {"CAM_A": 0, "CAM_B": 1, "CAM_C": 2, "CAM_D": 3}
STEREO, SIDES = "stereoRectificationData", ("leftCameraSocket", "rightCameraSocket")


# --- ZED ------------------------------------------------------------------------------------------


def sections(path: Path, words: str) -> Named:
    """Parses a text with [sections]; names become lower case."""
    parser = configparser.ConfigParser(
        interpolation=None, strict=False, comment_prefixes=("#", ";")
    )
    try:
        parser.read_string(words)
    except configparser.Error as error:
        raise ForeignFileError(path, f"is no .conf: {str(error).splitlines()[0]}") from None
    found = {name.lower(): dict(parser[name]) for name in parser.sections()}
    return Named(path, {name: _numbers(section) for name, section in found.items()})


def _numbers(section: dict[str, str]) -> dict[str, float | str]:
    found: dict[str, float | str] = {}
    for name, word in section.items():
        try:
            found[name] = float(word)
        except ValueError:
            found[name] = word
    return found


def is_zed(content: Named) -> bool:
    """Returns whether it has a ZED's sections."""
    return "stereo" in content and any(f"left_cam_{size}" in content for size in SIZES)


def zed(content: Named) -> Rig:
    """Returns the rig of each resolution; the pictures' size selects one."""
    sides = ("left", "right")
    there = [size for size in SIZES if all(f"{side}_cam_{size}" in content for side in sides)]
    if not there:
        raise ForeignFileError(content.path, "has no resolution with a left and a right camera")
    rigs = [_zed_rig(content, size) for size in there]
    return replace(rigs[0], others=tuple(rigs[1:]))


def _zed_rig(content: Named, size: str) -> Rig:
    stereo = content.object("stereo")

    def number(name: str, otherwise: float | None = None) -> float:
        return stereo.number(stereo.first_of((f"{name}_{size}",)) or name, otherwise)

    turn = [number("rx"), number("cv"), number("rz")]
    R = scipy.spatial.transform.Rotation.from_rotvec(turn).as_matrix()
    T = Poses(R, -1e-3 * np.array([number("baseline"), number("ty", 0.0), number("tz", 0.0)]))
    left, right = (_zed_lens(content, side, size) for side in ("left", "right"))
    return Rig.of_cameras(content.path, left, right, T)


def _zed_lens(content: Named, side: str, size: str) -> Lens:
    camera = content.object(f"{side}_cam_{size}")
    holder = content.object(f"{side}_disto") if f"{side}_disto" in content else camera
    names = RADTAN + RATIONAL if holder.first_of(RATIONAL) else RADTAN
    D = tuple(holder.number(name, 0.0) for name in names)
    model = LensModel.RADTAN if any(D) else LensModel.NONE
    four = intrinsics(camera, "fx", "fy", "cx", "cy")
    return Lens(model, four, D if any(D) else (), *SIZES[size])


# --- DepthAI --------------------------------------------------------------------------------------


def is_depthai(content: Named) -> bool:
    """Returns whether it has DepthAI's list of cameras."""
    return isinstance(content.content.get("cameraData"), list)


def depthai(content: Named, asked: Sequence[str] = ()) -> Rig:
    """Reads two cameras: those asked for by socket, else the stereo pair that the file names."""
    by_socket = _sockets(content)
    placed = _placed(by_socket)
    cameras = [
        several.RigCamera((_socket_name(k), str(k)), _depthai_lens(by_socket[k]), T)
        for k, T in placed.items()
    ]
    if len(cameras) < 2:
        raise ForeignFileError(
            content.path,
            f"has {len(cameras)} camera whose place is told by another one's; two that extrinsics "
            "join are expected",
        )
    stereo = [] if asked else _stereo(content, set(placed))
    rig = several.rig(content.path, cameras, asked or [str(k) for k in stereo])
    if stereo and len(cameras) > 2:
        left, right = map(_socket_name, stereo)
        remark = f"{left} and {right} are taken, the stereo pair that it names"
        rig = replace(rig, remarks=(f"{content.path}: {remark}",))
    T_FI = _depthai_imu(content, placed)
    if T_FI is None or rig.T_LB is None:
        return replace(rig, T_LB=None)
    return rig.on_body(se3.compose(rig.T_LB, T_FI))


def _socket(value: Any) -> int:
    """Returns a socket's number; newer files may have its name."""
    return SOCKETS.get(value, NO_SOCKET) if isinstance(value, str) else int(value)


def _socket_name(number: int) -> str:
    return f"CAM_{chr(ord('A') + number)}"


def _sockets(content: Named) -> dict[int, Named]:
    found = {}
    for k, one in enumerate(content.content["cameraData"]):
        at = f"cameraData[{k}]"
        if not (isinstance(one, list) and len(one) == 2 and isinstance(one[1], dict)):
            raise ForeignFileError(content.path, f"{at} is no socket with its camera")
        found[_socket(one[0])] = Named(content.path, one[1], at)
    return found


def _placed(by_socket: dict[int, Named]) -> dict[int, Poses]:
    """Returns maps to each camera from the frame that joins most of them."""
    steps = {}
    for k, camera in by_socket.items():
        extrinsics = camera.object("extrinsics")
        to = _socket(extrinsics.get("toCameraSocket"))
        if to in by_socket and to != k:
            steps[k, to] = _pose(extrinsics)
    steps |= {(to, k): se3.inverse(T) for (k, to), T in steps.items()}
    most: dict[int, Poses] = {}
    for root in by_socket:
        found, waiting = {root: se3.IDENTITY}, [root]
        while waiting:
            here = waiting.pop()
            for (k, to), T in steps.items():
                if k == here and to not in found:
                    found[to] = se3.compose(T, found[here])
                    waiting.append(to)
        if len(found) > len(most):
            most = found
    return dict(sorted(most.items()))


def _stereo(content: Named, there: set[int]) -> list[int]:
    if STEREO not in content:
        return []
    inner = content.object(STEREO)
    named = [_socket(inner.content.get(side, NO_SOCKET)) for side in SIDES]
    return named if set(named) <= there and named[0] != named[1] else []


def _depthai_imu(content: Named, placed: dict[int, Poses]) -> Poses | None:
    """Returns the map from the IMU to the frame of `placed`; None if it is unknown (R is zero)."""
    if "imuExtrinsics" not in content:
        return None
    extrinsics = content.object("imuExtrinsics")
    to = _socket(extrinsics.content.get("toCameraSocket", NO_SOCKET))
    if to not in placed or not extrinsics.matrix("rotationMatrix", 3, 3).any():
        return None
    return se3.compose(se3.inverse(placed[to]), _pose(extrinsics))


def _pose(extrinsics: Named) -> Poses:
    t = extrinsics.object("translation")
    p: Floats = CM * np.array([t.number(axis) for axis in "xyz"])
    return Poses(extrinsics.rotation("rotationMatrix"), p)


def _depthai_lens(camera: Named) -> Lens:
    K = camera.matrix("intrinsicMatrix", 3, 3)
    size = int(camera.number("width")), int(camera.number("height"))
    four = intrinsics_in(K)
    if min(four[:2]) <= 0:
        raise camera.error("intrinsicMatrix", K.tolist(), "the camera is not calibrated")
    given = camera.get("distortionCoeff")
    D = tuple(camera.array("distortionCoeff", len(given)).tolist()) if given else ()
    if not any(D):
        return Lens(LensModel.NONE, four, (), *size)
    if camera.content.get("cameraType", PERSPECTIVE) == FISHEYE:
        return Lens(LensModel.EQUIDISTANT, four, D[:FISHEYE_COEFFICIENTS], *size)
    return Lens(LensModel.RADTAN, four, D, *size)
