# SPDX-License-Identifier: MIT
"""An OAK by DepthAI 3: the mono pair CAM_B and CAM_C, and the IMU; calibrated by its EEPROM.

Stamps are those of the host's clock, to which DepthAI brings the device's, at the middle of the
exposure.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from pelorus.errors import PelorusError
from pelorus.io.named import Named
from pelorus.live import camera
from pelorus.live.camera import Asked, Force, Measured, Picture, Rate
from pelorus.program.extras import extra
from pelorus.rig.factory import depthai
from pelorus.rig.rig import Rig

SIZE, RATE_HZ, IMU_HZ = (640, 400), 20, 200
PAIR = ("CAM_B", "CAM_C")
POLL_S = 0.002
ABSENT = (
    "is it plugged in, at USB 3 with enough power? On Linux its udev rule is needed: "
    'SUBSYSTEM=="usb", ATTRS{idVendor}=="03e7", MODE="0666"'
)


def rig_of(content: dict[str, Any]) -> Rig:
    """Returns what the EEPROM's JSON says of the mono pair and the IMU."""
    return depthai(Named(Path("the OAK's EEPROM"), content), PAIR)


def nanoseconds(stamp: timedelta) -> int:
    """Returns it exactly: a float of seconds would round."""
    return (stamp.days * 86400 + stamp.seconds) * 10**9 + stamp.microseconds * 1000


class Oak:
    """Left and right are told by the calibration, whatever the sockets are called."""

    name, recorded, inertial = "the OAK", False, True
    remarks: Sequence[str]

    def __init__(self, asked: Asked) -> None:
        with extra("depthai"):
            import depthai as dai  # noqa: PLC0415 - an extra
        if int(dai.__version__.split(".")[0]) < 3:
            raise PelorusError(
                f"depthai {dai.__version__} is installed, 3 is expected: pip install -U depthai"
            )
        self._dai: Any = dai
        size, rate = asked.size or SIZE, asked.rate_hz or RATE_HZ
        try:
            device = dai.Device(dai.DeviceInfo(asked.source)) if asked.source else dai.Device()
        except RuntimeError as error:
            raise PelorusError(f"no OAK can be opened ({error}): {ABSENT}") from error
        self._device: Any = device
        try:
            content = device.readCalibration().eepromToJson()
            self.calibrated = camera.calibrated(asked, size, "OAK", lambda: rig_of(content))
            rig = self.calibrated.rig
            self._swapped = rig_of(content).swapped if not asked.calibration else False
            self.remarks = self.calibrated.remarks if rig is not None else ()
            self._begin(size, rate)
        except BaseException:
            self.close()
            raise

    def _begin(self, size: tuple[int, int], rate_hz: int) -> None:
        dai = self._dai
        self._pipeline = dai.Pipeline(self._device)
        self._pictures = []
        for k, name in enumerate(PAIR):
            socket = getattr(dai.CameraBoardSocket, name)
            camera = self._pipeline.create(dai.node.Camera).build(socket)
            out = camera.requestOutput(size, dai.ImgFrame.Type.GRAY8, fps=rate_hz)
            queue = out.createOutputQueue(maxSize=8, blocking=False)
            self._pictures.append(((k == 1) != self._swapped, queue))
        imu = self._pipeline.create(dai.node.IMU)
        sensors = [dai.IMUSensor.ACCELEROMETER_RAW, dai.IMUSensor.GYROSCOPE_RAW]
        imu.enableIMUSensor(sensors, IMU_HZ)
        imu.setBatchReportThreshold(1)
        imu.setMaxBatchReports(10)
        self._readings = imu.out.createOutputQueue(maxSize=100, blocking=False)
        self._pipeline.start()

    def measured(self) -> Iterator[Measured]:
        try:
            while self._pipeline.isRunning():
                found = [*self._inertial(), *self._pairs()]
                yield from found
                if not found:
                    time.sleep(POLL_S)
        except RuntimeError as error:  # X_LINK_ERROR
            raise PelorusError(
                f"the OAK is lost ({error}): cable and power? start again"
            ) from error
        raise PelorusError("the OAK has stopped: cable and power? start again")

    def close(self) -> None:
        self._device.close()

    def _inertial(self) -> Iterator[Measured]:
        for message in self._readings.tryGetAll():
            for packet in message.packets:
                for made, one in ((Force, packet.acceleroMeter), (Rate, packet.gyroscope)):
                    yield made(nanoseconds(one.getTimestamp()), np.array([one.x, one.y, one.z]))

    def _pairs(self) -> Iterator[Measured]:
        middle = self._dai.CameraExposureOffset.MIDDLE
        for is_right, queue in self._pictures:
            for frame in queue.tryGetAll():
                yield Picture(nanoseconds(frame.getTimestamp(middle)), is_right, frame.getCvFrame())


open_camera = Oak
