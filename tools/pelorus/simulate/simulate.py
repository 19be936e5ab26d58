# SPDX-License-Identifier: MIT
"""The whole simulated recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pelorus.io.recording import Recording
from pelorus.io.small_sensors import SMALL_SENSORS, Motion, SmallSensor
from pelorus.io.tracks import Indices, Tracks
from pelorus.math import motion
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.program.console import progress
from pelorus.simulate import sensors, settings
from pelorus.simulate.drive import TURN_MAX_RAD, Drive, Way, drive, exp, rotate, stood, way_poses
from pelorus.simulate.imu import (
    NO_FAULTS,
    NO_IMU,
    ImuDrive,
    ImuFaults,
    Sensed,
    SimulatedImu,
    drive_and_read,
    driven,
)
from pelorus.simulate.mishaps import NO_MISHAPS, Flags, Mishaps, TrackDrift
from pelorus.simulate.readings import Sensing, read
from pelorus.simulate.sensors import Chances, Depths
from pelorus.simulate.settings import (
    AT_LEAST_ONE,
    BELOW_ONE,
    POSITIVE,
    Rule,
    Span,
    require,
    setting,
)
from pelorus.wire.frames import (
    OBSERVATIONS_MAX,
    BodyAxes,
    Camera,
    Header,
    Landmark,
    Noise,
    Reading,
    TwistTiming,
    header_name,
)
from pelorus.wire.layout import Floats
from pelorus.wire.settings import CALIBRATION_SIGMAS

FRAMES_MAX = 1_000_000
PEAK_TURN = 1.7  # the peak of the turn rate over its mean, and some roll and pitch


@dataclass(frozen=True)
class Options:
    """The options of a drive."""

    seed: int = setting(
        1,
        "The same seed gives the same bytes.",
        rule=Rule(lambda x: x >= 0, "a whole number, not negative"),
    )
    duration_s: float = setting(60.0, "Length of the drive.", "S", POSITIVE)
    frame_rate_hz: float = setting(10.0, "Stereo frames.", "HZ", POSITIVE)
    twist_rate_hz: float = setting(
        100.0, "Twists: a whole multiple of the frame rate.", "HZ", POSITIVE
    )
    twist_timing: TwistTiming = setting(TwistTiming.START, "When a twist reading holds.", rule=None)
    speed_mps: float = setting(3.0, "Mean speed.", "M/S")
    lap_s: float = setting(40.0, "Time of a lap.", "S", POSITIVE)
    parked: bool = setting(False, "Stand still: neither --speed nor --lap moves it.")
    landmarks: int = setting(800, "Landmarks along the way.", rule=AT_LEAST_ONE)
    observations: int = setting(
        60,
        "Most observations of a frame.",
        rule=Rule(lambda x: 0 < x <= OBSERVATIONS_MAX, f"1 to {OBSERVATIONS_MAX}"),
    )
    min_depth_m: float = setting(
        0.0,
        "None is seen nearer; 0: as they come. A far scene: --min-depth 50 --max-depth 400.",
        "M",
    )
    max_depth_m: float = setting(
        0.0, "None is seen farther, and --range gives way; 0: --range.", "M"
    )
    baseline_m: float = setting(sensors.CAMERA.baseline_m, "Of the stereo camera.", "M", POSITIVE)
    range_m: float = setting(30.0, "How far is seen.", "M", POSITIVE)
    keep_ids: bool = setting(False, "A landmark seen again has its old id: loops close.")
    known: bool = setting(False, "Write the landmarks as known ones (implies --keep-ids).")
    known_sigma_m: float = setting(
        0.01, "Standard deviation to be told of known landmarks.", "M", POSITIVE
    )
    loss: float = setting(0.01, "Probability a frame that a track breaks.", rule=BELOW_ONE)
    pixel_sigma_px: float = setting(1.0, "Noise of a pixel.", "PX")
    velocity_sigma_mps: float = setting(0.05, "Noise of a linear velocity, each axis.", "M/S")
    gyro_sigma_radps: float = setting(0.01, "Noise of an angular velocity, each axis.", "RAD/S")
    bias_velocity_sigma_mps: float = setting(0.05, "The linear bias is drawn with it.", "M/S")
    bias_gyro_sigma_radps: float = setting(0.005, "The angular bias is drawn with it.", "RAD/S")
    bias_velocity_walk: float = setting(
        0.0, "Variance that the linear bias gains, (m/s)^2 a second."
    )
    bias_gyro_walk: float = setting(
        0.0, "Variance that the angular bias gains, (rad/s)^2 a second."
    )
    outliers: float = setting(0.02, "Fraction of observations that are wrong.", rule=BELOW_ONE)
    drop: float = setting(0.01, "Fraction of frames that are lost.", rule=BELOW_ONE)
    camera_delay_s: float = setting(
        0.0, "Frames stand so much later in the file than their time, as off a slow camera.", "S"
    )
    frame_lead_ns: int = setting(
        0,
        "Frames are taken so much before a twist or a reading, as stamps that are rounded lie: 416 "
        "is EuRoC's.",
        "NS",
    )
    stop: Span | None = setting(None, "From then on the robot rests.")
    mishaps: Mishaps = NO_MISHAPS
    readings: Mapping[str, Sensing] = field(default_factory=dict)  # of small sensors, by name
    imu: SimulatedImu = NO_IMU
    imu_faults: ImuFaults = NO_FAULTS

    def check(self) -> None:
        """Refuses contradictory options, by the option's name."""
        settings.check(self)
        settings.check(self.imu)
        deeper = not self.max_depth_m or self.max_depth_m > self.min_depth_m
        require("max_depth_m", self.max_depth_m, deeper, "more than --min-depth")
        self.mishaps.check()
        self.imu_faults.check(self.imu)
        self.mishaps.check_beside(self.imu.is_there)
        for sensor in self.small_sensors:
            self.readings[sensor.name].check(sensor, self.twist_rate_hz)
        ratio = self.twist_rate_hz / self.frame_rate_hz
        whole = round(ratio) == ratio >= 1
        expected = "a whole multiple of the frame rate"
        require("twist_rate_hz", self.twist_rate_hz, whole, expected)
        short = self.frames <= FRAMES_MAX
        require("duration_s", self.duration_s, short, f"at most {FRAMES_MAX} frames")
        within = self.frame_lead_ns * self.twist_rate_hz < 1e9
        require("frame_lead_ns", self.frame_lead_ns, within, "less than from one twist to the next")
        turn = PEAK_TURN * 2 * np.pi / self.lap_s / self.twist_rate_hz
        expected = f"at most {TURN_MAX_RAD} rad a twist"
        require("lap_s", self.lap_s, turn < TURN_MAX_RAD, expected)

    @property
    def small_sensors(self) -> list[SmallSensor]:
        """Returns the small sensors that have options."""
        return [sensor for sensor in SMALL_SENSORS if sensor.name in self.readings]

    @property
    def depths(self) -> Depths:
        return Depths(self.min_depth_m, self.max_depth_m)

    @property
    def seen_m(self) -> float:
        """Returns the camera's range; the chosen depths are not cut off."""
        deepest = self.depths.side_m[1] if self.depths.given else 0.0
        return max(self.range_m, 2 * deepest)

    @property
    def way(self) -> Way:
        """Returns the path of a body with an IMU, which needs accelerations."""
        return Way(self.speed_mps, self.lap_s, self.imu.rest_s, self.stop, self.parked)

    @property
    def imu_drive(self) -> ImuDrive:
        return ImuDrive(self.way, self.imu, self.imu_faults, self.bias_gyro_sigma_radps)

    @property
    def camera(self) -> Camera:
        """Returns the HEADER's camera."""
        return replace(sensors.CAMERA, baseline_m=self.baseline_m)

    @property
    def frames(self) -> int:
        return int(self.duration_s * self.frame_rate_hz) + 1

    @property
    def twists_per_frame(self) -> int:
        return round(self.twist_rate_hz / self.frame_rate_hz)

    @property
    def lookahead_s(self) -> float:
        """Returns how far beyond the drive's end landmarks are needed: the camera looks ahead."""
        return min(self.range_m / self.speed_mps, self.lap_s) if self.speed_mps else 0.0


