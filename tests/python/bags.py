# SPDX-License-Identifier: MIT
"""Bags as a robot would record them, written by the library rosbags: ROS 1, ROS 2 and MCAP."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pelorus.math.se3 import Poses
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

NS = 10**9
FEATURES = "msckf_vio/msg/CameraMeasurement"
ONE_FEATURE = "msckf_vio/msg/FeatureMeasurement"
TF = "tf2_msgs/msg/TFMessage"
DEFINITIONS = {
    TF: "geometry_msgs/TransformStamped[] transforms\n",
    ONE_FEATURE: "uint64 id\nfloat64 u0\nfloat64 v0\nfloat64 u1\nfloat64 v1\n",
    FEATURES: "std_msgs/Header header\nFeatureMeasurement[] features\n",
}


@dataclass
class Recorder:
    """Messages of one ROS, until they are written."""

    ros: int = 2
    found: list[tuple[str, str, int, Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        store = get_typestore(Stores.ROS1_NOETIC if self.ros == 1 else Stores.ROS2_HUMBLE)
        for name, text in DEFINITIONS.items():
            if name not in store.types:
                store.register(get_types_from_msg(text, name))
        self.store = store

    def new(self, kind: str, *values: Any, **named: Any) -> Any:
        """A message of the type, with its fields in order or by name."""
        return self.store.types[kind](*values, **named)

    def header(self, t_ns: int, frame: str = "") -> Any:
        stamp = self.new("builtin_interfaces/msg/Time", t_ns // NS, t_ns % NS)
        number = (0,) if self.ros == 1 else ()
        return self.new("std_msgs/msg/Header", *number, stamp, frame)

    def add(self, topic: str, kind: str, t_ns: int, message: Any, late_ns: int = 7_000_000) -> None:
        """It arrives `late_ns` after the time of its header."""
        self.found.append((topic, kind, t_ns + late_ns, message))

    # --- what there is ----------------------------------------------------------------------------

    def xyz(self, kind: str, numbers: Iterable[float]) -> Any:
        return self.new(f"geometry_msgs/msg/{kind}", *map(float, numbers))

    def twist(self, v: Iterable[float], w: Iterable[float]) -> Any:
        return self.new("geometry_msgs/msg/Twist", self.xyz("Vector3", v), self.xyz("Vector3", w))

    def odometry(
        self,
        topic: str,
        t_ns: int,
        v: Iterable[float],
        w: Iterable[float],
        pose: Poses,
        child: str = "base_link",
    ) -> None:
        place = self.new(
            "geometry_msgs/msg/Pose",
            self.xyz("Point", pose.p),
            self.xyz("Quaternion", Rotation.from_matrix(pose.R).as_quat()),
        )
        zeros = np.zeros(36)
        self.add(
            topic,
            "nav_msgs/msg/Odometry",
            t_ns,
            self.new(
                "nav_msgs/msg/Odometry",
                self.header(t_ns, "odom"),
                child,
                self.new("geometry_msgs/msg/PoseWithCovariance", place, zeros),
                self.new("geometry_msgs/msg/TwistWithCovariance", self.twist(v, w), zeros),
            ),
        )

    def twist_stamped(self, topic: str, t_ns: int, v: Iterable[float], w: Iterable[float]) -> None:
        kind = "geometry_msgs/msg/TwistStamped"
        self.add(topic, kind, t_ns, self.new(kind, self.header(t_ns, "base"), self.twist(v, w)))

    def imu(
        self, topic: str, t_ns: int, a: Iterable[float], w: Iterable[float], frame: str = ""
    ) -> None:
        kind, zeros = "sensor_msgs/msg/Imu", np.zeros(9)
        upright = self.xyz("Quaternion", (0, 0, 0, 1))
        both = self.xyz("Vector3", w), zeros, self.xyz("Vector3", a), zeros
        header = self.header(t_ns, frame)
        self.add(topic, kind, t_ns, self.new(kind, header, upright, zeros, *both))

    def fix(
        self,
        topic: str,
        t_ns: int,
        place: Iterable[float],
        sigma_m: float = 0.0,
        status: int = 0,
        frame: str = "",
    ) -> None:
        """Latitude, longitude, altitude."""
        kind = "sensor_msgs/msg/NavSatFix"
        state = self.new("sensor_msgs/msg/NavSatStatus", status, 1)
        covariance = sigma_m**2 * np.eye(3).ravel()
        of_kind = 2 if sigma_m else 0
        header = self.header(t_ns, frame)
        self.add(topic, kind, t_ns, self.new(kind, header, state, *place, covariance, of_kind))

    def vector(self, topic: str, t_ns: int, x: Iterable[float]) -> None:
        kind = "geometry_msgs/msg/Vector3Stamped"
        self.add(topic, kind, t_ns, self.new(kind, self.header(t_ns), self.xyz("Vector3", x)))

    def transforms(self, topic: str, t_ns: int, links: dict[tuple[str, str], Poses]) -> None:
        """The pose of the second frame in the first one, by pairs."""
        each = [
            self.new(
                "geometry_msgs/msg/TransformStamped",
                self.header(t_ns, parent),
                child,
                self.new(
                    "geometry_msgs/msg/Transform",
                    self.xyz("Vector3", T.p),
                    self.xyz("Quaternion", Rotation.from_matrix(T.R).as_quat()),
                ),
            )
            for (parent, child), T in links.items()
        ]
        self.add(topic, TF, t_ns, self.new(TF, each))

    def joints(self, topic: str, t_ns: int, speeds: dict[str, float]) -> None:
        kind, none = "sensor_msgs/msg/JointState", np.zeros(0)
        turning = np.array(list(speeds.values()))
        state = self.new(kind, self.header(t_ns), list(speeds), none, turning, none)
        self.add(topic, kind, t_ns, state)

    def image(
        self,
        topic: str,
        t_ns: int,
        picture: NDArray[np.generic],
        encoding: str = "mono8",
        pad: int = 0,
        frame: str = "",
    ) -> None:
        """Rows with `pad` bytes behind each."""
        kind = "sensor_msgs/msg/Image"
        rows = picture.reshape(picture.shape[0], -1).view(np.uint8)
        packed = np.hstack((rows, np.full((len(rows), pad), 77, np.uint8)))
        size = picture.shape[0], picture.shape[1]
        image = self.new(
            kind, self.header(t_ns, frame), *size, encoding, 0, packed.shape[1], packed.ravel()
        )
        self.add(topic, kind, t_ns, image)

    def compressed(self, topic: str, t_ns: int, content: bytes) -> None:
        kind = "sensor_msgs/msg/CompressedImage"
        data = np.frombuffer(content, np.uint8)
        self.add(topic, kind, t_ns, self.new(kind, self.header(t_ns), "png", data))

    def camera_info(self, topic: str, size: tuple[int, int], **matrices: Any) -> None:
        """K, D, R, P and distortion_model."""
        kind = "sensor_msgs/msg/CameraInfo"
        model = matrices.pop("distortion_model")
        names = {name: name if self.ros == 1 else name.lower() for name in matrices}
        numbers = {names[name]: np.ravel(matrix).astype(float) for name, matrix in matrices.items()}
        roi = self.new("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        t_ns = NS
        info = self.new(
            kind,
            header=self.header(t_ns),
            height=size[1],
            width=size[0],
            distortion_model=model,
            binning_x=0,
            binning_y=0,
            roi=roi,
            **numbers,
        )
        self.add(topic, kind, t_ns, info)

    def cloud(
        self, topic: str, t_ns: int, rows: dict[str, NDArray[np.generic]], frame: str = ""
    ) -> None:
        """PointCloud2: ids as uint32, pixels as float32, four bytes of nothing between."""
        kind = "sensor_msgs/msg/PointCloud2"
        formats = ["<u4" if name == "id" else "<f4" for name in rows]
        offsets = [8 * k for k in range(len(rows))]
        size = 8 * len(rows)
        row = np.dtype(
            {"names": list(rows), "formats": formats, "offsets": offsets, "itemsize": size}
        )
        count = len(next(iter(rows.values())))
        table = np.zeros(count, row)
        for name, values in rows.items():
            table[name] = values
        fields = [
            self.new("sensor_msgs/msg/PointField", name, offset, 6 if form == "<u4" else 7, 1)
            for name, offset, form in zip(rows, offsets, formats, strict=True)
        ]
        data = np.frombuffer(table.tobytes(), np.uint8)
        cloud = self.new(
            kind, self.header(t_ns, frame), 1, count, fields, False, size, size * count, data, True
        )
        self.add(topic, kind, t_ns, cloud)

    def features(self, topic: str, t_ns: int, rows: NDArray[np.float64]) -> None:
        """id, u0, v0, u1, v1 as msckf_vio sends them."""
        each = [self.new(ONE_FEATURE, int(row[0]), *map(float, row[1:])) for row in rows]
        self.add(topic, FEATURES, t_ns, self.new(FEATURES, self.header(t_ns), each))

    # --- files ------------------------------------------------------------------------------------

    def write(self, path: Path, mcap: bool = False) -> Path:
        """A .bag of ROS 1, or a folder of ROS 2."""
        if self.ros == 1:
            with Writer1(path) as writer:
                self._fill(writer, self.store.serialize_ros1)
        else:
            plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
            with Writer2(path, version=9, storage_plugin=plugin) as second:
                self._fill(second, self.store.serialize_cdr)
        return path

    def _fill(self, writer: Any, serialize: Any) -> None:
        connections: dict[str, Any] = {}
        for topic, kind, arrival_ns, message in sorted(self.found, key=lambda found: found[2]):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=self.store)
            writer.write(connections[topic], arrival_ns, serialize(message, kind))
