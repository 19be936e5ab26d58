# SPDX-License-Identifier: MIT
"""A RealSense with an IMU by librealsense: the two infrared pictures, emitter off, and the IMU.

Its pictures are rectified by the device. Stamps are of the host's clock (global time, which is on
unless somebody has turned it off).
"""

from __future__ import annotations

import queue
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from pelorus.errors import PelorusError
from pelorus.live import camera
from pelorus.live.camera import Asked, Force, Measured, Picture, Rate
from pelorus.math.se3 import Poses
from pelorus.program.extras import extra
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rig import Rig

SIZE, RATE_HZ = (640, 480), 30
WHERE = Path("the RealSense")
LENSES = {"brown_conrady": LensModel.RADTAN, "kannala_brandt4": LensModel.EQUIDISTANT}
UNCALIBRATED = (
    "the RealSense's IMU has its factory state, scale 1 and bias 0: rs-imu-calibration makes it "
    "better; the filter finds its biases"
)


def lens_of(given: Any) -> Lens:
    """Returns an intrinsics of librealsense; without numbers the picture is rectified."""
    size, intrinsics = (given.width, given.height), (given.fx, given.fy, given.ppx, given.ppy)
    coefficients = tuple(float(k) for k in given.coeffs)
    if not any(coefficients):
        return Lens(LensModel.NONE, intrinsics, (), *size)
    model = LENSES.get(str(given.model).rpartition(".")[2])
    if model is None:
        raise PelorusError(f"{WHERE}: a lens {given.model} is not known: give --calibration FILE")
    return Lens(
        model, intrinsics, coefficients[: 4 if model is LensModel.EQUIDISTANT else 5], *size
    )


def pose_of(given: Any) -> Poses:
    """Returns an extrinsics of librealsense, whose rotation stands column by column."""
    R = np.array(given.rotation, np.float64).reshape(3, 3).T
    return Poses(R, np.array(given.translation, np.float64))


def rig_of(left: Any, right: Any, accel: Any) -> Rig:
    """Returns the rig of three stream profiles; the body is the IMU."""
    first, second = (lens_of(s.as_video_stream_profile().get_intrinsics()) for s in (left, right))
    T_RL, T_LB = pose_of(left.get_extrinsics_to(right)), pose_of(accel.get_extrinsics_to(left))
    return Rig.of_cameras(WHERE, first, second, T_RL, T_LB)


def is_calibrated(motion: Any) -> bool:
    """Returns whether somebody has calibrated this part of the IMU; the device applies it."""
    return not np.array_equal(np.array(motion.data), np.eye(3, 4))


class RealSense:
    """librealsense hands frames over in a thread of its own."""

    name, recorded, inertial = str(WHERE), False, True

    def __init__(self, asked: Asked) -> None:
        with extra("pyrealsense2"):
            import pyrealsense2 as rs  # noqa: PLC0415 - an extra
        self._rs: Any = rs
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        size, rate = asked.size or SIZE, asked.rate_hz or RATE_HZ
        config = rs.config()
        if asked.source:
            config.enable_device(asked.source)
        for k in (1, 2):
            config.enable_stream(rs.stream.infrared, k, *size, rs.format.y8, rate)
        for stream in (rs.stream.accel, rs.stream.gyro):
            config.enable_stream(stream, rs.format.motion_xyz32f)
        self._pipeline: Any = rs.pipeline()
        try:
            profile = self._pipeline.start(config, self._queue.put)
        except RuntimeError as error:
            raise PelorusError(
                f"no RealSense with an IMU gives {size[0]} x {size[1]} px at {rate} Hz ({error}): "
                "is it plugged in at USB 3, a D435i, D455 or D456, and used by nobody else? "
                "--size and --rate must be ones that rs-enumerate-devices lists"
            ) from error
        try:
            self._set_options(profile.get_device())
            left, right = (profile.get_stream(rs.stream.infrared, k) for k in (1, 2))
            accel, gyro = (profile.get_stream(one) for one in (rs.stream.accel, rs.stream.gyro))
            self.calibrated = camera.calibrated(
                asked, size, "RealSense", lambda: rig_of(left, right, accel)
            )
            parts = (
                one.as_motion_stream_profile().get_motion_intrinsics() for one in (accel, gyro)
            )
            plain = () if all(map(is_calibrated, parts)) else (UNCALIBRATED,)
            self.remarks = (*self.calibrated.remarks, *plain)
        except BaseException:
            self.close()
            raise

    def _set_options(self, device: Any) -> None:
        """No dots of the emitter in the pictures: they move along, and look like points."""
        option = self._rs.option
        wanted = ((option.emitter_enabled, 0), (option.enable_motion_correction, 1),
                  (option.global_time_enabled, 1))  # fmt: skip
        for sensor in device.query_sensors():
            for what, value in wanted:
                if sensor.supports(what):
                    sensor.set_option(what, value)

    def measured(self) -> Iterator[Measured]:
        while (frame := self._queue.get()) is not None:
            yield from self._of_frame(frame)

    def close(self) -> None:
        with suppress(RuntimeError):  # it has stopped, or is gone
            self._pipeline.stop()
        self._queue.put(None)

    def _of_frame(self, frame: Any) -> Iterator[Measured]:
        if frame.is_frameset():
            for one in frame.as_frameset():
                yield from self._of_frame(one)
            return
        t_ns = round(frame.get_timestamp() * 1e6)
        profile = frame.get_profile()
        if frame.is_motion_frame():
            x = frame.as_motion_frame().get_motion_data()
            is_force = profile.stream_type() == self._rs.stream.accel
            yield (Force if is_force else Rate)(t_ns, np.array([x.x, x.y, x.z]))
        elif profile.stream_type() == self._rs.stream.infrared:
            pixels = np.array(frame.get_data())  # a copy: librealsense has few buffers
            yield Picture(t_ns, profile.stream_index() == 2, pixels)


open_camera = RealSense