@dataclass(frozen=True)
class Simulation:
    """The recording, and what no robot would know."""

    recording: Recording
    points_W: Floats  # (landmarks, 3)
    bias_velocity_mps: Floats  # (twists, 3)
    bias_gyro_radps: Floats
    outlier: Flags  # of each observation
    imu: Sensed | None = None


def simulate(options: Options) -> Simulation:
    """Simulates a drive: motion, scene and measurements."""
    options.check()
    chances = Chances(options.seed)
    points = _landmarks(options, chances)
    t_ns = _node_times(options)
    if options.imu.is_there:
        way, sensed = drive_and_read(options.imu_drive, t_ns, chances)
    else:
        way, sensed = _way(options, t_ns), None
    v, w, bias_v, bias_w = _readings(options, way, chances)
    at_frames = np.arange(options.frames) * options.twists_per_frame
    frame_t_ns = np.maximum(t_ns[at_frames] - options.frame_lead_ns, 0)
    truth = options.mishaps.jumped(frame_t_ns, _led(options, way, at_frames))
    kept = np.nonzero(chances["drops"].random(options.frames) >= options.drop)[0]
    tracks, outlier = _observe(options, frame_t_ns[kept], truth.at(kept), points, chances)
    recording = Recording(
        _header(options),
        t_ns,
        v,
        w,
        frame_t_ns[kept],
        tracks,
        frame_t_ns,
        truth,
        known=_known(options, points),
        readings=_small_readings(options, way, chances),
        camera_delay_ns=round(options.camera_delay_s * 1e9),
        twist_delay_ns=round(options.mishaps.twist_delay_s * 1e9),
        settings=_exact_camera(options),
    )
    if sensed is not None:
        recording = driven(recording, options.imu_drive, sensed, chances["start"])
    return Simulation(recording, points, bias_v, bias_w, outlier, sensed)


