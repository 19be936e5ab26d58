# SPDX-License-Identifier: MIT
"""The whole simulated recording."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pelorus.console import progress
from pelorus.errors import PelorusError
from pelorus.frames import (
    OBSERVATIONS_MAX,
    BodyAxes,
    Camera,
    Header,
    Landmark,
    Noise,
    TwistTiming,
    header_name,
)
from pelorus.motion import Times
from pelorus.recording import Recording
from pelorus.se3 import Floats, Poses
from pelorus.simulation import scene, sensors
from pelorus.simulation.drive import TURN_MAX_RAD, Drive, drive, stood
from pelorus.simulation.mishaps import NO_MISHAPS, Drift, Flags, Mishaps
from pelorus.tracks import Indices, Tracks

FRAMES_MAX = 1_000_000
PEAK_TURN = 1.7  # the peak of the turn rate over its mean, and some roll and pitch


@dataclass(frozen=True)
class Options:
    """What can be chosen; the names are those of the command's options."""

    seed: int = 1
    duration_s: float = 60.0
    frame_rate_hz: float = 10.0
    twist_rate_hz: float = 100.0
    twist_timing: TwistTiming = TwistTiming.START
    speed_mps: float = 3.0
    lap_s: float = 40.0
    parked: bool = False
    landmarks: int = 800
    observations: int = 60
    range_m: float = 30.0
    min_depth_m: float = 0.0
    max_depth_m: float = 0.0
    baseline_m: float = scene.CAMERA.baseline_m
    keep_ids: bool = False
    known: bool = False
    known_sigma_m: float = 0.01
    loss: float = 0.01
    pixel_sigma_px: float = 1.0
    velocity_sigma_mps: float = 0.05
    gyro_sigma_radps: float = 0.01
    bias_velocity_sigma_mps: float = 0.05
    bias_gyro_sigma_radps: float = 0.005
    bias_velocity_walk: float = 0.0
    bias_gyro_walk: float = 0.0
    outliers: float = 0.02
    drop: float = 0.01
    camera_delay_s: float = 0.0
    mishaps: Mishaps = NO_MISHAPS

    def check(self) -> None:
        """Refuse what makes no sense, by the option's name."""
        for name in ("duration_s", "frame_rate_hz", "twist_rate_hz", "lap_s", "range_m"):
            self._require(name, getattr(self, name) > 0, "a positive number")
        self._require("baseline_m", self.baseline_m > 0, "a positive number")
        for name in ("loss", "outliers", "drop"):
            self._require(name, 0 <= getattr(self, name) < 1, "a fraction from 0 to below 1")
        for name in vars(self):
            number = getattr(self, name)
            if isinstance(number, float):
                self._require(name, 0 <= number < np.inf, "a finite number, not negative")
        self._require("landmarks", self.landmarks > 0, "at least 1")
        self._require("known_sigma_m", self.known_sigma_m > 0, "a positive number")
        self._require(
            "observations", 0 < self.observations <= OBSERVATIONS_MAX, f"1 to {OBSERVATIONS_MAX}"
        )
        deeper = not self.max_depth_m or self.max_depth_m > self.min_depth_m
        self._require("max_depth_m", deeper, "more than --min-depth")
        self.mishaps.check()
        self._require("seed", self.seed >= 0, "a whole number, not negative")
        ratio = self.twist_rate_hz / self.frame_rate_hz
        self._require(
            "twist_rate_hz", round(ratio) == ratio >= 1, "a whole multiple of the frame rate"
        )
        self._require("duration_s", self.frames <= FRAMES_MAX, f"at most {FRAMES_MAX} frames")
        turn = PEAK_TURN * 2 * np.pi / self.lap_s / self.twist_rate_hz
        self._require("lap_s", turn < TURN_MAX_RAD, f"at most {TURN_MAX_RAD} rad a twist")

    @property
    def depths(self) -> scene.Depths:
        return scene.Depths(self.min_depth_m, self.max_depth_m)

    @property
    def seen_m(self) -> float:
        """How far is seen: the depths that are asked for are not cut off."""
        deepest = self.depths.side_m[1] if self.depths.given else 0.0
        return max(self.range_m, 2 * deepest)

    @property
    def camera(self) -> Camera:
        """As the HEADER tells it."""
        return replace(scene.CAMERA, baseline_m=self.baseline_m)

    @property
    def frames(self) -> int:
        return int(self.duration_s * self.frame_rate_hz) + 1

    @property
    def twists_per_frame(self) -> int:
        return round(self.twist_rate_hz / self.frame_rate_hz)

    @property
    def lookahead_s(self) -> float:
        """So far beyond its end the drive must have landmarks, for there it looks."""
        return min(self.range_m / self.speed_mps, self.lap_s) if self.speed_mps else 0.0

    def _require(self, name: str, good: bool, due: str) -> None:
        if not good:
            option = name
            for unit in ("_s", "_hz", "_mps", "_radps", "_px", "_m"):
                option = option.removesuffix(unit)
            given = getattr(self, name)
            raise PelorusError(f"--{option.replace('_', '-')} is {given}: {due} is due")


