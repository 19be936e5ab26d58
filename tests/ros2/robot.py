# SPDX-License-Identifier: MIT
"""A robot for the tests: the node in a process of its own, and topics that this process plays."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped, Vector3
from nav_msgs.msg import Odometry
from pelorus_msgs.msg import StereoTracks
from pelorus_ros.conventions import quaternion
from pelorus_ros.node import qos
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import CameraInfo, Image, Imu
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

PATIENCE_S = 60.0  # only a failure waits so long


@dataclass(order=True)
class Played:
    """A message on a topic, and when it comes: as a rule its stamp."""

    arrives_ns: int
    number: int
    topic: str = field(compare=False)
    message: Any = field(compare=False)


def stamped(t_ns: int, frame: str) -> Header:
    """Returns a header."""
    return Header(stamp=Time(sec=t_ns // 10**9, nanosec=t_ns % 10**9), frame_id=frame)


def imu_message(t_ns: int, a: Sequence[float], w: Sequence[float], frame: str = "imu") -> Imu:
    """Returns a reading."""
    return Imu(
        header=stamped(t_ns, frame),
        linear_acceleration=Vector3(**dict(zip("xyz", map(float, a), strict=True))),
        angular_velocity=Vector3(**dict(zip("xyz", map(float, w), strict=True))),
    )


def image_message(t_ns: int, pixels: np.ndarray[Any, Any], frame: str) -> Image:
    """Returns a grey picture."""
    message = Image(header=stamped(t_ns, frame), encoding="mono8")
    message.height, message.width = pixels.shape
    message.step = message.width
    message.data = pixels.tobytes()
    return message


def tracks_message(t_ns: int, ids: Any, pixels: Any, frame: str = "left_optical") -> StereoTracks:
    """Returns the tracks of a frame."""
    sides = dict(
        zip(
            ("left_u", "left_v", "right_u", "right_v"),
            np.asarray(pixels, np.float32).T,
            strict=True,
        )
    )
    return StereoTracks(
        header=stamped(t_ns, frame),
        id=np.asarray(ids, np.uint32),
        **{k: v.copy() for k, v in sides.items()},
    )


def info_message(camera: Any, size: tuple[int, int], is_right: bool, frame: str) -> CameraInfo:
    """Returns the camera_info of a rectified camera."""
    message = CameraInfo(header=stamped(0, frame), width=size[0], height=size[1])
    message.distortion_model = "plumb_bob"
    message.d = [0.0] * 5
    shift = -camera.fx_px * camera.baseline_m if is_right else 0.0
    message.k = [camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0]
    message.r = np.eye(3).ravel().tolist()
    message.p = [
        *(camera.fx_px, 0.0, camera.cx_px, shift),
        *(0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 0.0, 1.0, 0.0),
    ]
    return message


def transform_message(parent: str, child: str, R: Any, p: Any) -> TransformStamped:
    """Returns a transform of /tf_static."""
    message = TransformStamped(header=stamped(0, parent), child_frame_id=child)
    t, q = message.transform.translation, message.transform.rotation
    t.x, t.y, t.z = map(float, p)
    q.x, q.y, q.z, q.w = quaternion(np.asarray(R))
    return message


class Robot:
    """The node as a process, and all that it says. `namespace` keeps two apart."""

    def __init__(
        self,
        folder: Path,
        parameters: dict[str, Any],
        namespace: str = "/",
        remap: dict[str, str] | None = None,
    ) -> None:
        self.namespace = namespace.rstrip("/")
        given = [f"-p{name}:={_yaml(value)}" for name, value in parameters.items()]
        options = [word for one in given for word in ("-p", one[2:])]
        for source, target in (remap or {}).items():
            options += ["-r", f"{source}:={target}"]
        self._errors = (folder / f"node{self.namespace.replace('/', '-')}.txt").open("wb+")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "pelorus_ros.node", "--ros-args", "-r", f"__ns:={namespace}",
             *options],
            stdout=self._errors, stderr=subprocess.STDOUT, env=os.environ.copy(),
        )  # fmt: skip
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("player", context=self.context, namespace=namespace)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.odom: list[Odometry] = []
        self.arrived_s: list[float] = []
        self.tf: list[TransformStamped] = []
        self.said: list[Any] = []
        self.node.create_subscription(Odometry, "odom", self._take, qos(1000, reliable=True))
        self.node.create_subscription(
            TFMessage, "/tf", lambda m: self.tf.extend(m.transforms), qos(1000, reliable=True)
        )
        self.node.create_subscription(
            DiagnosticArray,
            "/diagnostics",
            lambda m: self.said.extend(m.status),
            qos(100, reliable=True),
        )
        self._publishers: dict[str, Any] = {}

    def _take(self, message: Odometry) -> None:
        self.odom.append(message)
        self.arrived_s.append(time.monotonic())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)
        self._errors.close()

    def stop(self) -> str:
        """Ends the node as Ctrl-C does; returns what it printed."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                raise
        self._errors.seek(0)
        return self._errors.read().decode(errors="replace")

    def publisher(self, topic: str, kind: Any, latched: bool = False) -> Any:
        if topic not in self._publishers:
            depth = 1 if latched else 5000
            self._publishers[topic] = self.node.create_publisher(
                kind, topic, qos(depth, True, latched)
            )
        return self._publishers[topic]

    def until(self, done: Callable[[], bool], what: str) -> None:
        """Spins until something has happened."""
        limit = time.monotonic() + PATIENCE_S
        while not done():
            if time.monotonic() > limit:
                self._errors.seek(0)
                said = "\n".join(sorted({f"{s.name}: {s.message}" for s in self.said}))
                raise AssertionError(
                    f"no {what}\n{said}\n{self._errors.read().decode(errors='replace')[-3000:]}"
                )
            if self.process.poll() is not None:
                self._errors.seek(0)
                raise AssertionError(
                    "the node has ended:\n" + self._errors.read().decode(errors="replace")
                )
            self.executor.spin_once(timeout_sec=0.05)

    def heard(self, topics: Iterable[str]) -> None:
        """Waits until the node listens to these topics."""
        for topic in topics:
            self.until(
                lambda topic=topic: self._publishers[topic].get_subscription_count() > 0,
                f"subscription of {topic}",
            )

    def listened(self) -> None:
        """Waits until the node's odometry is heard here."""
        self.until(
            lambda: self.node.count_publishers(f"{self.namespace}/odom") > 0, "publisher of odom"
        )
        self.until(lambda: len(self.said) > 0, "diagnostics")

    def play(self, messages: Iterable[Played], rate: float = 1.0) -> None:
        """Publishes them at `rate` times the pace of their arrivals; 0: as fast as it goes."""
        first_ns, begun = None, time.monotonic()
        for k, one in enumerate(sorted(messages)):
            first_ns = one.arrives_ns if first_ns is None else first_ns
            if rate:
                until = begun + (one.arrives_ns - first_ns) * 1e-9 / rate
                while (left := until - time.monotonic()) > 0:
                    self.executor.spin_once(timeout_sec=min(left, 0.01))
            elif k % 20 == 0:
                self.executor.spin_once(timeout_sec=0)
            self.publisher(one.topic, type(one.message)).publish(one.message)

    def call(self, service: str) -> Any:
        client = self.node.create_client(Trigger, f"{self.namespace}/pelorus/{service}")
        self.until(client.service_is_ready, f"service {service}")
        future = client.call_async(Trigger.Request())
        self.until(future.done, f"answer of {service}")
        return future.result()

    def messages_of(self, name: str) -> list[str]:
        """What the diagnostics said under a name, newest last."""
        return [s.message for s in self.said if s.name.endswith(f": {name}")]


def _yaml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(_yaml(one) for one in value) + "]"
    return f"'{value}'" if isinstance(value, str) else repr(value)
