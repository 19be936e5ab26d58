# SPDX-License-Identifier: MIT
"""Bags of ROS 1 and ROS 2: pictures or tracks, and twists, an IMU or the speeds of wheels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pelorus.console import progress
from pelorus.converters import ros_frames, streams
from pelorus.converters.bag import Bag, require_messages
from pelorus.converters.ros_frames import CAMERA_INFO, Cameras
from pelorus.converters.streams import Asked, Readings, Streams, Twists
from pelorus.errors import PelorusError
from pelorus.foreign import ForeignFileError
from pelorus.frames import TwistTiming
from pelorus.inertial import Inertial
from pelorus.layout import Floats
from pelorus.motion import Times
from pelorus.rig import read as rig_files
from pelorus.rig.read import Calibrated
from pelorus.se3 import Poses
from pelorus.trajectory import Trajectory

# What gives twists, and how.
TWISTS: dict[str, Callable[[Any], Any]] = {
    "nav_msgs/msg/Odometry": lambda m: m.twist.twist,
    "geometry_msgs/msg/TwistStamped": lambda m: m.twist,
    "geometry_msgs/msg/TwistWithCovarianceStamped": lambda m: m.twist.twist,
}
IMU = "sensor_msgs/msg/Imu"
JOINTS = "sensor_msgs/msg/JointState"
POSES: dict[str, Callable[[Any], tuple[Any, Any]]] = {
    "nav_msgs/msg/Odometry": lambda m: (m.pose.pose.position, m.pose.pose.orientation),
    "geometry_msgs/msg/PoseStamped": lambda m: (m.pose.position, m.pose.orientation),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: (
        m.pose.pose.position,
        m.pose.pose.orientation,
    ),
    "geometry_msgs/msg/TransformStamped": lambda m: (m.transform.translation, m.transform.rotation),
}


@dataclass(frozen=True)
class Wheels:
    """Joints that turn at rad/s; with a track width the last one less the first one is a turn."""

    topic: str
    joints: tuple[str, ...]
    radius_m: float
    track_m: float = 0.0


@dataclass(frozen=True)
class Topics:
    """Those that the user names; the others are taken where there is but one."""

    cameras: Cameras
    twist: str = ""
    gyro: str = ""
    imu: str = ""
    truth: str = ""
    wheels: Wheels | None = None


def read(bag: Bag, topics: Topics, asked: Asked) -> Streams:
    """What of the bag becomes a recording; its pictures are read later, so it must stay open."""
    remarks: list[str] = []
    motion = asked.motion or _motion(bag, topics, asked, remarks)
    calibrated, cameras = _calibrated(bag, topics.cameras, asked)
    frames = ros_frames.read(bag, cameras, calibrated, remarks)
    truth = asked.truth or (_truth(bag, topics.truth) if topics.truth else None)
    return Streams(calibrated, frames, motion, truth, remarks=remarks)


def _calibrated(bag: Bag, cameras: Cameras, asked: Asked) -> tuple[Calibrated, Cameras]:
    """Of the files, else of the bag's camera_info."""
    name = bag.path.resolve().stem
    if asked.calibration:
        found = rig_files.read(asked.calibration, name, asked.extrinsic, asked.lens)
        named = found.rig.topics if found.rig is not None else ()
        return found, ros_frames.chosen(bag, cameras, named)
    cameras = ros_frames.chosen(bag, cameras, ())
    rig = ros_frames.camera_info_rig(bag, cameras)
    if rig is None:
        raise PelorusError(
            f"{bag.path}: which topics of {CAMERA_INFO} are the cameras'? --left-info-topic and "
            f"--right-info-topic are due, or --calibration FILE (Kalibr's camchain, OpenCV's "
            f"stereo YAML, or JSON); {bag.listing()}"
        )
    return rig_files.of_rig(rig, name, asked.extrinsic), cameras


# --- motion ---------------------------------------------------------------------------------------


def _motion(bag: Bag, topics: Topics, asked: Asked, remarks: list[str]) -> Twists | Readings:
    found = _without_gyro(bag, topics, asked, remarks)
    if not topics.gyro:
        return found
    if isinstance(found, Readings):
        raise PelorusError("--gyro-topic: it goes with twists or wheels, an IMU has its own")
    own = _imu(bag, bag.require(topics.gyro, IMU))
    timing = TwistTiming.START if asked.timing is None else asked.timing
    return streams.with_gyro(found, own.where, own.inertial.t_ns, own.inertial.w_B_radps, timing)


def _without_gyro(bag: Bag, topics: Topics, asked: Asked, remarks: list[str]) -> Twists | Readings:
    named = [topic for topic in (topics.twist, topics.imu) if topic]
    if len(named) + (topics.wheels is not None) > 1:
        raise PelorusError(
            "--twist-topic, --imu-topic and --joint-topic: one of them is due, it moves the body"
        )
    if topics.wheels is not None:
        return _wheels(bag, topics.wheels)
    twists, imus = bag.of_type(*TWISTS), bag.of_type(IMU)
    twists = [topic for topic in twists if topic != topics.truth]
    if topics.imu or (not topics.twist and not twists and len(imus) == 1):
        return _imu(bag, bag.require(topics.imu or imus[0], IMU))
    if not topics.twist and len(twists) != 1:
        raise PelorusError(
            f"{bag.path}: what moves the body? {len(twists)} topics hold twists, {len(imus)} hold "
            f"{IMU}; --twist-topic, --imu-topic or --joint-topic is due; {bag.listing()}"
        )
    unused = [topic for topic in imus if topic != topics.gyro]
    if unused:
        remarks.append(f"{', '.join(unused)}: not used; --imu-topic or --gyro-topic would use it")
    return _twists(bag, bag.require(topics.twist or twists[0], *TWISTS), asked.measured, remarks)


