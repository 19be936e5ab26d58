# SPDX-License-Identifier: MIT
"""Messages of ROS in, odometry out: all of the node that needs no rclpy.

A message is anything with the fields of its type. What cannot be used is counted and told in
`diagnose`, and nothing here raises for what a message holds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pelorus.converters import ros_frames
from pelorus.errors import PelorusError, write_text
from pelorus.eyes.front_end import Seen
from pelorus.io.known_map import known_map
from pelorus.online import diagnosis
from pelorus.online.diagnosis import Status
from pelorus.online.drive import Setup
from pelorus.online.odometry import Given, Odom, Odometry
from pelorus.online.pipeline import CAMERAS, G_MPS2, Pipeline
from pelorus.wire import schema
from pelorus.wire.frames import Imu, Reading, Twist
from pelorus.wire.layout import Floats

from pelorus_ros import conventions, status
from pelorus_ros.mounting import NoChain, bare
from pelorus_ros.parameters import Options
from pelorus_ros.rigging import SIDES, NotYet, Rigged, Rigging


def stamp_ns(header: Any) -> int:
    """Returns the time of a header."""
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


@dataclass(frozen=True)
class Wheels:
    """A velocity (3,) and a rate (3,) in the axes of a frame, with sigmas, 0 where not told."""

    t_ns: int
    frame: str
    v_mps: Floats
    w_radps: Floats
    sigma: Floats


class Estimator:
    """Everything between messages and odometry: the pipeline, once calibration and frames are
    known.
    """

    def __init__(self, options: Options) -> None:
        self.options = options
        self.rigging = Rigging(options)
        within_ns = round(options.sync_matching_threshold_ms * 1e6)
        remedy = f"set the parameter accel_scale to {G_MPS2:g}"
        self.pipeline = Pipeline(within_ns, remedy)
        self.waits_for = "for the first data"
        self.counts: Counter[str] = Counter()  # messages used, by topic; what was left out
        self.faults: dict[str, str] = {}  # of messages that could not be read, by topic
        self.rigged: Rigged | None = None
        self._size: tuple[int, int] = (0, 0)
        self._known = known_map(Path(options.known_map)) if options.known_map else ()
        self._given: Given | None = self._initial()
        self._before: Counter[str] = Counter()

    @property
    def odometry(self) -> Odometry | None:
        return self.pipeline.odometry

    @property
    def blocked(self) -> dict[str, str]:
        return self.pipeline.blocked

    # --- what comes

    def transforms(self, message: Any) -> list[Odom]:
        self.rigging.mounting.add(message)
        return []

    def camera_info(self, side: str, message: Any) -> list[Odom]:
        self.rigging.camera_info(side, message)
        return []

    def picture(self, side: str, message: Any, too_slow: bool = False) -> list[Odom]:
        """An Image or a CompressedImage. A pair that comes while older ones still wait to be
        followed is left out, so that the odometry stays in time: `too_slow`.
        """
        self.counts[f"{side}/image"] += 1
        self.rigging.heard(side, message.header.frame_id)
        pair = self.pipeline.pairing.add(side == "right", stamp_ns(message.header), message)
        if pair is None:
            return []
        if too_slow:
            self.counts["too slow"] += 1
            return []
        return self._guarded("left/image", lambda: self._followed(pair.t_ns, pair.left, pair.right))

    def tracks(self, message: Any) -> list[Odom]:
        """A message of one of parameters.TRACKS."""
        self.counts["tracks"] += 1
        self.rigging.heard("left", message.header.frame_id)
        return self._guarded("tracks", lambda: self._told(message))

    def imu(self, message: Any) -> list[Odom]:
        self.counts["imu"] += 1
        self.rigging.heard("imu", message.header.frame_id)
        t_ns = stamp_ns(message.header)
        return self._inertial(
            [Imu(t_ns, _row(message.linear_acceleration), _row(message.angular_velocity))]
        )

    def gyro(self, message: Any) -> list[Odom]:
        self.counts["gyro"] += 1
        self.rigging.heard("imu", message.header.frame_id)
        w = _row(message.angular_velocity)[0]
        return self._inertial(self.pipeline.joining.rate(stamp_ns(message.header), w))

    def accel(self, message: Any) -> list[Odom]:
        self.counts["accel"] += 1
        a = _row(message.linear_acceleration)[0]
        return self._inertial(self.pipeline.joining.force(stamp_ns(message.header), a))

    def wheels(self, message: Any) -> list[Odom]:
        """An Odometry, or a TwistWithCovarianceStamped."""
        self.counts["wheels"] += 1
        frame = bare(getattr(message, "child_frame_id", "") or message.header.frame_id)
        self.rigging.heard("wheels", frame)
        twist = message.twist.twist
        C = np.array(message.twist.covariance, np.float64).reshape(6, 6)
        read = Wheels(
            stamp_ns(message.header), frame, _row(twist.linear)[0], _row(twist.angular)[0],
            np.sqrt(np.clip(np.diag(C)[:3], 0, None)),
        )  # fmt: skip
        if self.options.motion == "wheels":
            if not self._ready():
                return []
            return self.pipeline.add(Twist(read.t_ns, read.v_mps, read.w_radps))
        return self._guarded("wheels", lambda: self._beside(read))

    def initial_pose(self, message: Any) -> list[Odom]:
        """A PoseWithCovarianceStamped of the base in odom."""
        p, q = message.pose.pose.position, message.pose.pose.orientation
        T = conventions.pose_of((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
        C = np.array(message.pose.covariance, np.float64).reshape(6, 6)
        if T is None or not np.isfinite(C).all():
            self.faults["initialpose"] = "the pose is not finite, or its quaternion has no length"
            return []
        C = 0.5 * (C + C.T)
        floor = np.diag(np.repeat(np.square(self.options.initial_pose_sigma), 3))
        P = conventions.from_ros(T.R, C + np.where(np.diag(np.diag(C) <= 0), floor, 0.0))
        return self._guarded("initialpose", lambda: self._place(Given(T, P)))

    # --- services; each raises PelorusError

    def reset(self) -> None:
        """A new drive that knows nothing of this one."""
        if self.odometry is not None:
            self.odometry.finish()
            self.odometry.restart()
        self.pipeline.last, self.rigged, self._size = None, None, (0, 0)
        self.pipeline.begin()

    def save_state(self) -> str:
        file = self._state_file()
        if self.odometry is None:
            raise PelorusError("nothing is known yet, so there is nothing to save")
        saved = self.odometry.save()
        write_text(file, saved.hex())
        return f"{file}: {len(saved)} bytes"

    def load_state(self) -> str:
        file = self._state_file()
        if self.odometry is None:
            raise PelorusError(f"cannot load yet: waits {self.waits_for}")
        try:
            saved = bytes.fromhex(file.read_text("ascii"))
        except (OSError, ValueError) as error:
            raise PelorusError(f"{file}: holds no saved state: {error}") from error
        moved = self.options.moved_sigma
        self.odometry.load(saved, (moved[0], moved[1]))
        return f"{file}: goes on from there"

    def finish(self) -> list[Odom]:
        """The rest of what waits, and the end of the log."""
        return self.pipeline.finish()

    def _state_file(self) -> Path:
        if not self.options.state_file:
            raise PelorusError("the parameter state_file is not set: it names the file")
        return Path(self.options.state_file)

    # --- pictures and tracks

    def _followed(self, t_ns: int, left: Any, right: Any) -> list[Odom]:
        pictures = [
            ros_frames.gray(Path(f"{side}/image"), m)
            for side, m in zip(SIDES, (left, right), strict=True)
        ]
        self._size = pictures[0].shape[1], pictures[0].shape[0]
        if not self._ready() or self.rigged is None or CAMERAS in self.blocked:
            return []
        if self.rigged.swapped:
            pictures.reverse()
        return self.pipeline.pictures(t_ns, pictures[0], pictures[1])

    def _told(self, message: Any) -> list[Odom]:
        if not self._ready() or self.rigged is None:
            return []
        if hasattr(message, "left_u"):
            sides = (message.left_u, message.left_v, message.right_u, message.right_v)
            if len({len(message.id), *map(len, sides)}) > 1:
                raise PelorusError("id, left_u, left_v, right_u and right_v differ in length")
            ids = np.array(message.id, np.uint32)
            pixels = np.array(sides, np.float64).T.reshape(-1, 4)
        else:
            rows = ros_frames.observations(Path("tracks"), message, self.rigged.calibrated)
            ids, pixels = (rows[:, 0].astype(np.int64) % 2**32).astype(np.uint32), rows[:, 1:]
        rig = self.rigged.calibrated.rig
        if rig is not None:
            pixels = rig.rectification().pixels(pixels)
        good = np.isfinite(pixels).all(axis=1)
        return self.pipeline.seen(
            stamp_ns(message.header), Seen(ids[good], pixels[good].astype(np.float32))
        )

    # --- motion

    def _inertial(self, readings: Iterable[Imu]) -> list[Odom]:
        told = []
        for one in readings:
            a, w = one.a_B_mps2 * self.options.accel_scale, one.w_B_radps * self.options.gyro_scale
            scaled = Imu(one.t_ns, a, w)
            self.pipeline.judge(scaled)
            if self._ready():
                told += self.pipeline.inertial([scaled])
        return told

    def _beside(self, read: Wheels) -> list[Odom]:
        """Wheels beside an IMU: their velocities in the IMU's axes, where they are."""
        if not self._ready() or self.rigged is None:
            return []
        T = self.rigging.wheels_on_body(read.frame, self.rigged.T_IB)
        given = np.array(self.options.wheel_sigma_mps)
        sigma = np.where(read.sigma > 0, read.sigma, given)
        number = schema.SENSORS["wheel"]
        told = []
        for at, v, noise in _each_wheel(read, self.options.wheel_track_m, sigma):
            inside = np.sqrt(np.diag(T.R @ np.diag(noise**2) @ T.R.T))
            one = Reading(read.t_ns, number, 7, T.R @ v, inside, T.p + T.R @ at)
            told += self.pipeline.add(one)
        return told

    # --- what it takes to begin

    def _ready(self) -> bool:
        """Whether all is known; if not, `waits_for` says what lacks."""
        if self.rigged is not None:
            return True
        try:
            if not self.options.tracks_type and not self._size[0]:
                raise NotYet("for pictures: left/image and right/image, a pair of them")
            rigged = self.rigging.rigged(self._size)
            if self.odometry is None:
                options = self.options
                setup = Setup(
                    rigged.calibrated.header,
                    options.filter_settings(),
                    options.filter_precision,
                    self._known,
                )
                log = Path(options.log) if options.log else None
                self.pipeline.odometry = Odometry(setup, rigged.T_IB, log, self._given)
        except (NotYet, NoChain, PelorusError) as missing:
            self.waits_for = str(missing)
            return False
        self.rigged, self.waits_for = rigged, ""
        self.pipeline.calibrated = rigged.calibrated
        return True

    @property
    def child_frame(self) -> str:
        """What /odom calls the moving frame."""
        return self.options.base_frame or self.rigging.body_frame()

    def _initial(self) -> Given | None:
        numbers = self.options.initial_pose
        if len(numbers) != 7:
            return None
        T = conventions.pose_of(tuple(numbers[:3]), tuple(numbers[3:]))
        if T is None:
            raise PelorusError(f"parameter initial_pose: {numbers}: no unit quaternion")
        return Given(T, np.diag(np.repeat(np.square(self.options.initial_pose_sigma), 3)))

    def _place(self, given: Given) -> list[Odom]:
        if self.odometry is None:
            self._given = given
        else:
            self.odometry.place(given)
        return []

    # --- out

    def _guarded(self, topic: str, work: Callable[[], list[Odom]]) -> list[Odom]:
        """A message that cannot be used is told, and the next one is taken."""
        try:
            return work()
        except (PelorusError, NoChain, NotYet, ValueError) as error:
            self.faults[topic] = str(error)
            self.counts["unusable"] += 1
            return []

    def landmarks(self) -> NDArray[np.void]:
        """Returns the landmarks in odom, (n,) of conventions.LANDMARK."""
        odometry = self.odometry
        if odometry is None or odometry.drive is None or odometry.origin is None:
            return np.zeros(0, conventions.LANDMARK)
        return conventions.landmark_rows(odometry.drive.filter.landmarks(), odometry.origin)

    # --- how it goes

    def topics(self) -> list[str]:
        """The inputs that are asked for."""
        eyes = ["tracks"] if self.options.tracks_type else ["left/image", "right/image"]
        motion = {"imu": ["imu"], "gyro_accel": ["gyro", "accel"], "wheels": ["wheels"]}
        beside = ["wheels"] if self.options.wheels_beside_imu else []
        return [*eyes, *motion[self.options.motion], *beside]

    def _messages(self) -> int:
        return sum(self.counts[topic] for topic in self.topics())

    def diagnose(self) -> list[Status]:
        """Returns what there is to say since the last call, a second ago as a rule."""
        fresh, self._before = self.counts - self._before, self.counts.copy()
        faults, self.faults = self.faults, {}
        return [
            status.of_setup(self.blocked, self.waits_for),
            *status.of_inputs(self.topics(), fresh, self.counts, faults),
            *diagnosis.of_pairs(self.pipeline.pairing),
            *diagnosis.of_halves(self.pipeline.together),
            *diagnosis.of_speed(fresh["too slow"]),
            *diagnosis.of_odometry(self.odometry, self.pipeline.last, self._messages()),
        ]


def _row(vector: Any) -> Floats:
    return np.array([[vector.x, vector.y, vector.z]], np.float64)


def _each_wheel(read: Wheels, track_m: float, sigma: Floats) -> list[tuple[Floats, Floats, Floats]]:
    """Returns place, velocity and sigma (3,) of each wheel in their frame.

    A velocity and a yaw rate were made of two wheels, so they tell those again; the velocity is the
    mean of two, each of which has a variance twice as large. Without a track it is one place.
    """
    if not track_m:
        return [(np.zeros(3), read.v_mps, sigma)]
    sides = (np.array([0.0, y, 0.0]) for y in (track_m / 2, -track_m / 2))
    return [(at, read.v_mps + np.cross(read.w_radps, at), np.sqrt(2) * sigma) for at in sides]
