# SPDX-License-Identifier: MIT
"""The node: subscriptions in, publications out; what lies between is `estimator`.

Messages are taken by the executor and used by one thread, in the order of their arrival, so that a
picture that takes long to follow keeps no reading of the IMU waiting in a full queue.
"""

from __future__ import annotations

import importlib
import queue
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry as OdometryMessage
from nav_msgs.msg import Path as PathMessage
from pelorus.errors import PelorusError
from pelorus.online.diagnosis import Level, Status
from pelorus.online.odometry import Odom
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidParameterTypeException, ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, Imu, PointCloud2, PointField
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from pelorus_ros import conventions
from pelorus_ros.estimator import Estimator
from pelorus_ros.parameters import Options, misspelt, table
from pelorus_ros.rigging import SIDES

PICTURES_KEPT, READINGS_KEPT = 30, 1000  # of a topic, by the middleware
LATENCIES_KEPT = 600
LANDMARKS_EVERY_NS = 200_000_000
SWITCH_S = 0.0005  # the executor takes what has come while a picture is followed
ENDED = object()


class Arrival(NamedTuple):
    """A message on its way to the estimator."""

    use: Callable[..., list[Odom]]
    message: Any
    is_picture: bool
    at_s: float


def qos(depth: int, reliable: bool = False, latched: bool = False) -> QoSProfile:
    """Returns a profile; best effort hears every publisher, reliable ones alone do not."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


class PelorusNode(Node):
    """Stereo visual-inertial odometry."""

    def __init__(self, **more: Any) -> None:
        super().__init__("pelorus", **more)
        self._complaints: list[Status] = []  # about parameters: they stay
        self.options = self._options()
        self._lock = threading.Lock()
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._pictures_waiting = 0
        self._pictures_most = 0 if self.options is None else 2 * self.options.pairs_waiting
        self._latencies_s: deque[float] = deque(maxlen=LATENCIES_KEPT)
        self._inputs: dict[str, str] = {}  # topic as resolved: type
        self._asked: dict[str, str] = {}  # topic as resolved: as asked for
        self._landmarks_ns = -1
        self._path = PathMessage()
        self._said: dict[str, str] = {}
        self.estimator: Estimator | None = None
        self._outputs()
        if self.options is not None:
            self._start(self.options)
        self._worker = threading.Thread(target=self._work, name="pelorus", daemon=True)
        self._worker.start()
        self.create_timer(1.0, self._diagnose, clock=Clock(clock_type=ClockType.STEADY_TIME))

    # --- parameters

    def _options(self) -> Options | None:
        values = {}
        for name, (default, about) in table().items():
            descriptor = ParameterDescriptor(description=about, read_only=True)
            try:
                values[name] = self.declare_parameter(name, default, descriptor).value
            except (InvalidParameterTypeException, ParameterException) as error:
                self._complain(f"parameter {name}: {error}; a value like {default!r} is expected")
        given = list(self._parameter_overrides)
        for words in misspelt(given, [name for name in given if self.has_parameter(name)]):
            self._complain(words, Level.WARN)
        if any(one.level is Level.ERROR for one in self._complaints):
            return None
        lists = {
            name: list(value)
            for name, value in values.items()
            if isinstance(value, Sequence) and not isinstance(value, str)
        }
        try:
            return Options.of(values | lists)
        except PelorusError as error:
            self._complain(str(error))
            return None

    def _complain(self, words: str, level: Level = Level.ERROR) -> None:
        self._complaints.append(
            Status("parameters", level, words, "correct it and start the node again")
        )
        self._log(level, words)

    def _log(self, level: Level, words: str) -> None:
        logger = self.get_logger()
        if level is Level.ERROR:
            logger.error(words)
        else:
            logger.warning(words)

    # --- what comes

    def _start(self, options: Options) -> None:
        try:
            self.estimator = e = Estimator(options)
        except PelorusError as error:
            self._complain(str(error))
            return
        self._listen_tf(e)
        if options.tracks_type:
            self._listen_typed("tracks", options.tracks_type, e.tracks)
        for side in SIDES:
            self._listen(f"{side}/camera_info", CameraInfo, partial(e.camera_info, side), 1)
            if not options.tracks_type:
                self._listen_pictures(side, options, e)
        for topic, use in (("imu", e.imu), ("gyro", e.gyro), ("accel", e.accel)):
            if topic in e.topics():
                self._listen(topic, Imu, use, READINGS_KEPT)
        if "wheels" in e.topics():
            self._listen_typed("wheels", options.wheels_type, e.wheels)
        self._listen("initialpose", PoseWithCovarianceStamped, e.initial_pose, 1)
        for name, serve in (
            ("reset", self._reset), ("save_state", e.save_state), ("load_state", e.load_state)
        ):  # fmt: skip
            self.create_service(Trigger, f"~/{name}", partial(self._serve, serve))

    def _listen_tf(self, e: Estimator) -> None:
        TFMessage = self._type("tf2_msgs/msg/TFMessage")
        if TFMessage is not None:
            static = qos(100, reliable=True, latched=True)
            self.create_subscription(
                TFMessage, "/tf_static", partial(self._arrived, e.transforms, False), static
            )

    def _listen_pictures(self, side: str, options: Options, e: Estimator) -> None:
        packed = options.image_transport == "compressed"
        topic = f"{side}/image/compressed" if packed else f"{side}/image"
        profile = qos(PICTURES_KEPT, reliable=options.image_qos == "reliable")
        callback = partial(self._arrived, partial(e.picture, side), True)
        self._subscribe(topic, CompressedImage if packed else Image, callback, profile)

    def _listen(self, topic: str, kind: Any, use: Callable[..., list[Odom]], depth: int) -> None:
        """Takes all that waits at once: the executor alone would take one message a round, and
        on a busy machine an IMU falls seconds behind the camera.
        """
        made: list[Any] = []

        def take_all(message: Any) -> None:
            self._arrived(use, False, message)
            while made:
                with made[0].handle:
                    taken = made[0].handle.take_message(kind, False)
                if taken is None:
                    return
                self._arrived(use, False, taken[0])

        made.append(self._subscribe(topic, kind, take_all, qos(depth)))

    def _subscribe(self, topic: str, kind: Any, callback: Any, profile: QoSProfile) -> Any:
        made = self.create_subscription(kind, topic, callback, profile)
        package, _, _ = kind.__module__.partition(".msg")
        self._inputs[made.topic_name] = f"{package}/msg/{kind.__name__}"
        self._asked[made.topic_name] = topic
        return made

    def _listen_typed(self, topic: str, name: str, use: Callable[..., list[Odom]]) -> None:
        kind = self._type(name)
        if kind is not None:
            self._listen(topic, kind, use, READINGS_KEPT)

    def _type(self, name: str) -> Any:
        """The class of a message; None where its package is not installed, which is told."""
        package, _, kind = name.split("/")
        try:
            return getattr(importlib.import_module(f"{package}.msg"), kind)
        except (ImportError, AttributeError):
            self._complain(
                f"the message {name} is not installed: build or source the package {package}"
            )
            return None

    def _arrived(self, use: Callable[..., list[Odom]], is_picture: bool, message: Any) -> None:
        self._pictures_waiting += is_picture
        self._queue.put(Arrival(use, message, is_picture, time.monotonic()))

    # --- the work

    def _work(self) -> None:
        while (arrival := self._queue.get()) is not ENDED:
            try:
                with self._lock:
                    told = self._used(arrival)
                for odom in told:
                    self._publish(odom)
            except Exception as error:
                if not rclpy.ok(context=self.context):
                    return
                self.get_logger().error(f"{type(error).__name__}: {error}", throttle_duration_sec=5)
                continue
            if told and arrival.is_picture:
                self._latencies_s.append(time.monotonic() - arrival.at_s)

    def _used(self, arrival: Arrival) -> list[Odom]:
        if not arrival.is_picture:
            return arrival.use(arrival.message)
        self._pictures_waiting -= 1
        return arrival.use(arrival.message, too_slow=self._pictures_waiting > self._pictures_most)

    def end(self) -> None:
        """Lets the thread come to its end, and closes the log."""
        self._queue.put(ENDED)
        self._worker.join(timeout=5)
        if self.estimator is not None:
            self.estimator.finish()

    # --- services

    def _reset(self) -> str:
        assert self.estimator is not None
        self.estimator.reset()
        self._path.poses = []
        return "a new drive begins"

    def _serve(self, serve: Callable[[], str], _request: Any, response: Any) -> Any:
        try:
            with self._lock:
                response.message, response.success = serve(), True
        except (PelorusError, OSError) as error:
            response.message, response.success = str(error), False
        return response

    # --- what goes

    def _outputs(self) -> None:
        self._odometry_out = self.create_publisher(OdometryMessage, "odom", qos(10, reliable=True))
        self._path_out = self.create_publisher(PathMessage, "path", qos(1, reliable=True))
        self._landmarks_out = self.create_publisher(PointCloud2, "landmarks", qos(1, reliable=True))
        self._diagnostics_out = self.create_publisher(
            DiagnosticArray, "/diagnostics", qos(10, reliable=True)
        )
        self._tf_out = None
        if self.options is not None and self.options.publish_odom_to_base_tf:
            TFMessage = self._type("tf2_msgs/msg/TFMessage")
            if TFMessage is not None:
                self._tf_out = self.create_publisher(TFMessage, "/tf", qos(100, reliable=True))

    def _publish(self, odom: Odom) -> None:
        assert self.options is not None
        assert self.estimator is not None
        header = Header(
            stamp=Time(nanoseconds=odom.t_ns).to_msg(), frame_id=self.options.odom_frame
        )
        child = self.estimator.child_frame
        message = OdometryMessage(header=header, child_frame_id=child)
        _fill(message.pose.pose.position, message.pose.pose.orientation, odom)
        message.pose.covariance = conventions.to_ros(odom.T_OB.R, odom.covariance).ravel()
        twist = message.twist.twist
        twist.linear.x, twist.linear.y, twist.linear.z = odom.velocity[:3].tolist()
        twist.angular.x, twist.angular.y, twist.angular.z = odom.velocity[3:].tolist()
        message.twist.covariance = odom.velocity_covariance.ravel()
        self._odometry_out.publish(message)
        if self._tf_out is not None:
            moved = TransformStamped(header=header, child_frame_id=child)
            _fill(moved.transform.translation, moved.transform.rotation, odom)
            self._tf_out.publish(self._tf_out.msg_type(transforms=[moved]))
        self._publish_path(header, message)
        self._publish_landmarks(header, odom.t_ns)

    def _publish_path(self, header: Header, message: OdometryMessage) -> None:
        assert self.options is not None
        self._path.header = header
        poses = self._path.poses
        poses.append(PoseStamped(header=header, pose=message.pose.pose))
        if len(poses) > self.options.path_length:
            del poses[: len(poses) - self.options.path_length]
        if self._path_out.get_subscription_count():
            self._path_out.publish(self._path)

    def _publish_landmarks(self, header: Header, t_ns: int) -> None:
        waits = 0 <= t_ns - self._landmarks_ns < LANDMARKS_EVERY_NS
        if self.estimator is None or waits or not self._landmarks_out.get_subscription_count():
            return
        self._landmarks_ns = t_ns
        with self._lock:
            rows = self.estimator.landmarks()
        known = {"f": PointField.FLOAT32, "u": PointField.UINT32}
        fields = [
            PointField(name=name, offset=offset, datatype=known[kind.kind], count=1)
            for name, (kind, offset) in (rows.dtype.fields or {}).items()
        ]
        cloud = PointCloud2(header=header, height=1, width=len(rows), fields=fields)
        cloud.point_step, cloud.row_step = rows.dtype.itemsize, rows.nbytes
        cloud.data, cloud.is_dense = rows.tobytes(), True
        self._landmarks_out.publish(cloud)

    # --- diagnostics

    def _diagnose(self) -> None:
        found = [*self._complaints]
        if self.estimator is not None:
            with self._lock:
                found += self.estimator.diagnose()
            found += self._of_graph()
            found.append(self._of_latency())
        else:
            found.append(
                Status("estimate", Level.ERROR, "the node waits: its parameters are wrong")
            )
        array = DiagnosticArray()
        array.header.stamp = self.get_clock().now().to_msg()
        array.status = [self._as_message(one) for one in found]
        self._diagnostics_out.publish(array)
        self._say(found)

    def _as_message(self, one: Status) -> DiagnosticStatus:
        values = ({"do": one.do} if one.do else {}) | one.values
        return DiagnosticStatus(
            level=bytes([one.level]),
            name=f"{self.get_fully_qualified_name().lstrip('/')}: {one.name}",
            message=one.message,
            hardware_id="pelorus",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )

    def _say(self, found: Sequence[Status]) -> None:
        """To the log what has changed, once."""
        bad = {one.name: one.message for one in found if one.level in (Level.WARN, Level.ERROR)}
        for one in found:
            if (
                one.name in bad
                and self._said.get(one.name, "").split(" (")[0] != one.message.split(" (")[0]
            ):
                words = f"{one.name}: {one.message}" + (f"; {one.do}" if one.do else "")
                self._log(one.level, words)
        self._said = bad

    def _of_graph(self) -> list[Status]:
        """Topics that nobody publishes, or with another type."""
        assert self.estimator is not None
        found = []
        for topic, kind in self._inputs.items():
            about = self.get_publishers_info_by_topic(topic)
            types = {one.topic_type for one in about}
            if types and kind not in types:
                words = f"{topic} is a {' and a '.join(sorted(types))}; {kind} is expected"
                found.append(
                    Status(
                        "types",
                        Level.ERROR,
                        words,
                        "remap the topic, or set image_transport, tracks_type or wheels_type",
                    )
                )
            wanted = self._asked[topic].removesuffix("/compressed") in self.estimator.topics()
            if not types and wanted:
                there = [
                    name
                    for name, kinds in self.get_topic_names_and_types()
                    if kind in kinds and name != topic
                ]
                others = (
                    f"; of that type there are {', '.join(sorted(there)[:8])}"
                    if there
                    else "; there is none of its type"
                )
                found.append(
                    Status(
                        "topics",
                        Level.ERROR,
                        f"nobody publishes {topic} ({kind}){others}",
                        f"start the driver, or remap: --ros-args -r {self._asked[topic]}:=NAME",
                    )
                )
        return found

    def _of_latency(self) -> Status:
        if not self._latencies_s:
            return Status("latency", Level.OK, "nothing measured yet")
        median, p99 = np.percentile(np.array(self._latencies_s) * 1e3, [50, 99])
        values = {"median ms": f"{median:.1f}", "p99 ms": f"{p99:.1f}"}
        return Status(
            "latency",
            Level.OK,
            f"from picture to odometry {median:.1f} ms, p99 {p99:.1f} ms",
            values=values,
        )


def _fill(place: Any, turn: Any, odom: Odom) -> None:
    place.x, place.y, place.z = odom.T_OB.p.tolist()
    turn.x, turn.y, turn.z, turn.w = conventions.quaternion(odom.T_OB.R)


def main(arguments: list[str] | None = None) -> int:
    """Runs the node until Ctrl-C or SIGTERM."""
    rclpy.init(args=sys.argv if arguments is None else arguments)
    sys.setswitchinterval(SWITCH_S)
    node = PelorusNode()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the log is closed in peace
        node.end()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
