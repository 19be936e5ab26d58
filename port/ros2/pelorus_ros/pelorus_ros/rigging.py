# SPDX-License-Identifier: MIT
"""What has to be known before anything can be estimated: the cameras, and where all of it sits."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pelorus.errors import PelorusError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.math.se3 import IDENTITY, Poses
from pelorus.online.pipeline import header_of
from pelorus.rig import read as rig_files
from pelorus.rig.camera_info import Info, Infos
from pelorus.rig.lens import LensModel
from pelorus.rig.read import Calibrated
from pelorus.rig.rig import Rig

from pelorus_ros.mounting import Mounting, NoChain, bare
from pelorus_ros.parameters import Options

SIDES = ("left", "right")


class NotYet(Exception):
    """What is still waited for."""


class Rigged(NamedTuple):
    """The cameras; `T_IB` brings points of the base into the body; `swapped`: by their own
    camera_info the left topic is the right camera."""

    calibrated: Calibrated
    T_IB: Poses
    swapped: bool


@dataclass
class Rigging:
    """Collects what the topics say of calibration and frames."""

    options: Options
    mounting: Mounting = field(default_factory=Mounting)
    frames: dict[str, str] = field(default_factory=dict)  # frame_id by topic
    _infos: dict[str, Info] = field(default_factory=dict)

    def heard(self, topic: str, frame_id: str) -> None:
        self.frames.setdefault(topic, bare(frame_id))

    def camera_info(self, side: str, message: Any) -> None:
        """The first one of each camera counts."""
        if side in self._infos:
            return
        K, D, R, P = (np.array(getattr(message, name), np.float64) for name in "kdrp")
        matrices = K.reshape(3, 3), D, R.reshape(3, 3), P.reshape(3, 4)
        lens = message.distortion_model, message.width, message.height
        self._infos[side] = Info(Path(f"{side}/camera_info"), "", *matrices, *lens)

    def rigged(self, size: tuple[int, int]) -> Rigged:
        """Returns all of it for pictures of this size, 0 of tracks; NotYet, NoChain or PelorusError
        say what lacks."""
        rig, calibrated = self._cameras(size)
        if rig is not None:
            calibrated = rig_files.of_rig(self._on_body(rig), "")
        assert calibrated is not None
        header = header_of(calibrated, self.options.motion != "wheels", size)
        swapped = rig is not None and rig.swapped and not self.options.files
        return Rigged(replace(calibrated, header=header), self._base_on_body(), swapped)

    # --- cameras

    def _cameras(self, size: tuple[int, int]) -> tuple[Rig | None, Calibrated | None]:
        """Of the files, else of camera_info; the project's own JSON says all by itself."""
        if rig_files.is_own(self.options.files):
            return None, rig_files.read(self.options.files, "")
        if self.options.files:
            lens = LensModel.NONE if self.options.rectified else None
            rig = rig_files.read_rig(self.options.files, lens)
        else:
            rig = self._of_camera_info()
        if not size[0]:
            return rig, None
        if rig.sizes[0][0] and size not in rig.sizes:
            told = " or ".join(f"{width} x {height}" for width, height in rig.sizes)
            raise PelorusError(
                f"the pictures have {size[0]} x {size[1]} pixels, the calibration is of {told}: "
                "give the one of these pictures"
            )
        return rig.of_size(*size), None

    def _of_camera_info(self) -> Rig:
        lacking = [f"{side}/camera_info" for side in SIDES if side not in self._infos]
        if lacking:
            raise NotYet(
                f"for {' and '.join(lacking)}; or the parameter calibration names files "
                "(Kalibr's camchain-imucam.yaml ...)"
            )
        infos = Infos(self._infos["left"], self._infos["right"], self.options.rectified)
        apart = None
        if not infos.have_baseline:
            left, right = (self.frames.get(side, "") for side in SIDES)
            apart = self._between(left, right)
        return infos.rig(apart)

    def _on_body(self, rig: Rig) -> Rig:
        T = matrix("T_cam_imu", self.options.T_cam_imu)
        if T is not None:
            return rig.on_body(se3.compose(rig.T_LF, T))
        if rig.T_LB is not None:
            return rig
        side = "right" if rig.swapped else "left"
        camera = self.options.left_camera_frame or self.frames.get(side, "")
        if not camera:
            raise NotYet(
                "for the left camera's frame: its messages name none; set left_camera_frame"
            )
        return rig.on_body(se3.compose(rig.T_LF, self._between(self.body_frame(), camera)))

    # --- frames

    def _between(self, source: str, target: str) -> Poses:
        try:
            return self.mounting.between(source, target)
        except NoChain as missing:
            raise NoChain(
                f"{missing}; publish it (robot_state_publisher, static_transform_publisher), or "
                "set the parameters T_cam_imu and T_base_imu"
            ) from None

    def _base_on_body(self) -> Poses:
        T = matrix("T_base_imu", self.options.T_base_imu)
        if T is not None:
            return se3.inverse(T)
        base, body = self.options.base_frame, self.body_frame()
        return IDENTITY if base in ("", body) else self._between(base, body)

    def body_frame(self) -> str:
        """Returns the frame that the filter moves: the IMU's, or that of wheels alone."""
        if self.options.motion == "wheels":
            if "wheels" not in self.frames:
                raise NotYet("for the first message of wheels, whose frame is the body")
            return self.frames["wheels"]
        frame = self.options.imu_frame or self.frames.get("imu", "")
        if not frame and "imu" not in self.frames:
            raise NotYet("for the first message of the IMU, whose frame is the body")
        if not frame:
            raise NotYet("for the IMU's frame: its messages name none; set imu_frame")
        return frame

    def wheels_on_body(self, frame: str, T_IB: Poses) -> Poses:
        """Returns T with q_body = T s, of a point in the frame of the wheels."""
        if frame == self.options.base_frame:
            return T_IB
        return self._between(frame, self.body_frame())


def matrix(name: str, numbers: list[float]) -> Poses | None:
    """Returns the 4 x 4 by rows as a pose; None where it was not given."""
    if len(numbers) != 16:
        return None
    return Named(Path(f"parameter {name}"), {name: list(numbers)}).pose(name)
