# SPDX-License-Identifier: MIT
"""Reads what moves the body in a bag: twists of odometry or wheels, also with a gyro, or an IMU."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pelorus.converters import streams, twist_axes
from pelorus.converters.bag import Bag
from pelorus.converters.order import Stamps, in_order, sound, spread
from pelorus.converters.streams import Asked, Readings, Twists
from pelorus.converters.transforms import bare
from pelorus.errors import PelorusError
from pelorus.io.foreign import ForeignFileError
from pelorus.io.trajectory import Trajectory, off_unit
from pelorus.math.inertial import Inertial
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.program.console import progress
from pelorus.wire.frames import TwistTiming
from pelorus.wire.layout import Floats

# Message types with twists, and how to read these.
TWISTS: dict[str, Callable[[Any], Any]] = {
    "nav_msgs/msg/Odometry": lambda m: m.twist.twist,
    "geometry_msgs/msg/TwistStamped": lambda m: m.twist,
    "geometry_msgs/msg/TwistWithCovarianceStamped": lambda m: m.twist.twist,
}
IMU = "sensor_msgs/msg/Imu"
VECTOR = "geometry_msgs/msg/Vector3Stamped"  # of a driver with separate gyro and accelerometer
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
NO_POSE = [0.0] * 7
AXES = [f"{kind}{axis}" for kind in "vw" for axis in "xyz"]


@dataclass(frozen=True)
class Wheels:
    """Joints that turn at rad/s; with a track width the last minus the first gives the turn."""

    topic: str
    joints: tuple[str, ...]
    radius_m: float
    track_m: float = 0.0


@dataclass(frozen=True)
class MotionTopics:
    """The topics that the user names; others are taken where there is only one."""

    twist: str = ""
    gyro: str = ""
    imu: str = ""
    wheels: Wheels | None = None
    frame: str = ""  # of the body, instead of what the messages say
    truth: str = ""  # not used as motion, unless it is named twice
    by_imu: bool = False  # twists and wheels are beside an IMU


class Rows(NamedTuple):
    """Numbers of a topic in the order of time, and the frame in its messages."""

    t_ns: Times
    numbers: Floats
    frame: str


def read(bag: Bag, topics: MotionTopics, asked: Asked) -> Twists | Readings:
    """Reads the motion from the named topics, else from the only ones."""
    found = _alone(bag, topics, asked)
    if topics.frame:
        found = replace(found, frame=bare(topics.frame))
    if isinstance(found, Readings) or not topics.gyro:
        return found
    rows = _halves(bag, topics.gyro)
    if not rows.numbers[:, 3:].any():
        raise bag.error(topics.gyro, "all its rates of turn are 0")
    w_B = rows.numbers[:, 3:]
    if rows.frame and found.frame and rows.frame != found.frame:
        w_B = _turned(bag, w_B, topics.gyro, rows.frame, found.frame)
    where = bag.where(topics.gyro)
    return streams.with_gyro(found, where, rows.t_ns, w_B, _timing(asked))


def _turned(bag: Bag, w: Floats, topic: str, frame: str, body: str) -> Floats:
    """Returns a gyro's rates in the axes of the body, as far as the transforms know both."""
    if not bag.tree.knows(frame, body):
        bag.remarks.append(f"{topic}: of the frame {frame!r}, taken as having the axes of {body!r}")
        return w
    chain = bag.tree.chain(frame, body)
    bag.remarks.append(
        f"{topic}: its rates are turned into {body!r} as /tf_static says: {chain.words}"
    )
    return np.asarray(w @ chain.T.R.T)


def _timing(asked: Asked) -> TwistTiming:
    return TwistTiming.START if asked.timing is None else asked.timing


