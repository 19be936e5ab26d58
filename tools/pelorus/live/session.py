# SPDX-License-Identifier: MIT
"""One camera and the pipeline: what is measured, in; where the robot is, out."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy

from pelorus.errors import PelorusError
from pelorus.eyes.front_end import Seen
from pelorus.live.camera import Camera, Force, Measured, Picture, Rate
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.native.binding import Precision
from pelorus.native.configured import Named
from pelorus.online import diagnosis
from pelorus.online.diagnosis import Level, Status
from pelorus.online.drive import Setup
from pelorus.online.odometry import Odom, Odometry
from pelorus.online.pipeline import CAMERAS, G_MPS2, Pipeline, header_of
from pelorus.wire.frames import Header, Imu, Message, Stereo

PICTURES_MOST = 6  # that may wait to be followed: three pairs
SILENCE_S = 5.0  # then the camera counts as gone
LOOK_S = 0.2  # so often it is asked whether to stop


class Arrival(NamedTuple):
    """A measurement; `too_slow`: more pictures wait behind it than may."""

    measured: Measured
    too_slow: bool


class Intake:
    """Iterates over a camera's measurements until it ends, or until `stop` is set.

    It takes them in a thread, so that no driver's queue overflows while the last picture is still
    being followed. A recorded camera waits for its reader, and needs none.
    """

    def __init__(self, camera: Camera, silence_s: float = SILENCE_S) -> None:
        self.stop = threading.Event()
        self._camera, self._silence_s = camera, silence_s
        self._queue: queue.SimpleQueue[Measured | BaseException | None] = queue.SimpleQueue()
        self._pictures = 0  # in the queue; each side writes, and the GIL keeps the sum

    def __iter__(self) -> Iterator[Arrival]:
        if self._camera.recorded:
            for one in self._camera.measured():
                if self.stop.is_set():
                    return
                yield Arrival(one, False)
            return
        thread = threading.Thread(target=self._read, name="camera", daemon=True)
        thread.start()
        try:
            yield from self._arrivals()
        finally:
            self.stop.set()
            self._camera.close()
            thread.join(timeout=self._silence_s)

    def _read(self) -> None:
        try:
            for one in self._camera.measured():
                if self.stop.is_set():
                    break
                self._pictures += isinstance(one, Picture)
                self._queue.put(one)
        except BaseException as error:
            self._queue.put(error)
            return
        self._queue.put(None)

    def _arrivals(self) -> Iterator[Arrival]:
        silent_s = 0.0
        while not self.stop.is_set():
            try:
                one = self._queue.get(timeout=LOOK_S)
            except queue.Empty:
                silent_s += LOOK_S
                if silent_s >= self._silence_s:
                    raise PelorusError(
                        f"{self._camera.name}: has given nothing for {self._silence_s:g} s: is it "
                        "still connected and powered (cable, hub, dmesg)? start again"
                    ) from None
                continue
            silent_s = 0.0
            if one is None:
                return
            if isinstance(one, BaseException):
                raise one
            self._pictures -= isinstance(one, Picture)
            yield Arrival(one, self._pictures > PICTURES_MOST)


REMEDY_FOR_G = f"multiply its readings by {G_MPS2:g}"
# From axes forward, left, up at the left camera to its own: right, down, ahead.
CAMERA_FROM_FLU = Poses(np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]), np.zeros(3))
HERE = (0.0,) * 6


def on_camera(mount: Sequence[float], header: Header) -> Poses:
    """Returns T_IB, of points of the base in the body of the filter. `mount` says where the left
    camera sits on the base: m forward, left, up; roll, pitch, yaw in degrees, pitch > 0 down."""
    T_BF = Poses(
        scipy.spatial.transform.Rotation.from_euler("ZYX", mount[:2:-1], degrees=True).as_matrix(),
        np.array(mount[:3]),
    )
    T_IC = se3.inverse(Poses(np.asarray(header.R_CB), np.asarray(header.t_CB_m)))
    return se3.compose(se3.compose(T_IC, CAMERA_FROM_FLU), se3.inverse(T_BF))


@dataclass(frozen=True)
class How:
    """What the user wants of the drive."""

    mount: tuple[float, ...] = HERE
    within_ms: float = 2.0
    settings: Named = field(default_factory=dict)
    precision: Precision = "float32"
    log: Path | None = None
    watch: Callable[[Message], None] | None = None


class Session:
    """`counts` are the measurements that came, by kind."""

    def __init__(self, camera: Camera, how: How) -> None:
        self.camera = camera
        self.pipeline = Pipeline(round(how.within_ms * 1e6), REMEDY_FOR_G)
        header = header_of(camera.calibrated, camera.inertial)
        self.pipeline.calibrated = replace(camera.calibrated, header=header)
        setup = Setup(header, how.settings, how.precision)
        T_IB = on_camera(how.mount, header)
        self.pipeline.odometry = Odometry(setup, T_IB, how.log, watch=how.watch)
        self.messages = self.too_slow = 0
        self.log_trouble = ""
        self.first_ns: int | None = None
        self.newest_ns = 0

    def take(self, one: Measured, too_slow: bool = False) -> list[Odom]:
        """Returns what is known after this. A pair of pictures is left out where older ones still
        wait to be followed: `too_slow`."""
        self.messages += 1
        self.first_ns = one.t_ns if self.first_ns is None else self.first_ns
        self.newest_ns = max(self.newest_ns, one.t_ns)
        match one:
            case Picture():
                return self._picture(one, too_slow)
            case Rate():
                return self._inertial(self.pipeline.joining.rate(one.t_ns, one.w_B_radps))
            case Force():
                return self._inertial(self.pipeline.joining.force(one.t_ns, one.a_B_mps2))
            case Imu():
                return self._inertial([one])
            case Stereo():
                return self.pipeline.seen(one.t_ns, Seen(one.ids, one.pixels))
            case _:
                return self.pipeline.add(one)

    @property
    def seconds(self) -> float:
        """Returns how long it has lasted by the stamps."""
        return 0.0 if self.first_ns is None else (self.newest_ns - self.first_ns) * 1e-9

    @property
    def odometry(self) -> Odometry:
        assert self.pipeline.odometry is not None
        return self.pipeline.odometry

    def finish(self) -> list[Odom]:
        """Uses what still waits, and closes the log."""
        drive = self.odometry.drive
        rest = self.pipeline.finish()
        log = None if drive is None else drive.log
        self.log_trouble = "" if log is None else log.trouble
        return rest

    def diagnose(self) -> list[Status]:
        """Returns what there is to say, the worst first; nothing where all is good."""
        found = [Status(name, Level.ERROR, words) for name, words in self.pipeline.blocked.items()]
        found += diagnosis.of_pairs(self.pipeline.pairing)
        found += diagnosis.of_halves(self.pipeline.together)
        found += diagnosis.of_speed(self.too_slow)
        found += diagnosis.of_odometry(self.odometry, self.pipeline.last, self.messages)
        bad = [one for one in found if one.level in (Level.WARN, Level.ERROR)]
        return sorted(bad, key=lambda one: -one.level)

    def _picture(self, one: Picture, too_slow: bool) -> list[Odom]:
        pair = self.pipeline.pairing.add(one.is_right, one.t_ns, one.pixels)
        if pair is None or CAMERAS in self.pipeline.blocked:
            return []
        if too_slow:
            self.too_slow += 1
            return []
        return self.pipeline.pictures(pair.t_ns, pair.left, pair.right)

    def _inertial(self, readings: list[Imu]) -> list[Odom]:
        for one in readings:
            self.pipeline.judge(one)
        return self.pipeline.inertial(readings)