def _exact_camera(options: Options) -> dict[str, float]:
    """Returns the settings of an exact calibration, unless errors of it are asked for."""
    mishaps = options.mishaps
    off = mishaps.focal_error_percent or mishaps.baseline_error_percent or mishaps.camera_turned_deg
    return {} if off else dict.fromkeys(CALIBRATION_SIGMAS, 0.0)


def _landmarks(options: Options, chances: Chances) -> Floats:
    """Returns landmarks beside the path and beyond its end.

    A parked body sees those of the path on which it could drive.
    """
    t_ns = _node_times(options, options.lookahead_s)
    if options.imu.is_there:
        poses = way_poses(t_ns, options.way._replace(parked=False))
    else:
        poses = _way(replace(options, parked=False), t_ns).poses
    return sensors.landmarks(poses, options.landmarks, chances["scene"], options.depths)


def _way(options: Options, t_ns: Times) -> Drive:
    """Returns the drive by twists."""
    if options.parked:
        return stood(t_ns)
    timing, speed, lap = options.twist_timing, options.speed_mps, options.lap_s
    return drive(t_ns, timing, speed, lap, options.stop)


def _led(options: Options, way: Drive, nodes: Indices) -> Poses:
    """Returns the poses at these nodes but the first, moved ahead to the frames' times.

    They follow the twist that holds there; by an IMU the rate at the node, which over 1 ms is exact
    to micrometres.
    """
    poses = way.poses.at(nodes)
    if not options.frame_lead_ns:
        return poses
    held = [way.v_B_mps[1:], way.w_B_radps[1:]]
    if not options.imu.is_there:
        held = [motion.held(x, options.twist_timing) for x in (way.v_B_mps, way.w_B_radps)]
    lead_s = np.where(nodes > 0, options.frame_lead_ns * 1e-9, 0.0)[:, None]
    v, w = (x[np.maximum(nodes - 1, 0)] for x in held)
    steps = exp(-lead_s * v, -lead_s * w)
    return Poses(poses.R @ steps.R, poses.p + rotate(poses.R, steps.p))


def blindness(recording: Recording) -> str:
    """Returns a remark on frames in which nothing is seen; empty if there are none."""
    frames = len(recording.frame_t_ns)
    blind = int((recording.tracks.counts() == 0).sum())
    if not blind:
        return ""
    return (
        f"nothing is seen in {blind} of {frames} frames: more --landmarks, a longer --range, a "
        "slower --speed or a smaller --min-depth would show more"
    )


def _node_times(options: Options, more_s: float = 0.0) -> Times:
    count = (options.frames - 1) * options.twists_per_frame + 1
    nodes = np.arange(count + int(more_s * options.twist_rate_hz))
    return np.round(nodes * (1e9 / options.twist_rate_hz)).astype(np.int64)