def _alone(bag: Bag, topics: MotionTopics, asked: Asked) -> Twists | Readings:
    """Reads the motion without the gyro beside twists."""
    named = [topic for topic in (topics.twist, topics.imu) if topic]
    if len(named) + (topics.wheels is not None) > 1:
        raise PelorusError(
            "--twist-topic, --imu-topic and --joint-topic: one of them is expected, it moves "
            "the body"
        )
    if topics.wheels is not None:
        return of_joints(bag, topics.wheels)
    if topics.imu:
        return _imu(bag, topics.imu, topics.gyro)
    twists = [topic for topic in bag.of_type(*TWISTS) if topic != topics.truth]
    twists = [] if topics.by_imu else twists
    imus = bag.of_type(IMU)
    if topics.twist or len(twists) == 1:
        unused = [topic for topic in imus if topic != topics.gyro]
        if unused:
            said = "not used; --imu-topic or --gyro-topic would use it"
            bag.remarks.append(f"{', '.join(unused)}: {said}")
        return _twists(bag, bag.require(topics.twist or twists[0], *TWISTS), asked)
    if not twists and len(imus) == 1:
        return _imu(bag, imus[0], topics.gyro)
    pair = _separate_imu_topics(bag, imus) if not twists and len(imus) == 2 else None
    if pair is not None:
        return pair
    raise PelorusError(
        f"{bag.path}: what moves the body? {len(twists)} topics hold twists, {len(imus)} hold "
        f"{IMU}; --twist-topic, --imu-topic or --joint-topic is expected; {bag.listing()}"
    )


# --- twists ---------------------------------------------------------------------------------------


def _twists(bag: Bag, topic: str, asked: Asked) -> Twists:
    of_twist, of_pose = TWISTS[bag.types[topic]], POSES.get(bag.types[topic])
    kept = np.array([name in asked.measured for name in AXES])

    def row(message: Any) -> list[float]:
        twist = of_twist(message)
        numbers = np.array([*xyz(twist.linear), *xyz(twist.angular)])
        pose = [] if of_pose is None else _pose(of_pose(message))
        pose = pose if np.isfinite(pose).all() else NO_POSE
        return [*np.where(kept, numbers, 0.0).tolist(), *pose]

    t_ns, numbers, frame = rows_of(bag, topic, row)
    where = bag.where(topic)
    found = Twists(where, t_ns, numbers[:, :3], numbers[:, 3:6], asked.measured, frame)
    bag.remarks.append(
        f"{topic}: twists of the frame {frame!r}: the calibration's extrinsic must be of the same"
    )
    poses = None
    if of_pose is not None and not off_unit(numbers[:, 9:]).any():
        poses = Poses.of_quaternions(numbers[:, 9:], numbers[:, 6:9])
    return twist_axes.in_body(found, poses, asked.axes, _timing(asked), bag.remarks)


def of_joints(bag: Bag, wheels: Wheels) -> Twists:
    """Returns twists with the mean of the wheels' speeds; a turn only with a track width."""
    topic = bag.require(wheels.topic, JOINTS)

    def row(message: Any) -> list[float]:
        lacking = [name for name in wheels.joints if name not in message.name]
        if lacking or len(message.velocity) != len(message.name):
            raise ForeignFileError(
                bag.path,
                f"{topic} has the joints {', '.join(message.name)} with {len(message.velocity)} "
                f"velocities; {', '.join(wheels.joints)} with a velocity each are expected",
            )
        return [float(message.velocity[message.name.index(name)]) for name in wheels.joints]

    t_ns, turning, frame = rows_of(bag, topic, row)
    speed = turning * wheels.radius_m
    v, w = np.zeros((2, len(t_ns), 3))
    v[:, 0] = speed.mean(axis=1)
    measured = {"vx"}
    if wheels.track_m:
        w[:, 2] = (speed[:, -1] - speed[:, 0]) / wheels.track_m
        measured.add("wz")
    where = bag.where(topic)
    return Twists(where, t_ns, v, w, frozenset(measured), frame)


# --- an IMU ---------------------------------------------------------------------------------------


def _imu(bag: Bag, topic: str, gyro: str) -> Readings:
    """Reads an IMU from one topic, or from two if the gyro is named or each holds one half."""
    if gyro == topic:
        raise PelorusError(f"--imu-topic and --gyro-topic: {topic} is named twice")
    if gyro:
        pair = _halves(bag, topic), _halves(bag, gyro)
        return _joined(bag, topic, gyro, *pair)
    rows = _halves(bag, bag.require(topic, IMU))
    others = [other for other in bag.of_type(IMU) if other != topic]
    a, w = rows.numbers[:, :3].any(), rows.numbers[:, 3:].any()
    if a and w:
        return _readings(bag, topic, rows)
    if len(others) == 1:
        second = _halves(bag, others[0])
        if a and second.numbers[:, 3:].any():
            return _joined(bag, topic, others[0], rows, second)
        if w and second.numbers[:, :3].any():
            return _joined(bag, others[0], topic, second, rows)
    what = "specific forces" if w else "rates of turn"
    raise bag.error(
        topic,
        f"all its {what} are 0; are they on another topic? --imu-topic of the accelerometer and "
        f"--gyro-topic of the gyro are expected; {bag.listing()}",
    )


