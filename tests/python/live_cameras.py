# SPDX-License-Identifier: MIT
"""Cameras of no hardware for `pelorus live`: scripts of measurements, and the two SDKs as fakes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from datetime import timedelta
from types import ModuleType
from types import SimpleNamespace as Fields
from typing import Any

import numpy as np
import pytest
from pelorus.live import camera as adapters
from pelorus.live.camera import Asked, Measured
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig.read import Calibrated
from pelorus.wire.frames import Imu, Message, Stereo

Step = Measured | Callable[[], None]


class Scripted:
    """A live camera that gives what it is told; a step that is a function is called."""

    name, recorded, inertial = "the scripted camera", False, True
    remarks: Sequence[str] = ()

    def __init__(self, calibrated: Calibrated, steps: Sequence[Step]) -> None:
        self.calibrated, self._steps, self.closed = calibrated, steps, 0

    def measured(self) -> Iterator[Measured]:
        for one in self._steps:
            if callable(one):
                one()
            else:
                yield one

    def close(self) -> None:
        self.closed += 1


def single(messages: Sequence[Message]) -> list[Measured]:
    """Returns frames, and readings of the IMU one by one."""
    found: list[Measured] = []
    for m in messages:
        if isinstance(m, Imu):
            rows = zip(m.times_ns, m.a_B_mps2, m.w_B_radps, strict=True)
            found += [Imu(int(t), a[None], w[None]) for t, a, w in rows]
        elif isinstance(m, Stereo):
            found.append(m)
    return found


def plugged_in(monkeypatch: pytest.MonkeyPatch, camera: Scripted) -> Scripted:
    """Makes `--camera scripted` open it."""
    module = ModuleType("pelorus.live.scripted")

    def open_camera(asked: Asked) -> Scripted:
        del asked
        return camera

    vars(module)["open_camera"] = open_camera
    monkeypatch.setitem(sys.modules, "pelorus.live.scripted", module)
    monkeypatch.setitem(adapters.CAMERAS, "scripted", "a script")
    return camera


# --- DepthAI --------------------------------------------------------------------------------------


class Queue:
    """Gives all it holds, once."""

    def __init__(self, items: list[Any]) -> None:
        self._items = items

    def tryGetAll(self) -> list[Any]:
        items, self._items = self._items, []
        return items


class Oak:
    """A fake OAK; `asked` is what was wanted of it. After `lives` rounds its cable is pulled."""

    def __init__(self, eeprom: dict[str, Any], lives: int = 3) -> None:
        self.eeprom, self.lives = eeprom, lives
        self.asked: list[Any] = []
        self.closed = False

    def module(self) -> ModuleType:
        """Returns the module depthai with the names that the adapter uses."""
        dai = ModuleType("depthai")
        sockets = Fields(CAM_B=1, CAM_C=2)
        vars(dai).update(
            __version__="3.0.0", Device=lambda *_: self, DeviceInfo=str, Pipeline=lambda _: self,
            CameraBoardSocket=sockets, CameraExposureOffset=Fields(MIDDLE="middle"),
            ImgFrame=Fields(Type=Fields(GRAY8="gray8")), node=Fields(Camera="camera", IMU="imu"),
            IMUSensor=Fields(ACCELEROMETER_RAW="a", GYROSCOPE_RAW="w"),
        )  # fmt: skip
        return dai

    # of a device

    def readCalibration(self) -> Fields:
        return Fields(eepromToJson=lambda: self.eeprom)

    def close(self) -> None:
        self.closed = True

    # of a pipeline

    def create(self, kind: str) -> Any:
        if kind == "imu":

            def stamp(us: int) -> Callable[[], timedelta]:
                return lambda: timedelta(microseconds=us)

            packets = [
                Fields(
                    acceleroMeter=Fields(x=0.0, y=0.0, z=9.81, getTimestamp=stamp(5000 * k)),
                    gyroscope=Fields(x=0.1, y=0.2, z=0.3, getTimestamp=stamp(5000 * k + 1000)),
                )
                for k in range(4)
            ]
            queue = Queue([Fields(packets=packets)])
            return Fields(
                enableIMUSensor=lambda *words: self.asked.append(words),
                setBatchReportThreshold=lambda _: None, setMaxBatchReports=lambda _: None,
                out=Fields(createOutputQueue=lambda **_: queue),
            )  # fmt: skip
        return Fields(build=self._camera)

    def _camera(self, socket: int) -> Fields:
        def request(size: tuple[int, int], kind: str, fps: int) -> Fields:
            self.asked.append((socket, size, kind, fps))
            shade = np.full((size[1], size[0]), 10 * socket, np.uint8)
            frame = Fields(
                getTimestamp=lambda _: timedelta(days=1, microseconds=7),
                getCvFrame=lambda: shade,
            )
            return Fields(createOutputQueue=lambda **_: Queue([frame]))

        return Fields(requestOutput=request)

    def start(self) -> None:
        pass

    def isRunning(self) -> bool:
        self.lives -= 1
        if self.lives < 0:
            raise RuntimeError("X_LINK_ERROR")
        return True


# --- librealsense ---------------------------------------------------------------------------------


def extrinsics(T: Poses) -> Fields:
    """Returns a pose as librealsense has it: column by column."""
    return Fields(rotation=T.R.T.ravel().tolist(), translation=T.p.tolist())


class RealSense:
    """A fake D435i: infra 2 stands 50 mm right of infra 1; `T_LB` brings the IMU's points there."""

    def __init__(self, T_LB: Poses, size: tuple[int, int] = (640, 480)) -> None:
        self.T_LB, self.size = T_LB, size
        self.options: dict[str, float] = {}
        self.frames: list[Any] = []
        self.T_RL = Poses(np.eye(3), np.array([-0.05, 0.0, 0.0]))
        self.stopped = 0
        self.absent = False

    def module(self) -> ModuleType:
        rs = ModuleType("pyrealsense2")
        vars(rs).update(
            stream=Fields(infrared="infrared", accel="accel", gyro="gyro"),
            format=Fields(y8="y8", motion_xyz32f="xyz"),
            option=Fields(
                emitter_enabled="emitter", enable_motion_correction="correct",
                global_time_enabled="global",
            ),
            config=lambda: Fields(enable_stream=lambda *_: None, enable_device=lambda _: None),
            pipeline=lambda: Fields(start=self._start, stop=self._stop),
        )  # fmt: skip
        return rs

    def picture(self, index: int, t_ms: float) -> Fields:
        pixels = np.full((self.size[1], self.size[0]), 20 * index, np.uint8)
        profile = Fields(stream_type=lambda: "infrared", stream_index=lambda: index)
        return Fields(
            is_frameset=lambda: False, is_motion_frame=lambda: False, get_timestamp=lambda: t_ms,
            get_profile=lambda: profile, get_data=lambda: pixels,
        )  # fmt: skip

    def pair(self, t_ms: float) -> Fields:
        return Fields(
            is_frameset=lambda: True,
            as_frameset=lambda: [self.picture(1, t_ms), self.picture(2, t_ms)],
        )

    def motion(self, kind: str, t_ms: float, x: Sequence[float]) -> Fields:
        data = Fields(x=x[0], y=x[1], z=x[2])
        return Fields(
            is_frameset=lambda: False, is_motion_frame=lambda: True, get_timestamp=lambda: t_ms,
            get_profile=lambda: Fields(stream_type=lambda: kind),
            as_motion_frame=lambda: Fields(get_motion_data=lambda: data),
        )  # fmt: skip

    def _start(self, config: Any, callback: Callable[[Any], None]) -> Fields:
        del config
        if self.absent:
            raise RuntimeError("No device connected")
        for frame in self.frames:
            callback(frame)
        sensor = Fields(
            supports=lambda what: what != "correct", set_option=self.options.__setitem__
        )
        return Fields(
            get_device=lambda: Fields(query_sensors=lambda: [sensor]), get_stream=self._profile
        )

    def _profile(self, stream: str, index: int = 0) -> Fields:
        places = {"infrared1": se3.IDENTITY, "infrared2": self.T_RL}
        T_XL = places.get(f"{stream}{index}", se3.inverse(self.T_LB))
        intrinsics = Fields(
            width=self.size[0], height=self.size[1], fx=390.0, fy=390.0, ppx=320.0, ppy=240.0,
            coeffs=[0.0] * 5, model="distortion.brown_conrady",
        )  # fmt: skip
        motion = Fields(data=np.eye(3, 4).tolist(), noise_variances=[0.0] * 3)
        return Fields(
            T_XL=T_XL,
            get_extrinsics_to=lambda other: extrinsics(se3.compose(other.T_XL, se3.inverse(T_XL))),
            as_video_stream_profile=lambda: Fields(get_intrinsics=lambda: intrinsics),
            as_motion_stream_profile=lambda: Fields(get_motion_intrinsics=lambda: motion),
        )

    def _stop(self) -> None:
        self.stopped += 1
        if self.stopped > 1:
            raise RuntimeError("stop() cannot be called before start()")
