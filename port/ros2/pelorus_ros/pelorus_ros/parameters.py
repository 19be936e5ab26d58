# SPDX-License-Identifier: MIT
"""The node's parameters: names, defaults and what they mean. rclpy declares them from here."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Self

from pelorus.errors import PelorusError
from pelorus.native.binding import Precision, library
from pelorus.native.configured import Configured

MOTIONS = ("imu", "gyro_accel", "wheels")
TRANSPORTS = ("raw", "compressed")
QOS = ("sensor_data", "reliable")
PRECISIONS = ("float32", "float64")
TRACKS = (
    "pelorus_msgs/msg/StereoTracks",
    "msckf_vio/msg/CameraMeasurement",
    "sensor_msgs/msg/PointCloud2",
)


def parameter(default: Any, about: str, choices: tuple[str, ...] = ()) -> Any:
    """A field of Options: a list is copied, for defaults are shared."""
    more = {"about": about, "choices": choices}
    if isinstance(default, list):
        return field(default_factory=lambda: list(default), metadata=more)
    return field(default=default, metadata=more)


@dataclass(frozen=True)
class Options:
    """One field a parameter. An empty list of numbers or of names is "not given"."""

    odom_frame: str = parameter("odom", "fixed frame of /odom, the path and the landmarks")
    base_frame: str = parameter(
        "base_link", "frame whose pose is told; empty: the IMU's (with wheels alone what they move)"
    )
    imu_frame: str = parameter("", "frame of the IMU, in place of its messages' frame_id")
    left_camera_frame: str = parameter("", "optical frame of the left camera, in place of frame_id")
    publish_odom_to_base_tf: bool = parameter(True, "send odom -> base on /tf")
    motion: str = parameter(
        "imu",
        "what tells the motion between pictures: imu (topic imu), gyro_accel (gyro and accel "
        "apart), or wheels in place of an IMU",
        MOTIONS,
    )
    wheels_beside_imu: bool = parameter(False, "use the wheels' velocity beside the IMU")
    wheels_type: str = parameter(
        "nav_msgs/msg/Odometry",
        "type of the topic wheels",
        ("nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistWithCovarianceStamped"),
    )
    wheel_sigma_mps: list[float] = parameter(
        [0.05, 0.05, 0.05],
        "noise of the wheels' velocity beside an IMU along x, y, z of their frame, where the "
        "message gives no variance; y and z are how far the base slides and hops",
    )
    wheel_track_m: float = parameter(
        0.0,
        "beside an IMU: distance of the left and the right wheel, by which the odometry's yaw rate "
        "was made; each wheel is then used by itself. 0: the yaw rate is not used",
    )
    tracks_type: str = parameter(
        "", "type of the topic tracks; empty: pictures are followed here", ("", *TRACKS)
    )
    calibration: list[str] = parameter(
        [""], "calibration files of any kind that `pelorus convert` reads; empty: camera_info"
    )
    rectified: bool = parameter(False, "the pictures are rectified already (image_rect)")
    T_cam_imu: list[float] = parameter(
        [0.0], "4 x 4 by rows: q_cam = T s_imu of the left camera, in place of /tf_static"
    )
    T_base_imu: list[float] = parameter(
        [0.0], "4 x 4 by rows: q_base = T s_imu, in place of /tf_static; one 0: not given"
    )
    sync_matching_threshold_ms: float = parameter(
        2.0, "left and right pictures belong together if their stamps differ by so much at most"
    )
    accel_scale: float = parameter(1.0, "to m/s^2: 9.80665 for an IMU that tells g")
    gyro_scale: float = parameter(1.0, "to rad/s: 0.0174533 for an IMU that tells degrees")
    image_transport: str = parameter(
        "raw", "raw, or compressed (topic image/compressed)", TRANSPORTS
    )
    image_qos: str = parameter(
        "sensor_data", "of pictures: sensor_data (best effort) or reliable", QOS
    )
    pairs_waiting: int = parameter(
        3, "pairs of pictures that may wait to be followed; of more the new ones are left out"
    )
    settings: list[str] = parameter(
        [""], "settings of the filter, name=value as pelorus-replay has them: pixel-sigma=1"
    )
    precision: str = parameter(
        "float32", "float32, as on the robot's controller, or float64", PRECISIONS
    )
    initial_pose: list[float] = parameter(
        [0.0], "x y z qx qy qz qw of the base in odom at the start; one 0: the origin, looking at x"
    )
    initial_pose_sigma: list[float] = parameter([0.01, 0.01], "of initial_pose: m, rad")
    known_map: str = parameter(
        "",
        "known landmarks, of pelorus-replay --out map.plr, by the ids of the topic tracks; "
        "their world is odom, and initial_pose says where in it the base starts",
    )
    log: str = parameter("", "recording of all that is used, drive.plr(.zst); replays to the bit")
    state_file: str = parameter("", "file of the services save_state and load_state")
    moved_sigma: list[float] = parameter(
        [0.0, 0.0], "how far it may have moved between save_state and load_state: m, rad"
    )
    path_length: int = parameter(1000, "poses kept in the path")

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Self:
        """Returns the options; PelorusError where a value is impossible."""
        for one in fields(cls):
            choices = one.metadata["choices"]
            if choices and values[one.name] not in choices:
                raise PelorusError(
                    f"parameter {one.name}: {values[one.name]!r}; one of "
                    f"{', '.join(map(repr, choices))} is possible"
                )
        made = cls(**{one.name: values[one.name] for one in fields(cls)})
        made._check()
        return made

    def _check(self) -> None:
        for name, counts in (
            ("T_cam_imu", (1, 16)),
            ("T_base_imu", (1, 16)),
            ("initial_pose", (1, 7)),
            ("initial_pose_sigma", (2,)),
            ("moved_sigma", (2,)),
            ("wheel_sigma_mps", (3,)),
        ):
            numbers = getattr(self, name)
            if len(numbers) not in counts:
                raise PelorusError(
                    f"parameter {name}: {len(numbers)} numbers; {max(counts)} are expected"
                )
        if not self.sync_matching_threshold_ms >= 0:
            raise PelorusError(
                f"parameter sync_matching_threshold_ms: {self.sync_matching_threshold_ms}; "
                "0 or more is possible"
            )
        if not 0 <= self.wheel_track_m < 100:
            raise PelorusError(
                f"parameter wheel_track_m: {self.wheel_track_m}; 0 to 100 m is possible"
            )
        if self.known_map and not self.tracks_type:
            raise PelorusError(
                "parameter known_map: a point that is followed here has a new id in every run; "
                "give tracks_type, and tracks whose ids are the map's"
            )
        if self.known_map and len(self.initial_pose) != 7:
            raise PelorusError("parameter known_map: where in it? initial_pose is expected, too")
        if self.log and not Path(self.log).parent.is_dir():
            raise PelorusError(f"parameter log: {self.log}: there is no such folder")
        self.filter_settings()

    @property
    def files(self) -> tuple[Path, ...]:
        return tuple(Path(name) for name in self.calibration if name)

    @property
    def filter_precision(self) -> Precision:
        return "float32" if self.precision == "float32" else "float64"

    def filter_settings(self) -> dict[str, float | str]:
        """Returns the settings by name; PelorusError where there is none such."""
        found: dict[str, float | str] = {}
        for pair in filter(None, self.settings):
            name, equals, value = (part.strip() for part in pair.partition("="))
            if not equals:
                raise PelorusError(f"parameter settings: {pair!r}; name=value is expected")
            found[name] = _number_or_word(value)
            Configured(library(self.filter_precision)).set(name, found[name])
        return ({"known-map": "on"} if self.known_map else {}) | found


def _number_or_word(value: str) -> float | str:
    try:
        return float(value)
    except ValueError:
        return value


def table() -> dict[str, tuple[Any, str]]:
    """Returns of each parameter its default and a description."""
    defaults = Options()
    return {
        one.name: (getattr(defaults, one.name), one.metadata["about"]) for one in fields(Options)
    }


def misspelt(given: Iterable[str], builtin: Iterable[str] = ()) -> list[str]:
    """Returns a sentence for each name that is no parameter."""
    known = [*table(), *builtin]
    told = []
    for name in sorted(set(given) - set(known)):
        if name == "use_sim_time" or name.startswith(("qos_overrides.", "start_type_description")):
            continue
        near = difflib.get_close_matches(name, known, 1)
        meant = (
            f"; did you mean {near[0]}?" if near else f"; there are {', '.join(sorted(table()))}"
        )
        told.append(f"there is no parameter {name}{meant}")
    return told