def _separate_imu_topics(bag: Bag, topics: list[str]) -> Readings | None:
    """Joins the topics of an accelerometer and a gyro; None if the topics are not these."""
    pair = [_halves(bag, topic) for topic in topics]
    forces = [bool(rows.numbers[:, :3].any()) for rows in pair]
    rates = [bool(rows.numbers[:, 3:].any()) for rows in pair]
    if forces == rates or sum(forces) != 1 or sum(rates) != 1:
        return None
    a, g = forces.index(True), rates.index(True)
    return _joined(bag, topics[a], topics[g], pair[a], pair[g])


def _joined(bag: Bag, accel: str, gyro: str, a: Rows, w: Rows) -> Readings:
    """Joins both; the slower one is interpolated to the times of the faster one."""
    forces, rates = (a.t_ns, a.numbers[:, :3]), (w.t_ns, w.numbers[:, 3:])
    if not forces[1].any():
        raise bag.error(accel, "all its specific forces are 0")
    if not rates[1].any():
        raise bag.error(gyro, "all its rates of turn are 0")
    if a.frame and w.frame and a.frame != w.frame:
        bag.remarks.append(f"{accel}, {gyro}: of {a.frame!r} and {w.frame!r}: taken as one frame")
    where = bag.where(accel)
    inertial = streams.joined(where, bag.where(gyro), forces, rates, bag.remarks)
    return Readings(where, inertial, a.frame or w.frame)


def _halves(bag: Bag, topic: str) -> Rows:
    """Returns (n, 6) specific force and rate of turn; a lone vector is in both."""
    bag.require(topic, IMU, VECTOR)

    def row(message: Any) -> list[float]:
        if hasattr(message, "vector"):
            return [*xyz(message.vector), *xyz(message.vector)]
        return [*xyz(message.linear_acceleration), *xyz(message.angular_velocity)]

    return rows_of(bag, topic, row)


def _readings(bag: Bag, topic: str, rows: Rows) -> Readings:
    inertial = Inertial(rows.t_ns, rows.numbers[:, :3], rows.numbers[:, 3:])
    return Readings(bag.where(topic), inertial, rows.frame)


# --- truth ----------------------------------------------------------------------------------------


def truth(bag: Bag, topic: str) -> Trajectory:
    """Reads poses of the body in the world."""
    bag.require(topic, *POSES)
    of_message = POSES[bag.types[topic]]
    t_ns, numbers, _ = rows_of(bag, topic, lambda message: _pose(of_message(message)))
    if off_unit(numbers[:, 3:]).any():
        raise bag.error(topic, "holds a quaternion whose norm is not 1")
    return Trajectory(t_ns, Poses.of_quaternions(numbers[:, 3:], numbers[:, :3]))


def _pose(pose: tuple[Any, Any]) -> list[float]:
    """Returns p and q, x y z w."""
    p, q = pose
    return [*xyz(p), *xyz(q), float(q.w)]


# --- rows -----------------------------------------------------------------------------------------


def xyz(vector: Any) -> list[float]:
    """Returns the three numbers of a message's vector."""
    return [float(vector.x), float(vector.y), float(vector.z)]


def rows_of(bag: Bag, topic: str, row: Callable[[Any], list[float]]) -> Rows:
    """Returns a row for each message of a topic, without those that hold nothing usable."""
    found = progress(bag.written([topic]), f"reading {topic}", bag.count([topic]))
    stamped, frame = [], ""
    for one in found:
        frame = bare(getattr(one.message, "child_frame_id", "") or one.message.header.frame_id)
        stamped.append((one.t_ns, one.arrival_ns, row(one.message)))
    if not stamped:
        raise bag.error(topic, "no message can be read")
    t_ns, arrival_ns = np.array([times for *times, _ in stamped], np.int64).T
    numbers = np.array([values for *_, values in stamped])
    good = sound(bag, topic, t_ns, numbers)
    whole = spread(bag, topic, Stamps(t_ns, arrival_ns, numbers).at(good))
    order = in_order(bag, topic, whole)
    kept = whole.at(order)
    return Rows(kept.t_ns, np.asarray(kept.numbers), frame)