def _twists(bag: Bag, topic: str, measured: frozenset[str], remarks: list[str]) -> Twists:
    of_message = TWISTS[bag.types[topic]]
    frame = ""

    def row(message: Any) -> list[float]:
        nonlocal frame
        frame = getattr(message, "child_frame_id", "") or message.header.frame_id
        twist = of_message(message)
        return [*_xyz(twist.linear), *_xyz(twist.angular)]

    t_ns, numbers = _rows(bag, topic, row, remarks)
    remarks.append(
        f"{topic}: twists of the frame {frame!r}: the calibration's extrinsic must be of the same"
    )
    kept = [f"{kind}{axis}" in measured for kind in "vw" for axis in "xyz"]
    numbers = numbers * np.array(kept)
    return Twists(bag.path / topic.lstrip("/"), t_ns, numbers[:, :3], numbers[:, 3:], measured)


def _imu(bag: Bag, topic: str) -> Readings:
    def row(message: Any) -> list[float]:
        return [*_xyz(message.linear_acceleration), *_xyz(message.angular_velocity)]

    t_ns, numbers = _rows(bag, topic, row, [])
    return Readings(bag.path / topic.lstrip("/"), Inertial(t_ns, numbers[:, :3], numbers[:, 3:]))


def _wheels(bag: Bag, wheels: Wheels) -> Twists:
    """Forward the mean of the wheels' speeds; nothing else, unless the track width gives a turn."""
    topic = bag.require(wheels.topic, JOINTS)

    def row(message: Any) -> list[float]:
        lacking = [name for name in wheels.joints if name not in message.name]
        if lacking or len(message.velocity) != len(message.name):
            raise ForeignFileError(
                bag.path,
                f"{topic} has the joints {', '.join(message.name)} with "
                f"{len(message.velocity)} velocities",
                due=f"{', '.join(wheels.joints)} with a velocity each are due",
            )
        return [float(message.velocity[message.name.index(name)]) for name in wheels.joints]

    t_ns, turning = _rows(bag, topic, row, [])
    speed = turning * wheels.radius_m
    v, w = np.zeros((2, len(t_ns), 3))
    v[:, 0] = speed.mean(axis=1)
    measured = {"vx"}
    if wheels.track_m:
        w[:, 2] = (speed[:, -1] - speed[:, 0]) / wheels.track_m
        measured.add("wz")
    return Twists(bag.path / topic.lstrip("/"), t_ns, v, w, frozenset(measured))


def _xyz(vector: Any) -> list[float]:
    return [float(vector.x), float(vector.y), float(vector.z)]


def _rows(
    bag: Bag, topic: str, row: Callable[[Any], list[float]], remarks: list[str]
) -> tuple[Times, Floats]:
    """Times and numbers of a topic in the order of time; of two at one time the first."""
    found = progress(bag.messages([topic]), f"reading {topic}", bag.count([topic]))
    stamped = [(t_ns, row(message)) for _, t_ns, message in found]
    require_messages(bag, topic, len(stamped))
    t_ns = np.array([t for t, _ in stamped], np.int64)
    numbers = np.array([values for _, values in stamped])
    require_stamps(bag, topic, t_ns)
    if not np.isfinite(numbers).all():
        k = int(np.nonzero(~np.isfinite(numbers).all(axis=1))[0][0])
        raise ForeignFileError(bag.path, "a number is not finite", at=f"{topic}, message {k}")
    times, first = np.unique(t_ns, return_index=True)
    if len(times) < len(t_ns):
        remarks.append(f"{topic}: {len(t_ns) - len(times)} messages repeat a time and are left out")
    return times, numbers[first]


def require_stamps(bag: Bag, topic: str, t_ns: Times) -> None:
    """Refuse headers that nobody filled in."""
    if (t_ns <= 0).any():
        raise ForeignFileError(
            bag.path,
            f"{int((t_ns <= 0).sum())} of {len(t_ns)} headers have no time",
            at=topic,
            due="times in header.stamp are due, or --stamps log: those of the messages' arrival",
        )


# --- truth ----------------------------------------------------------------------------------------


def _truth(bag: Bag, topic: str) -> Trajectory:
    bag.require(topic, *POSES)
    of_message = POSES[bag.types[topic]]

    def row(message: Any) -> list[float]:
        p, q = of_message(message)
        return [*_xyz(p), *_xyz(q), float(q.w)]

    t_ns, numbers = _rows(bag, topic, row, [])
    norms = np.linalg.norm(numbers[:, 3:], axis=1)
    if np.abs(norms - 1).max() > 1e-2:
        raise ForeignFileError(bag.path, "holds a quaternion whose norm is not 1", at=topic)
    return Trajectory(t_ns, Poses(Rotation.from_quat(numbers[:, 3:]).as_matrix(), numbers[:, :3]))