class _Chances:
    """An independent stream for each source of chance: changing one option leaves the others."""

    def __init__(self, seed: int) -> None:
        names = ("scene", "tracker", "pixels", "outliers", "drops", "velocity", "gyro", "bias_v")
        self._names = (*names, "bias_w", "drift", "moving", "moving_ways")
        seeds = np.random.SeedSequence(seed).spawn(len(self._names))
        self._streams = [np.random.Generator(np.random.PCG64(s)) for s in seeds]

    def __getitem__(self, name: str) -> np.random.Generator:
        return self._streams[self._names.index(name)]


@dataclass(frozen=True)
class Simulation:
    """The recording, and what no robot would know."""

    recording: Recording
    points_W: Floats  # (landmarks, 3)
    bias_velocity_mps: Floats  # (twists, 3)
    bias_gyro_radps: Floats
    outlier: Flags  # of each observation


def simulate(options: Options) -> Simulation:
    """Drive, look, and measure."""
    options.check()
    chances = _Chances(options.seed)
    beyond = drive(
        _node_times(options, options.lookahead_s),
        options.twist_timing,
        options.speed_mps,
        options.lap_s,
    )
    points = scene.landmarks(beyond.poses, options.landmarks, chances["scene"], options.depths)
    t_ns = _node_times(options)
    way = stood(t_ns) if options.parked else beyond.until(len(t_ns))
    v, w, bias_v, bias_w = _readings(options, way, chances)
    at_frames = np.arange(options.frames) * options.twists_per_frame
    frame_t_ns = t_ns[at_frames]
    truth = options.mishaps.jumped(frame_t_ns, way.poses.at(at_frames))
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
        camera_delay_ns=round(options.camera_delay_s * 1e9),
        twist_delay_ns=round(options.mishaps.twist_delay_s * 1e9),
    )
    return Simulation(recording, points, bias_v, bias_w, outlier)


def blindness(recording: Recording) -> str:
    """What is to be told of frames in which nothing is seen; nothing if there are none."""
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
    options: Options, way: Drive, chances: _Chances
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


def _observe(
    options: Options, t_ns: Times, poses: Poses, points: Floats, chances: _Chances
) -> tuple[Tracks, Flags]:
    tracker = sensors.Tracker(
        options.landmarks,
        options.observations,
        options.loss,
        options.keep_ids or options.known,
        chances["tracker"],
    )
    eye = _Eye(options, t_ns, poses, points, chances)
    frames, ids, pixels, wrong = [], [], [], []
    for k in progress(range(len(t_ns)), "simulating", len(t_ns)):
        seen = eye.look(k)
        landmarks = tracker.follow(seen.visible)
        id = tracker.ids(landmarks)
        measured, bad = sensors.measure(
            seen,
            landmarks,
            options.pixel_sigma_px,
            options.outliers,
            chances["pixels"],
            chances["outliers"],
        )
        frames.append(np.full(len(landmarks), k, np.intp))
        ids.append(id)
        pixels.append(measured + eye.drift(k, landmarks, id))
        wrong.append(bad)
    id = np.concatenate(ids)
    frame = np.concatenate(frames)
    order = np.lexsort((id, frame))
    tracks = Tracks.from_rows(len(poses.p), frame, id, np.concatenate(pixels))
    tracks, whose = options.mishaps.freeze(t_ns, tracks)
    return tracks, np.concatenate(wrong)[order][whose]


class _Eye:
    """The true camera, and where the landmarks are meanwhile."""

    def __init__(
        self, options: Options, t_ns: Times, poses: Poses, points: Floats, chances: _Chances
    ) -> None:
        mishaps = options.mishaps
        self._options = options
        self._camera = mishaps.true_camera(options.camera)
        self._poses = poses
        self._points = points
        moves = chances["moving"].random(len(points)) < mishaps.moving
        self._moves = moves[:, None]
        self._ways = mishaps.ways(t_ns, poses, chances["moving_ways"])
        self._drift = Drift(len(points), mishaps.track_drift, chances["drift"])
        self._tau_s = np.diff(t_ns, prepend=t_ns[:1]) * 1e-9

    def look(self, k: int) -> scene.View:
        options = self._options
        points = np.where(self._moves, self._points + self._ways[k], self._points)
        R, p = self._poses.at(k)
        return scene.view(R, p, points, options.seen_m, self._camera, options.depths)

    def drift(self, k: int, landmarks: Indices, ids: NDArray[np.int64]) -> Floats:
        return self._drift.wander(landmarks, ids, float(self._tau_s[k]))


def _header(options: Options) -> Header:
    """The noise as it is; what there is none of is no suggestion."""
    suggested = {name: getattr(options, name, -1.0) for name in vars(Noise())}
    width, height = scene.IMAGE_PX
    return Header(
        options.camera,
        scene.T_CB.R,
        scene.T_CB.p,
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
