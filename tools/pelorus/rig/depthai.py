# SPDX-License-Identifier: MIT
"""Reads an OAK camera's calibration, as DepthAI writes it (eepromToJsonFile): lengths in cm.

cameraData lists sockets, each with a camera. Its extrinsics map its points to the camera of the
socket that they name, q_to = R q + t, and so do imuExtrinsics with points of the IMU; a socket of
-1 is none. stereoRectificationData names the sockets of the stereo pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pelorus.io import arrays
from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig import several
from pelorus.rig.kalibr import matrix
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rig import Rig
from pelorus.wire.layout import Floats

CM = 1e-2
NO_SOCKET = -1
PERSPECTIVE, FISHEYE = 0, 1
FISHEYE_COEFFICIENTS = 4
SOCKETS = {"CAM_A": 0, "CAM_B": 1, "CAM_C": 2, "CAM_D": 3}
STEREO, SIDES = "stereoRectificationData", ("leftCameraSocket", "rightCameraSocket")


def is_calibration(content: Named) -> bool:
    """Returns whether it has DepthAI's list of cameras."""
    return isinstance(content.content.get("cameraData"), list)


def read(content: Named, asked: Sequence[str] = ()) -> Rig:
    """Reads two cameras: those asked for by socket, else the stereo pair that the file names."""
    by_socket = _sockets(content)
    placed = _placed(by_socket)
    cameras = [
        several.RigCamera((f"CAM_{chr(ord('A') + k)}", str(k)), _lens(by_socket[k]), T)
        for k, T in placed.items()
    ]
    if len(cameras) < 2:
        raise ForeignFileError(
            content.path,
            f"has {len(cameras)} camera whose place is told by another one's",
            expected="two that extrinsics join are expected",
        )
    stereo = [] if asked else _stereo(content, set(placed))
    rig = several.rig(content.path, cameras, asked or [str(k) for k in stereo])
    if stereo and len(cameras) > 2:
        left, right = (f"CAM_{chr(ord('A') + k)}" for k in stereo)
        remark = f"{left} and {right} are taken, the stereo pair that it names"
        rig = replace(rig, remarks=(f"{content.path}: {remark}",))
    T_FI = _imu(content, placed)
    if T_FI is None or rig.T_LB is None:
        return replace(rig, T_LB=None)
    return rig.on_body(se3.compose(rig.T_LB, T_FI))


def _socket(value: Any) -> int:
    """Returns a socket's number; newer files may have its name."""
    return SOCKETS.get(value, NO_SOCKET) if isinstance(value, str) else int(value)


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


def _imu(content: Named, placed: dict[int, Poses]) -> Poses | None:
    """Returns the map from the IMU to the frame of `placed`; None if it is unknown (R is zero)."""
    if "imuExtrinsics" not in content:
        return None
    extrinsics = content.object("imuExtrinsics")
    to = _socket(extrinsics.content.get("toCameraSocket", NO_SOCKET))
    if to not in placed or not matrix(extrinsics, "rotationMatrix", 3, 3).any():
        return None
    return se3.compose(se3.inverse(placed[to]), _pose(extrinsics))


def _pose(extrinsics: Named) -> Poses:
    R = arrays.rotation(
        extrinsics.path, "rotationMatrix", matrix(extrinsics, "rotationMatrix", 3, 3)
    )
    t = extrinsics.object("translation")
    p: Floats = CM * np.array([t.number(axis) for axis in "xyz"])
    return Poses(se3.nearest_rotation(R), p)


def _lens(camera: Named) -> Lens:
    K = matrix(camera, "intrinsicMatrix", 3, 3)
    size = int(camera.number("width")), int(camera.number("height"))
    intrinsics = (float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2]))
    if min(intrinsics[:2]) <= 0:
        raise camera.error("intrinsicMatrix", K.tolist(), "the camera is not calibrated")
    given = camera.get("distortionCoeff")
    D = tuple(camera.array("distortionCoeff", len(given)).tolist()) if given else ()
    if not any(D):
        return Lens(LensModel.NONE, intrinsics, (), *size)
    if camera.content.get("cameraType", PERSPECTIVE) == FISHEYE:
        return Lens(LensModel.EQUIDISTANT, intrinsics, D[:FISHEYE_COEFFICIENTS], *size)
    return Lens(LensModel.RADTAN, intrinsics, D, *size)
