# SPDX-License-Identifier: MIT
"""From what sensors measure to odometry: pictures are paired and followed, readings corrected.

The ROS 2 node and `pelorus live` are both made of it. It knows no camera, no message and no clock.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pelorus.converters.streams import FORCES_MPS2
from pelorus.errors import PelorusError
from pelorus.evaluate.health import DEGRADED, LOST
from pelorus.eyes.front_end import Eyes, Seen
from pelorus.faults.sync import PictureDelay
from pelorus.math import se3
from pelorus.math.inertial import Inertial
from pelorus.math.se3 import Poses
from pelorus.online.odometry import Odom, Odometry
from pelorus.online.order import Datum, Joining, Pairing, Together
from pelorus.rig.read import Calibrated
from pelorus.tracking.images import Gray
from pelorus.wire import schema
from pelorus.wire.frames import Header, Imu, Process, Stereo, Twist
from pelorus.wire.layout import Floats

KEPT_NS = 2_000_000_000  # velocities older than this say nothing of the next pair
# a velocity that is known worse does not say where points will be
SPEED_SIGMA_MPS = schema.EYES_SPEED_SIGMA_MPS


class Velocity(NamedTuple):
    """Of the body, in its own axes; None: not known, as of a gyro alone."""

    t_ns: int
    w_radps: Floats
    v_mps: Floats | None


class ExpectedMotion:
    """Collects velocities of the body and tells the points' motion from pair to pair.

    `T_CB` brings points of the body into the camera.
    """

    def __init__(self, T_CB: Poses) -> None:
        self._T_CB = T_CB
        self._velocities: deque[Velocity] = deque()
        self._last_ns: int | None = None

    def add(self, one: Velocity) -> None:
        """Takes the velocity from its time on."""
        if self._velocities and one.t_ns <= self._velocities[-1].t_ns:
            return
        self._velocities.append(one)
        while one.t_ns - self._velocities[0].t_ns > KEPT_NS:
            self._velocities.popleft()

    def until(self, t_ns: int) -> tuple[Floats, Floats] | None:
        """Returns (R, p), x_now = R x_then + p in the camera, since the pair before this one; None
        for the first pair, or where no velocity is known."""
        last, self._last_ns = self._last_ns, t_ns
        if last is None or not last < t_ns <= last + KEPT_NS or not self._velocities:
            return None
        known = [one for one in self._velocities if last <= one.t_ns < t_ns]
        used = known or [self._velocities[-1]]
        seconds = (t_ns - last) * 1e-9
        speeds = [one.v_mps for one in used if one.v_mps is not None]
        v = np.mean(speeds, axis=0) if speeds else np.zeros(3)
        step = se3.exp(v * seconds, np.mean([one.w_radps for one in used], axis=0) * seconds)
        now = se3.conjugate(self._T_CB, se3.inverse(step))
        return now.R, now.p if speeds else np.zeros(3)


def known_velocity(velocity: Floats, covariance: Floats) -> Floats | None:
    """Returns the linear part of (v, w) where it is known well enough to tell where points are."""
    sigma = np.sqrt(np.diag(covariance)[:3])
    return velocity[:3] if bool((sigma < SPEED_SIGMA_MPS).all()) else None


WINDOW = 50  # readings by whose median the unit is judged
WINDOWS_ENOUGH = 4
POINTS_ENOUGH = 10  # to tell by their disparities that the cameras are swapped
G_MPS2 = 9.80665
FIRST_LOOK = 4  # a look takes 60 ms, and the first pairs wait while the rest is made ready
CAMERAS, IMU = "cameras", "imu"


def header_of(calibrated: Calibrated, inertial: bool, size: tuple[int, int] = (0, 0)) -> Header:
    """Returns the HEADER of a drive: its process, the IMU's noise, and the pictures' size."""
    header = calibrated.header
    if inertial:
        told = {name: s for name, s in vars(calibrated.imu.noise).items() if s >= 0}
        header = replace(header, process=Process.IMU, noise=replace(header.noise, **told))
    if size[0] and not header.image_width_px:
        header = replace(header, image_width_px=size[0], image_height_px=size[1])
    return header


def eyes_of(calibrated: Calibrated, left: Gray) -> Eyes:
    """Returns what follows pictures of this size."""
    rows, columns = left.shape
    rig = calibrated.rig
    if rig is not None:
        rig = rig.of_size(columns, rows)
    return Eyes(calibrated.header.camera, (columns, rows), rig, first_look=FIRST_LOOK)


def require_size(left: Gray, right: Gray, width_px: int, height_px: int) -> None:
    """Raises PelorusError where pictures are not as large as the calibration says."""
    for name, picture in (("left", left), ("right", right)):
        rows, columns = picture.shape
        if width_px and (columns, rows) != (width_px, height_px):
            raise PelorusError(
                f"the {name} pictures have {columns} x {rows} pixels, the calibration is of "
                f"{width_px} x {height_px}: give the one of these pictures"
            )


@dataclass
class UnitCheck:
    """Judges by the first readings whether an accelerometer tells m/s^2, gravity in it."""

    remedy: str  # what to do where it tells g
    _forces: deque[float] = field(default_factory=lambda: deque(maxlen=WINDOW))
    _right: int = 0  # windows in a row

    def trouble(self, force_mps2: float) -> str | None:
        """Returns what is wrong by the last window, "" if it is right; None within a window."""
        if self._right >= WINDOWS_ENOUGH:
            return None
        self._forces.append(force_mps2)
        if len(self._forces) < WINDOW:
            return None
        usual = float(np.median(self._forces))
        self._forces.clear()
        if FORCES_MPS2[0] <= usual <= FORCES_MPS2[1]:
            self._right += 1
            return ""
        self._right = 0
        hint = "has gravity been taken away (a filtered topic)? raw readings are wanted"
        if FORCES_MPS2[0] <= usual * G_MPS2 <= FORCES_MPS2[1]:
            hint = f"that is g: {self.remedy}"
        return f"the specific force is {usual:.3g} m/s^2 in the median, not 9.81: {hint}"


class Pipeline:
    """`blocked` says why nothing is told although data come: what was found cannot be right."""

    def __init__(self, within_ns: int, remedy_for_g: str) -> None:
        """`within_ns`: pictures whose stamps differ by so much at most belong together."""
        self.within_ns, self._remedy = within_ns, remedy_for_g
        self.calibrated: Calibrated | None = None
        self.odometry: Odometry | None = None
        self.last: Odom | None = None
        self.begin()

    def begin(self) -> None:
        """Forgets what the sensors have shown; the odometry goes on."""
        self.blocked: dict[str, str] = {}
        self.pairing: Pairing[Any] = Pairing(self.within_ns)
        self.joining = Joining()
        self._unit = UnitCheck(self._remedy)
        self._eyes: Eyes | None = None
        self._expected: ExpectedMotion | None = None
        self.together: Together | None = None

    # --- cameras

    def pictures(self, t_ns: int, left: Gray, right: Gray) -> list[Odom]:
        """A pair, as the cameras took it."""
        assert self.calibrated is not None
        if CAMERAS in self.blocked:
            return []
        header = self.calibrated.header
        require_size(left, right, header.image_width_px, header.image_height_px)
        if self._eyes is None:
            self._eyes = eyes_of(self.calibrated, left)
        motion = self._motion().until(t_ns + self._offset_ns)
        try:
            seen = self._eyes.see(t_ns, left, right, motion)
            self._eyes.require_rectified((Path("left"), Path("right")))
        except PelorusError as error:
            self.blocked[CAMERAS] = str(error)
            return []
        return self.seen(t_ns, seen)

    def seen(self, t_ns: int, seen: Seen) -> list[Odom]:
        """Points of the rectified pair."""
        assert self.calibrated is not None
        disparity = seen.pixels[:, 0] - seen.pixels[:, 2]
        if len(disparity) > POINTS_ENOUGH and float(np.median(disparity)) < 0:
            self.blocked[CAMERAS] = (
                "most points lie further right in the right picture than in the left one: are left "
                "and right swapped?"
            )
            return []
        if self.together is None:
            self.together = Together(self.calibrated.header.camera)
        self.together.add(t_ns, seen)
        return self.add(Stereo(t_ns + self._offset_ns, seen.ids, seen.pixels))

    @property
    def _offset_ns(self) -> int:
        """Returns the body's clock less the cameras'."""
        rig = None if self.calibrated is None else self.calibrated.rig
        return 0 if rig is None else round(rig.offset_s * 1e9)

    # --- motion

    def _motion(self) -> ExpectedMotion:
        assert self.calibrated is not None
        if self._expected is None:
            header = self.calibrated.header
            self._expected = ExpectedMotion(Poses(header.R_CB, header.t_CB_m))
        return self._expected

    def _speed(self) -> Floats | None:
        """Returns the last velocity, where it is known well."""
        last = None if self.last is None else self.last.estimate
        return None if last is None else known_velocity(last.velocity, last.velocity_covariance)

    def judge(self, reading: Imu) -> None:
        """Whether the accelerometer's unit is right; also before anything is calibrated."""
        trouble = self._unit.trouble(float(np.linalg.norm(reading.a_B_mps2)))
        if trouble:
            self.blocked[IMU] = trouble
        elif trouble is not None:
            self.blocked.pop(IMU, None)

    def inertial(self, readings: Iterable[Imu]) -> list[Odom]:
        """Readings of one time each, as the IMU gave them."""
        assert self.calibrated is not None
        told = []
        for one in readings:
            raw = Inertial(np.array([one.t_ns]), one.a_B_mps2, one.w_B_radps)
            right = self.calibrated.imu.correction.of(raw)
            self._motion().add(Velocity(one.t_ns, right.w_B_radps[0], self._speed()))
            told += self.add(Imu(one.t_ns, right.a_B_mps2, right.w_B_radps))
        return told

    # --- the filter

    def add(self, datum: Datum) -> list[Odom]:
        """Anything that the filter takes as it is."""
        assert self.odometry is not None
        if isinstance(datum, Twist):
            self._motion().add(Velocity(datum.t_ns, datum.w_B_radps, datum.v_B_mps))
        return self._told(self.odometry.add(datum))

    def finish(self) -> list[Odom]:
        """Uses what still waits, and ends the log."""
        return [] if self.odometry is None else self._told(self.odometry.finish())

    def _told(self, odoms: list[Odom]) -> list[Odom]:
        if self.blocked:
            return []
        if self.together is not None and self.together.found is not None:
            odoms = [self._doubted(odom, self.together.found) for odom in odoms]
        if odoms:
            self.last = odoms[-1]
        return odoms

    def _doubted(self, odom: Odom, apart: PictureDelay) -> Odom:
        """Halves that were not taken together make points of no place: by more than a pixel's
        noise the covariance holds nothing any more."""
        drive = None if self.odometry is None else self.odometry.drive
        noise_px = 1.0 if drive is None else drive.filter.setting("pixel-sigma")
        least = LOST if apart.moved_px > noise_px else DEGRADED
        worst = max(odom.estimate.health, least)
        return odom._replace(estimate=odom.estimate._replace(health=worst))
