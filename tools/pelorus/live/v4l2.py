# SPDX-License-Identifier: MIT
"""A USB camera that gives both pictures side by side, by V4L2, and an IMU at a serial port.

Pictures bear the kernel's stamps (CLOCK_MONOTONIC). Lines of the IMU bear the time at which they
come; or, with a time of their own before the six numbers, that one, brought to the host's clock by
the line that came with the least delay.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np

from pelorus.errors import PelorusError
from pelorus.live import camera
from pelorus.live.camera import Asked, Measured, OtherClock, Picture
from pelorus.live.port import Wire
from pelorus.program.extras import cv2
from pelorus.rig.rig import Rig
from pelorus.wire.frames import Imu
from pelorus.wire.layout import Floats

SIZE, RATE_HZ, BAUD = (640, 480), 30, 115200
LINE_BYTES_MAX = 400
WAIT_S = 0.01
LINES = "`ax ay az wx wy wz` in m/s^2 and rad/s, or with a time in s before them"


class LineImu:
    """Readings of an IMU as lines of numbers, between spaces or commas. `bad` counts the others."""

    def __init__(self) -> None:
        self.bad = self.good = 0
        self._rest = b""
        self._clock = OtherClock()
        self._last_ns = 0

    def readings(self, piece: bytes, now_ns: int) -> Iterator[Imu]:
        """Returns those that this piece completes; it came now."""
        self._last_ns = self._last_ns or now_ns - 1
        *lines, self._rest = (self._rest + piece).split(b"\n")
        self._rest = self._rest[-LINE_BYTES_MAX:]
        rows = [row for line in lines if (row := self._numbers(line)) is not None]
        for k, row in enumerate(rows, 1):
            # Lines of one piece have come one after the other since the last piece.
            t_ns = self._last_ns + (now_ns - self._last_ns) * k // len(rows)
            if len(row) == 7:
                own_ns = round(row[0] * 1e9)
                self._clock.heard(own_ns, now_ns)
                t_ns = self._clock.to_host(own_ns)
            yield Imu(t_ns, row[None, -6:-3], row[None, -3:])
        self._last_ns = now_ns

    def _numbers(self, line: bytes) -> Floats | None:
        try:
            numbers = np.array(line.replace(b",", b" ").split(), np.float64)
        except ValueError:
            numbers = np.zeros(0)
        if len(numbers) not in (6, 7) or not np.isfinite(numbers).all():
            self.bad += bool(line.strip())
            return None
        self.good += 1
        return numbers


class V4l2:
    """`capture` and `wire` are opened by the user's words, and given by tests."""

    recorded, inertial = False, True

    def __init__(self, asked: Asked, capture: Any, wire: Wire, clock_ns: Callable[[], int]) -> None:
        self.name = asked.source or "/dev/video0"
        self._capture, self._wire, self._clock_ns = capture, wire, clock_ns
        width, height = asked.size or SIZE
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, 2 * width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        capture.set(cv2.CAP_PROP_FPS, asked.rate_hz or RATE_HZ)
        self.calibrated = camera.calibrated(asked, (width, height), self.name, self._unknown)
        self.remarks = self.calibrated.remarks
        self._size, self._lines = (width, height), LineImu()
        self._pictures: SimpleQueue[Picture | None] = SimpleQueue()
        self._closed = threading.Event()

    def _unknown(self) -> Rig:
        raise PelorusError(
            f"{self.name}: no factory has calibrated it: give --calibration FILE "
            "(Kalibr's camchain-imucam.yaml ...)"
        )

    def measured(self) -> Iterator[Measured]:
        threading.Thread(target=self._look, name="v4l2", daemon=True).start()
        while not self._closed.is_set():
            yield from self._lines.readings(self._wire.exchange(b"", WAIT_S, 1.0), self._clock_ns())
            if self._lines.bad > 50 + self._lines.good:
                raise PelorusError(f"--imu: its lines are no readings; {LINES} is expected")
            try:
                while (one := self._pictures.get_nowait()) is not None:
                    yield one
            except Empty:
                continue
            raise PelorusError(f"{self.name}: gives no pictures any more: cable? start again")

    def close(self) -> None:
        self._closed.set()
        self._capture.release()
        self._wire.close()

    def _look(self) -> None:
        while not self._closed.is_set():
            there, pixels = self._capture.read()
            if not there:
                self._pictures.put(None)
                return
            stamp_ms = self._capture.get(cv2.CAP_PROP_POS_MSEC)
            t_ns = round(stamp_ms * 1e6) if stamp_ms > 0 else self._clock_ns()
            for one in self._halves(t_ns, pixels):
                self._pictures.put(one)

    def _halves(self, t_ns: int, pixels: Any) -> Iterator[Picture]:
        gray = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
        middle = gray.shape[1] // 2
        yield Picture(t_ns, False, np.ascontiguousarray(gray[:, :middle]))
        yield Picture(t_ns, True, np.ascontiguousarray(gray[:, middle:]))


def open_camera(asked: Asked) -> V4l2:
    """Returns it, open."""
    from pelorus.robot.serial import open_serial  # noqa: PLC0415 - Windows has no termios

    if not asked.imu:
        raise PelorusError(f"--camera v4l2 needs --imu DEVICE[:BAUD], which gives lines {LINES}")
    source = asked.source or "/dev/video0"
    capture = cv2.VideoCapture(source, cv2.CAP_V4L2)
    if not capture.isOpened():
        raise PelorusError(
            f"{source}: is no camera that can be opened: is it plugged in, may you use it (group "
            "video), and does nobody else? v4l2-ctl --list-devices has their names"
        )
    device, _, baud = asked.imu.rpartition(":")
    known = (device, int(baud)) if device and baud.isdecimal() else (asked.imu, BAUD)
    wire = open_serial(Path(known[0]), known[1])
    return V4l2(asked, capture, wire, time.monotonic_ns)
