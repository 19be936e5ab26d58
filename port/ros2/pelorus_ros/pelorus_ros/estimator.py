# SPDX-License-Identifier: MIT
"""Messages of ROS in, odometry out: all of the node that needs no rclpy.

A message is anything with the fields of its type. What cannot be used is counted and told in
`diagnose`, and nothing here raises for what a message holds.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pelorus import schema, se3
from pelorus.converters import ros_frames
from pelorus.converters.streams import FORCES_MPS2
from pelorus.errors import PelorusError, write_text
from pelorus.frames import Imu, Process, Reading, Stereo, Twist
from pelorus.inertial import Inertial
from pelorus.layout import Floats
from pelorus.online.drive import Setup
from pelorus.online.eyes import Eyes, Seen, open_eyes, require_size
from pelorus.online.odometry import Given, Odom, Odometry
from pelorus.online.order import Datum
from pelorus.online.pairs import Joining, Pairing
from pelorus.rig import read as rig_files
from pelorus.rig.camera_info import Info, Infos
from pelorus.rig.lens import LensModel
from pelorus.rig.read import Calibrated
from pelorus.rig.rig import Rig
from pelorus.se3 import IDENTITY, Poses

from pelorus_ros import conventions
from pelorus_ros.diagnosis import Level, Status, of_health
from pelorus_ros.mounting import Mounting, NoChain, bare
from pelorus_ros.parameters import Options

SIDES = ("left", "right")
WINDOW = 50  # readings by whose median the unit is judged
WINDOWS_ENOUGH = 4
G_MPS2 = 9.80665
MISSED_SHARE = 0.1  # of the pictures may lack their partner before it is told
LATE_SHARE = 0.02
Result = TypeVar("Result")


class NotYet(Exception):
    """What is still wanted before anything can be estimated."""


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
    """Everything between messages and odometry. `blocked` says why nothing is told although data
    come: what was found cannot be right.
    """

    def __init__(self, options: Options) -> None:
        self.options = options
        self.mounting = Mounting()
        self.odometry: Odometry | None = None
        self.blocked: dict[str, str] = {}
        self.waits_for = "for the first data"
        self.counts: Counter[str] = Counter()  # messages used, by topic; what was left out
        self.last: Odom | None = None
        self._faults: dict[str, str] = {}  # of messages that could not be read, by topic
        self._infos: dict[str, Info] = {}
        self._frames: dict[str, str] = {}  # frame_id by topic
        self._given: Given | None = self._initial()
        self._before: Counter[str] = Counter()
        self._begin()

    def _begin(self) -> None:
        within = round(self.options.sync_matching_threshold_ms * 1e6)
        self._pairing: Pairing[Any] = Pairing(within)
        self._joining = Joining()
        self._forces: deque[float] = deque(maxlen=WINDOW)
        self._windows = 0
        self._eyes: Eyes | None = None
        self._calibrated: Calibrated | None = None
        self._swapped = False
        self._size: tuple[int, int] = (0, 0)

    # --- what comes

    def transforms(self, message: Any) -> list[Odom]:
        self.mounting.add(message)
        return []

    def camera_info(self, side: str, message: Any) -> list[Odom]:
        """The first one of each camera counts."""
        if side not in self._infos:
            K, D, R, P = (np.array(getattr(message, name), np.float64) for name in "kdrp")
            self._infos[side] = Info(
                Path(f"{side}/camera_info"), "",
                *(K.reshape(3, 3), D, R.reshape(3, 3), P.reshape(3, 4)),
                message.distortion_model, message.width, message.height,
            )  # fmt: skip
        return []

    def picture(self, side: str, message: Any, too_slow: bool = False) -> list[Odom]:
        """An Image or a CompressedImage. A pair that comes while older ones still wait to be
        followed is left out, so that the odometry stays in time: `too_slow`.
        """
        self.counts[f"{side}/image"] += 1
        self._frames.setdefault(side, bare(message.header.frame_id))
        pair = self._pairing.add(side == "right", stamp_ns(message.header), message)
        if pair is None:
            return []
        if too_slow:
            self.counts["too slow"] += 1
            return []
        return self._guarded("left/image", lambda: self._followed(pair.t_ns, pair.left, pair.right))

    def tracks(self, message: Any) -> list[Odom]:
        """A message of one of parameters.TRACKS."""
        self.counts["tracks"] += 1
        self._frames.setdefault("left", bare(message.header.frame_id))
        return self._guarded("tracks", lambda: self._told(message))

    def imu(self, message: Any) -> list[Odom]:
        self.counts["imu"] += 1
        self._frames.setdefault("imu", bare(message.header.frame_id))
        t_ns = stamp_ns(message.header)
        return self._inertial([Imu(t_ns, _row(message.linear_acceleration), _row(message.angular_velocity))])

    def gyro(self, message: Any) -> list[Odom]:
        self.counts["gyro"] += 1
        self._frames.setdefault("imu", bare(message.header.frame_id))
        w = _row(message.angular_velocity)[0]
        return self._inertial(self._joining.rate(stamp_ns(message.header), w))

    def accel(self, message: Any) -> list[Odom]:
        self.counts["accel"] += 1
        a = _row(message.linear_acceleration)[0]
        return self._inertial(self._joining.force(stamp_ns(message.header), a))

    def wheels(self, message: Any) -> list[Odom]:
        """An Odometry, or a TwistWithCovarianceStamped."""
        self.counts["wheels"] += 1
        frame = bare(getattr(message, "child_frame_id", "") or message.header.frame_id)
        self._frames.setdefault("wheels", frame)
        twist = message.twist.twist
        C = np.array(message.twist.covariance, np.float64).reshape(6, 6)
        read = Wheels(
            stamp_ns(message.header), frame, _row(twist.linear)[0], _row(twist.angular)[0],
            np.sqrt(np.clip(np.diag(C)[:3], 0, None)),
        )  # fmt: skip
        if self.options.motion == "wheels":
            if not self._ready():
                return []
            return self._add(Twist(read.t_ns, read.v_mps, read.w_radps))
        return self._guarded("wheels", lambda: self._beside(read))

    def initial_pose(self, message: Any) -> list[Odom]:
        """A PoseWithCovarianceStamped of the base in odom."""
        p, q = message.pose.pose.position, message.pose.pose.orientation
        T = conventions.pose_of((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
        C = np.array(message.pose.covariance, np.float64).reshape(6, 6)
        if T is None or not np.isfinite(C).all():
            self._faults["initialpose"] = "the pose is not finite, or its quaternion has no length"
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
        self.blocked, self.last = {}, None
        self._begin()

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
        return self.odometry.finish() if self.odometry is not None else []

    def _state_file(self) -> Path:
        if not self.options.state_file:
            raise PelorusError("the parameter state_file is not set: it names the file")
        return Path(self.options.state_file)

    # --- pictures and tracks

    def _followed(self, t_ns: int, left: Any, right: Any) -> list[Odom]:
        pictures = [ros_frames.gray(Path(f"{side}/image"), m) for side, m in zip(SIDES, (left, right), strict=True)]
        self._size = pictures[0].shape[1], pictures[0].shape[0]
        if not self._ready() or self._calibrated is None or "cameras" in self.blocked:
            return []
        if self._swapped:
            pictures.reverse()
        header, rig = self._calibrated.header, self._calibrated.rig
        require_size(*pictures, header.image_width_px, header.image_height_px)
        if self._eyes is None:
            self._eyes = open_eyes(None if rig is None else rig.rectification())
        try:
            seen = self._eyes.see(*pictures)
        except PelorusError as error:
            self.blocked["cameras"] = str(error)
            return []
        return self._frame(t_ns, seen)

    def _told(self, message: Any) -> list[Odom]:
        if not self._ready() or self._calibrated is None:
            return []
        if hasattr(message, "left_u"):
            sides = (message.left_u, message.left_v, message.right_u, message.right_v)
            if len({len(message.id), *map(len, sides)}) > 1:
                raise PelorusError("id, left_u, left_v, right_u and right_v differ in length")
            ids = np.array(message.id, np.uint32)
            pixels = np.array(sides, np.float64).T.reshape(-1, 4)
        else:
            rows = ros_frames.observations(Path("tracks"), message, self._calibrated)
            ids, pixels = (rows[:, 0].astype(np.int64) % 2**32).astype(np.uint32), rows[:, 1:]
        if self._calibrated.rig is not None:
            pixels = self._calibrated.rig.rectification().pixels(pixels)
        good = np.isfinite(pixels).all(axis=1)
        return self._frame(stamp_ns(message.header), Seen(ids[good], pixels[good].astype(np.float32)))

    def _frame(self, t_ns: int, seen: Seen) -> list[Odom]:
        rig = self._calibrated.rig if self._calibrated is not None else None
        offset_ns = 0 if rig is None else round(rig.offset_s * 1e9)
        disparity = seen.pixels[:, 0] - seen.pixels[:, 2]
        if len(disparity) > WINDOW // 5 and float(np.median(disparity)) < 0:
            self.blocked["cameras"] = (
                "most points lie further right in the right picture than in the left one: are left "
                "and right swapped?"
            )
            return []
        return self._add(Stereo(t_ns + offset_ns, seen.ids, seen.pixels))

    # --- motion

    def _inertial(self, readings: Iterable[Imu]) -> list[Odom]:
        told = []
        for one in readings:
            a, w = one.a_B_mps2 * self.options.accel_scale, one.w_B_radps * self.options.gyro_scale
            self._judge_unit(float(np.linalg.norm(a)))
            if not self._ready() or self._calibrated is None:
                continue
            right = self._calibrated.imu.correction.of(Inertial(np.array([one.t_ns]), a, w))
            told += self._add(Imu(one.t_ns, right.a_B_mps2, right.w_B_radps))
        return told

    def _judge_unit(self, force: float) -> None:
        """At the beginning: half a second at a time, until four in a row are right."""
        if self._windows >= WINDOWS_ENOUGH:
            return
        self._forces.append(force)
        if len(self._forces) < WINDOW:
            return
        usual = float(np.median(self._forces))
        self._forces.clear()
        if FORCES_MPS2[0] <= usual <= FORCES_MPS2[1]:
            self._windows += 1
            self.blocked.pop("imu", None)
            return
        self._windows = 0
        hint = "has gravity been taken away (a filtered topic)? raw readings are wanted"
        if FORCES_MPS2[0] <= usual * G_MPS2 <= FORCES_MPS2[1]:
            hint = f"that is g: set the parameter accel_scale to {G_MPS2:g}"
        self.blocked["imu"] = f"the specific force is {usual:.3g} m/s^2 in the median, not 9.81: {hint}"

    def _beside(self, read: Wheels) -> list[Odom]:
        """Wheels beside an IMU: their velocity in the IMU's axes, at the place of their frame."""
        if not self._ready():
            return []
        T = self._wheels_on_imu(read.frame)
        given = np.array(self.options.wheel_sigma_mps)
        sigma = np.where(read.sigma > 0, read.sigma, given)
        inside = np.sqrt(np.diag(T.R @ np.diag(sigma**2) @ T.R.T))
        number = schema.SENSORS["wheel"]
        return self._add(Reading(read.t_ns, number, 7, T.R @ read.v_mps, inside, T.p))

    def _wheels_on_imu(self, frame: str) -> Poses:
        imu = self._imu_frame()
        base = self.options.base_frame
        if self.odometry is not None and frame == base:
            return self.odometry.T_IB
        return self.mounting.between(frame, imu)

    # --- what it takes to begin

    def _ready(self) -> bool:
        if self.odometry is not None and self._calibrated is not None:
            return True
        try:
            self._set_up()
        except (NotYet, NoChain) as missing:
            self.waits_for = str(missing)
        except PelorusError as error:
            self.waits_for = str(error)
        else:
            self.waits_for = ""
            return True
        return False

    def _set_up(self) -> None:
        if not self.options.tracks_type and not self._size[0]:
            raise NotYet("for pictures: left/image and right/image, a pair of them")
        rig, calibrated = self._cameras()
        if rig is not None:
            calibrated = rig_files.of_rig(self._on_body(rig), "")
        assert calibrated is not None
        header = calibrated.header
        if self.options.motion != "wheels":
            told = {name: s for name, s in vars(calibrated.imu.noise).items() if s >= 0}
            header = replace(header, process=Process.IMU, noise=replace(header.noise, **told))
        if not self.options.tracks_type and not header.image_width_px:
            header = replace(header, image_width_px=self._size[0], image_height_px=self._size[1])
        self._swapped = rig is not None and rig.swapped and not self.options.files
        self._calibrated = replace(calibrated, header=header)
        if self.odometry is None:
            setup = Setup(header, self.options.filter_settings(), self.options.filter_precision)
            log = Path(self.options.log) if self.options.log else None
            self.odometry = Odometry(setup, self._base_on_body(), log, self._given)

    def _cameras(self) -> tuple[Rig | None, Calibrated | None]:
        """Of the files, else of camera_info; the project's own JSON says all by itself."""
        lens = LensModel.NONE if self.options.rectified else None
        if rig_files.is_own(self.options.files):
            return None, rig_files.read(self.options.files, "")
        if self.options.files:
            rig = rig_files.read_rig(self.options.files, lens)
        else:
            lacking = [f"{side}/camera_info" for side in SIDES if side not in self._infos]
            if lacking:
                raise NotYet(
                    f"for {' and '.join(lacking)}; or the parameter calibration names files "
                    "(Kalibr's camchain-imucam.yaml ...)"
                )
            infos = Infos(self._infos["left"], self._infos["right"], self.options.rectified)
            apart = None
            if not infos.have_baseline:
                apart = self.mounting.between(self._frames.get("left", ""), self._frames.get("right", ""))
            rig = infos.rig(apart)
        return (rig.of_size(*self._size) if self._size[0] else rig), None

    def _on_body(self, rig: Rig) -> Rig:
        T = _matrix("T_cam_imu", self.options.T_cam_imu)
        if T is not None:
            return rig.on_body(se3.compose(rig.T_LF, T))
        if rig.T_LB is not None:
            return rig
        side = "right" if rig.swapped else "left"
        camera = self.options.left_camera_frame or self._frames.get(side, "")
        if not camera:
            raise NotYet("for the left camera's frame: its messages name none; set left_camera_frame")
        return rig.on_body(se3.compose(rig.T_LF, self._between(self._body_frame(), camera)))

    def _between(self, source: str, target: str) -> Poses:
        try:
            return self.mounting.between(source, target)
        except NoChain as missing:
            raise NoChain(
                f"{missing}; publish it (robot_state_publisher, static_transform_publisher), or set "
                "the parameters T_cam_imu and T_base_imu"
            ) from None

    def _base_on_body(self) -> Poses:
        """T_IB: q_body = T s_base."""
        base, body = self.options.base_frame, self._body_frame()
        T = _matrix("T_base_imu", self.options.T_base_imu)
        if T is not None:
            return se3.inverse(T)
        return IDENTITY if base in ("", body) else self._between(base, body)

    def _body_frame(self) -> str:
        return self._frames.get("wheels", "") if self.options.motion == "wheels" else self._imu_frame()

    def _imu_frame(self) -> str:
        frame = self.options.imu_frame or self._frames.get("imu", "")
        if not frame and "imu" not in self._frames:
            raise NotYet("for the motion sensor's first message, whose frame is the body")
        if not frame:
            raise NotYet("for the IMU's frame: its messages name none; set the parameter imu_frame")
        return frame

    @property
    def child_frame(self) -> str:
        """What /odom calls the moving frame."""
        return self.options.base_frame or self._body_frame()

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

    def _add(self, datum: Datum) -> list[Odom]:
        assert self.odometry is not None
        told = self.odometry.add(datum)
        if self.blocked:
            return []
        if told:
            self.last = told[-1]
        return told

    def _guarded(self, topic: str, work: Callable[[], list[Odom]]) -> list[Odom]:
        """A message that cannot be used is told, and the next one is taken."""
        try:
            return work()
        except (PelorusError, NoChain, NotYet, ValueError) as error:
            self._faults[topic] = str(error)
            self.counts["unusable"] += 1
            return []

    def landmarks(self) -> NDArray[np.void]:
        """Returns the landmarks in odom, (n,) of conventions.LANDMARK."""
        odometry = self.odometry
        if odometry is None or odometry.drive is None or odometry.origin is None:
            return np.zeros(0, conventions.LANDMARK)
        return conventions.landmark_rows(odometry.drive.filter.landmarks(), odometry.origin)

    # --- how it goes

    def diagnose(self) -> list[Status]:
        """Returns what there is to say since the last call, a second ago as a rule."""
        fresh, self._before = self.counts - self._before, self.counts.copy()
        found = [self._of_setup(), *self._of_inputs(fresh), self._of_estimate()]
        log = self.odometry.drive.log if self.odometry and self.odometry.drive else None
        if log is not None and log.trouble:
            found.append(Status("log", Level.ERROR, log.trouble, "make room; restart for a new log"))
        return found

    def _of_setup(self) -> Status:
        if self.blocked:
            return Status("setup", Level.ERROR, "; ".join(self.blocked.values()), "correct it, then call reset")
        if self.waits_for:
            return Status("setup", Level.ERROR, f"waits {self.waits_for}" if self.waits_for.startswith("for") else self.waits_for)
        return Status("setup", Level.OK, "calibration and mounting are known")

    def topics(self) -> list[str]:
        """The inputs that are asked for."""
        eyes = ["tracks"] if self.options.tracks_type else ["left/image", "right/image"]
        motion = {"imu": ["imu"], "gyro_accel": ["gyro", "accel"], "wheels": ["wheels"]}
        beside = ["wheels"] if self.options.wheels_beside_imu else []
        return [*eyes, *motion[self.options.motion], *beside]

    def _of_inputs(self, fresh: Counter[str]) -> list[Status]:
        rates = {topic: str(fresh[topic]) for topic in self.topics()}
        silent = [topic for topic in self.topics() if not fresh[topic]]
        found = []
        if silent:
            never = [topic for topic in silent if not self.counts[topic]]
            since = "never" if never == silent else "since the last diagnostics"
            found.append(
                Status(
                    "inputs", Level.ERROR, f"nothing came on {', '.join(silent)} ({since})",
                    "is the driver alive, the name remapped, the QoS compatible? ros2 topic info -v", rates,
                )
            )  # fmt: skip
        else:
            found.append(Status("inputs", Level.OK, "all come", values=rates))
        found += [
            Status(topic, Level.ERROR, words, "the message was left out")
            for topic, words in self._faults.items()
        ]
        self._faults = {}
        return [*found, *self._of_pairs(), *self._of_order(), *self._of_speed(fresh)]

    def _of_pairs(self) -> list[Status]:
        pairing = self._pairing
        if pairing.alone <= MISSED_SHARE * (2 * pairing.paired + pairing.alone) or pairing.alone < 6:
            return []
        gap, within = pairing.usual_gap_ms, self.options.sync_matching_threshold_ms
        apart = "" if gap is None else f", as a rule {gap:.3g} ms apart"
        return [
            Status(
                "sync", Level.ERROR if not pairing.paired else Level.WARN,
                f"{pairing.alone} pictures had no partner within {within:g} ms{apart}; {pairing.paired} pairs",
                "trigger the cameras together (hardware sync); sync_matching_threshold_ms allows more, at a "
                "price in accuracy of speed times that time",
            )
        ]  # fmt: skip

    def _of_order(self) -> list[Status]:
        if self.odometry is None:
            return []
        counts, found = self.odometry.sequencer.counts, []
        total = sum(self.counts[topic] for topic in self.topics())
        if counts.late > max(LATE_SHARE * total, 2):
            late_ms = self.odometry.sequencer.late_by_ns * 1e-6
            found.append(
                Status(
                    "order", Level.WARN,
                    f"{counts.late} of {total} messages came too late or twice, the last by {late_ms:.3g} ms",
                    "are all stamps of one clock, taken at the measurement and not at the arrival?",
                )
            )  # fmt: skip
        if counts.off_clock:
            off_s = self.odometry.sequencer.off_by_ns * 1e-9
            found.append(
                Status(
                    "clock", Level.ERROR if counts.off_clock > LATE_SHARE * total else Level.WARN,
                    f"{counts.off_clock} stamps lie {off_s:+.3g} s from the others, and were left out",
                    "camera and IMU must have one clock: the driver's option for host or system time",
                )
            )  # fmt: skip
        found += [Status("clock", Level.WARN, words) for words in self.odometry.remarks]
        self.odometry.remarks = []
        return found

    def _of_speed(self, fresh: Counter[str]) -> list[Status]:
        if not fresh["too slow"]:
            return []
        return [
            Status(
                "speed", Level.WARN,
                f"{fresh['too slow']} pairs were left out: they come faster than they can be followed",
                "smaller pictures or a lower rate; the odometry itself stays in time",
            )
        ]  # fmt: skip

    def _of_estimate(self) -> Status:
        odometry = self.odometry
        if odometry is None or odometry.drive is None:
            return Status("estimate", Level.ERROR, "nothing is estimated yet", "see setup and inputs")
        estimate = odometry.drive.estimate()
        values = {}
        if self.last is not None:
            report = self.last.estimate.report
            sigma = np.sqrt(np.diag(self.last.covariance))
            values = {
                "points used": str(report.used if report is not None else 0),
                "sigma position, m": " ".join(f"{s:.3g}" for s in sigma[:3]),
                "sigma rotation, rad": " ".join(f"{s:.3g}" for s in sigma[3:]),
            }
            estimate = self.last.estimate
        refused = [
            f"{count} {kind.name}: {schema.STATUSES.get(status, status)}"
            for (kind, status), count in odometry.drive.refused.items()
        ]
        return of_health(estimate.health, estimate.reasons, values | {"refused": "; ".join(refused)})


def _row(vector: Any) -> Floats:
    return np.array([[vector.x, vector.y, vector.z]], np.float64)


def _matrix(name: str, numbers: list[float]) -> Poses | None:
    """Returns the 4 x 4 by rows as a pose; None where it was not given."""
    if len(numbers) != 16:
        return None
    from pelorus.rig.rig import rigid  # noqa: PLC0415

    return rigid(Path(f"parameter {name}"), name, np.array(numbers, np.float64).reshape(4, 4))