def _readings(
    options: Options, way: Drive, chances: Chances
) -> tuple[Floats, Floats, Floats, Floats]:
    tau = np.diff(way.t_ns) * 1e-9
    count = len(way.t_ns)
    bias_v = sensors.biases(
        options.bias_velocity_sigma_mps, options.bias_velocity_walk, tau, chances["bias_v"]
    )
    bias_w = sensors.biases(
        options.bias_gyro_sigma_radps, options.bias_gyro_walk, tau, chances["bias_w"]
    )
    v = way.v_B_mps + sensors.white(options.velocity_sigma_mps, count, chances["velocity"]) + bias_v
    w = way.w_B_radps + sensors.white(options.gyro_sigma_radps, count, chances["gyro"]) + bias_w
    v, w = options.mishaps.readings(way.t_ns, v, w)
    return v, w, bias_v, bias_w


def _small_readings(options: Options, way: Drive, chances: Chances) -> list[Reading]:
    v, w = way.v_B_mps, way.w_B_radps
    if not options.imu.is_there:
        held = (motion.held(x, options.twist_timing) for x in (v, w))
        v, w = (np.concatenate((x, x[-1:])) for x in held)
    moves = Motion(options.mishaps.jumped(way.t_ns, way.poses), v, w)
    found: list[Reading] = []
    for sensor in options.small_sensors:
        sensing = options.readings[sensor.name]
        if sensing.rate_hz:
            every = round(options.twist_rate_hz / sensing.rate_hz)
            found += read(sensor, sensing, way.t_ns, moves, every, chances[sensor.name])
    return found


def _observe(
    options: Options, t_ns: Times, poses: Poses, points: Floats, chances: Chances
) -> tuple[Tracks, Flags]:
    tracker = sensors.SimulatedTracker(
        options.landmarks,
        options.observations,
        options.loss,
        options.keep_ids or options.known,
        chances["tracker"],
    )
    mishaps = options.mishaps
    camera, extrinsic = mishaps.true_camera(options.camera), mishaps.true_extrinsic(sensors.T_CB)
    moves = (chances["moving"].random(len(points)) < mishaps.moving)[:, None]
    ways = mishaps.ways(t_ns, poses, chances["moving_ways"])
    drift = TrackDrift(len(points), mishaps.track_drift, chances["drift"])
    tau_s = np.diff(t_ns, prepend=t_ns[:1]) * 1e-9
    by_chance = (options.pixel_sigma_px, options.outliers, chances["pixels"], chances["outliers"])
    frames, ids, pixels, wrong = [], [], [], []
    for k in progress(range(len(t_ns)), "simulating", len(t_ns)):
        places = np.where(moves, points + ways[k], points)
        R, p = poses.at(k)
        seen = sensors.view(R, p, places, options.seen_m, camera, options.depths, extrinsic)
        landmarks = tracker.follow(seen.visible)
        id = tracker.ids(landmarks)
        measured, bad = sensors.measure(seen, landmarks, *by_chance)
        frames.append(np.full(len(landmarks), k, np.intp))
        ids.append(id)
        pixels.append(measured + drift.wander(landmarks, id, float(tau_s[k])))
        wrong.append(bad)
    id = np.concatenate(ids)
    frame = np.concatenate(frames)
    order = np.lexsort((id, frame))
    tracks = Tracks.from_rows(len(poses.p), frame, id, np.concatenate(pixels))
    tracks, whose = mishaps.freeze(t_ns, tracks)
    return tracks, np.concatenate(wrong)[order][whose]


def _header(options: Options) -> Header:
    """Returns the HEADER; zero noise becomes no suggestion."""
    suggested = {name: getattr(options, name, -1.0) for name in vars(Noise())}
    width, height = sensors.IMAGE_PX
    return Header(
        options.camera,
        sensors.T_CB.R,
        sensors.T_CB.p,
        body_axes=BodyAxes.FORWARD_LEFT_UP,
        twist_timing=options.twist_timing,
        image_width_px=width,
        image_height_px=height,
        noise=Noise(**{name: value if value > 0 else -1.0 for name, value in suggested.items()}),
        name=header_name(f"simulated, seed {options.seed}"),
    )


def _known(options: Options, points: Floats) -> list[Landmark]:
    if not options.known:
        return []
    variance = options.known_sigma_m * options.known_sigma_m
    covariance = variance * np.array([1.0, 0.0, 1.0, 0.0, 0.0, 1.0])
    return [Landmark(k, p, covariance) for k, p in enumerate(points)]
