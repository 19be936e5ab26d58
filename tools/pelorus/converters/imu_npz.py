# SPDX-License-Identifier: MIT
"""Raw IMU with stereo tracks in one .npz, with the truth.

`imu_t` (n) s and `imu` (n, 6), gyro rad/s, then specific force m/s^2, in body axes, which are the
IMU's; `stereo_t`, `stereo_id`, `stereo_px` (m, 4) uL vL uR vR, a row an observation;
`truth_t`, `truth` (k, 10): quaternion x y z w, body to world, position, velocity in the world;
`bias_t`, `bias` (k, 6), gyro and accelerometer; `init` (17): t, quaternion, position, velocity,
biases; `calib`: JSON with fx fy cx cy, width height, baseline_m, T_imu_cam0 (p_imu = R p_cam + t),
gravity_world, pixel_sigma and the noises of the IMU.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from pelorus.converters import renewal
from pelorus.errors import PelorusError
from pelorus.faults.finding import Finding
from pelorus.faults.mend import findings_of
from pelorus.io import arrays, foreign
from pelorus.io.arrays import Arrays
from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math import inertial, se3
from pelorus.math.axes import body_axes
from pelorus.math.inertial import Inertial, MotionState
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.rig.lens import intrinsics
from pelorus.wire.frames import (
    Header,
    Noise,
    Process,
    Start,
    StartFlag,
    TwistTiming,
    header_name,
)
from pelorus.wire.layout import Floats, pack_symmetric

QUATERNION_NORM_TOLERANCE = 1e-3
MAD_TO_SIGMA = 1.4826  # of a normal distribution
FAITHFUL = 1.5  # ratio to the given noise, above which the readings do not fit
ALIGNED_M = 1e-4  # tolerance of the right camera's place in the left one: (baseline, 0, 0)
GRAVITY_TILT = 1e-6
SAME_TIME_NS = 1000  # largest distance of a start from its reading


class TrueMotion(NamedTuple):
    """Poses, velocity in body axes and biases, (k, 3) each, at some times."""

    t_ns: Times
    R: Floats
    p: Floats
    v_B: Floats
    bias_accel: Floats
    bias_gyro: Floats

    def at(self, index: slice) -> TrueMotion:
        vectors = (part[index] for part in self[1:])
        return TrueMotion(self.t_ns[index], *vectors)


class StartSigmas(NamedTuple):
    """The sigmas of the state of `init`, which a simulator writes exactly, to many digits.

    The biases walk: a prior narrower than their walk of a minute would soon be reported as wrong.
    """

    position_m: float = 1e-4
    rotation_rad: float = 1e-4
    velocity_mps: float = 1e-3
    bias_accel_mps2: float = 2e-2
    bias_gyro_radps: float = 1e-3


START_SIGMAS = StartSigmas()


def start_sigmas(words: str) -> StartSigmas:
    """Parses the option's sigmas."""
    try:
        numbers = [float(word) for word in words.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != len(StartSigmas._fields) or not all(0 < x < np.inf for x in numbers):
        expected = f"{len(StartSigmas._fields)} positive numbers parted by commas are expected"
        raise PelorusError(f"--start-sigmas is {words!r}: {expected}")
    return StartSigmas(*numbers)


@dataclass(frozen=True)
class Choices:
    """The options of the conversion."""

    keep_ids: bool = False
    seed: int | None = None
    extra_sigma_px: float = 0.0
    start: StartSigmas = START_SIGMAS


def convert(source: Path, choices: Choices) -> tuple[Recording, list[Finding]]:
    """Returns the recording, how its readings fit its truth, and its named faults."""
    recording, truth = read(source, choices.start)
    findings = [_compare(recording, truth)]
    chance = np.random.Generator(np.random.PCG64(choices.seed or 0))
    if choices.seed is not None:
        recording, finding = renewal.renew(source, recording, chance)
        findings.append(finding)
    if choices.extra_sigma_px:
        recording = renewal.with_noise(recording, choices.extra_sigma_px, chance)
    if not choices.keep_ids:
        tracks = recording.tracks
        shuffle = None if choices.seed is None else chance
        recording = replace(recording, tracks=renewal.with_new_ids(tracks, shuffle))
    return recording, [*findings, *findings_of(recording)]


def read(source: Path, start: StartSigmas = START_SIGMAS) -> tuple[Recording, TrueMotion]:
    """Reads the file as it is, and its true motion."""
    file = arrays.read_npz(source)
    calib = _Calib(source, foreign.json_words(source, file.words("calib")), "calib")
    readings = _readings(file)
    init = file.get("init", shape=(17,))
    begin_ns = _start_time(source, float(init[0]), readings.t_ns)
    frame_t_ns, tracks = _tracks(file)
    truth = _truth(file)
    inside = (frame_t_ns >= begin_ns) & (frame_t_ns <= readings.t_ns[-1])
    if not inside.any():
        raise ForeignFileError(
            source,
            f"no frame lies between the start of init ({begin_ns * 1e-9:.6f} s) and the last "
            f"reading ({readings.t_ns[-1] * 1e-9:.6f} s)",
        )
    frame_t_ns, tracks = frame_t_ns[inside], _only(tracks, inside)
    tracks.check(source)
    recording = Recording(
        calib.header(source.stem),
        np.empty(0, np.int64),
        np.empty((0, 3)),
        np.empty((0, 3)),
        frame_t_ns,
        tracks,
        truth.t_ns,
        Poses(truth.R, truth.p),
        truth.v_B,
        np.hstack((truth.bias_accel, truth.bias_gyro)),
        inertial=readings.at(readings.t_ns >= begin_ns),
        start=_start(source, begin_ns, init, start),
    )
    return recording, truth


# --- how well the readings fit the truth ----------------------------------------------------------


def _compare(recording: Recording, truth: TrueMotion) -> Finding:
    """Compares the readings with the truth: white noise changes a velocity by density sqrt(tau)."""
    readings, noise = recording.inertial, recording.header.noise
    first, last = np.searchsorted(truth.t_ns, (readings.t_ns[0], readings.t_ns[-1] + 1))
    truth = truth.at(slice(int(first), int(last)))
    before, after = truth.at(slice(None, -1)), truth.at(slice(1, None))
    if not len(after.t_ns):
        return Finding("noise of the readings", False, "no two true poses", "", is_conclusive=False)
    start = MotionState(before.R, before.p, before.v_B)
    ends = inertial.coasted(
        _without_bias(readings, truth), before.t_ns, after.t_ns, start, noise.gravity
    )
    tau = (after.t_ns - before.t_ns) * 1e-9
    turn = scipy.spatial.transform.Rotation.from_matrix(
        np.swapaxes(ends.R, 1, 2) @ after.R
    ).as_rotvec()
    return _judge(
        _sigma(turn / np.sqrt(tau)[:, None]) / noise.gyro_noise,
        _sigma((after.v_B - ends.v_B) / np.sqrt(tau)[:, None]) / noise.accel_noise,
        noise.gyro_noise,
        noise.accel_noise,
    )


def _without_bias(readings: Inertial, truth: TrueMotion) -> Inertial:
    bias = Inertial(truth.t_ns, truth.bias_accel, truth.bias_gyro).between(readings.t_ns)
    return Inertial(
        readings.t_ns,
        readings.a_B_mps2 - bias.a_B_mps2,
        readings.w_B_radps - bias.w_B_radps,
    )


def _sigma(differences: Floats) -> float:
    """Returns the sigma of an axis about its median, so that a small bias does not count."""
    middle = np.median(differences, axis=0)
    return float(
        np.sqrt(np.mean((MAD_TO_SIGMA * np.median(abs(differences - middle), axis=0)) ** 2))
    )


def _judge(gyro: float, accel: float, gyro_noise: float, accel_noise: float) -> Finding:
    found = max(gyro, accel) > FAITHFUL
    return Finding(
        "noise of the readings",
        found,
        f"from one true pose to the next the gyro is off by {gyro:.2f} and the accelerometer by "
        f"{accel:.2f} times what calib tells",
        "the HEADER has what calib tells; the filter adds what the readings scatter, and no more: "
        f"if it says TWIST_CONTRADICTED, --set gyro-noise={gyro * gyro_noise:.2g} "
        f"accel-noise={accel * accel_noise:.2g} or more (tools/config/imu-*.conf)"
        if found
        else "none: the HEADER has what calib tells",
    )


# --- arrays ---------------------------------------------------------------------------------------


def _times(file: Arrays, key: str) -> Times:
    return arrays.nanoseconds(file.path, key, file.get(key, shape=(None,)))


def _readings(file: Arrays) -> Inertial:
    t_ns = _times(file, "imu_t")
    numbers = file.get("imu", shape=(len(t_ns), 6))
    return Inertial(t_ns, numbers[:, 3:], numbers[:, :3])


def _tracks(file: Arrays) -> tuple[Times, Tracks]:
    """Returns the tracks, whose rows of one time are a frame."""
    path = file.path
    seconds = file.get("stereo_t", shape=(None,))
    count = len(seconds)
    if not count:
        raise ForeignFileError(path, "holds no observation at all")
    arrays.check_seconds(path, "stereo_t", seconds)
    back = np.nonzero(np.diff(seconds) < 0)[0]
    if len(back):
        raise ForeignFileError(
            path, "stereo_t goes back; rows in order of time are expected", at=f"row {back[0] + 1}"
        )
    id = file.get("stereo_id", shape=(count,))
    whole = (id == np.floor(id)) & (id >= 0) & (id < 2.0**32)
    if not whole.all():
        row = int(np.argmin(whole))
        raise ForeignFileError(
            path,
            f"stereo_id is {id[row]:g}; a whole number below 2^32 is expected",
            at=f"row {row}",
        )
    t_ns, frame = np.unique(np.round(seconds * 1e9).astype(np.int64), return_inverse=True)
    tracks = Tracks.from_rows(
        len(t_ns), frame, id.astype(np.int64), file.get("stereo_px", shape=(count, 4))
    )
    if (k := tracks.twice()) is not None:
        seconds_of = t_ns[tracks.frame[k]] * 1e-9
        raise ForeignFileError(
            path, f"id {tracks.id[k]} stands twice in the frame of {seconds_of:.6f} s"
        )
    return t_ns, tracks


def _only(tracks: Tracks, frames: NDArray[np.bool_]) -> Tracks:
    """Returns the tracks of these frames, renumbered."""
    rows = frames[tracks.frame]
    number = np.cumsum(frames) - 1
    return replace(tracks, frame_count=int(frames.sum()), frame=number[tracks.frame]).at(rows)


def _truth(file: Arrays) -> TrueMotion:
    t_ns = _times(file, "truth_t")
    numbers = file.get("truth", shape=(len(t_ns), 10))
    R = _rotations(file.path, "truth", numbers[:, :4])
    v_B = np.einsum("nji,nj->ni", R, numbers[:, 7:])
    bias_t_ns = _times(file, "bias_t")
    bias = file.get("bias", shape=(len(bias_t_ns), 6))
    own = Inertial(bias_t_ns, bias[:, 3:], bias[:, :3]).between(t_ns)
    return TrueMotion(t_ns, R, numbers[:, 4:7], v_B, own.a_B_mps2, own.w_B_radps)


def _rotations(path: Path, key: str, quaternions: Floats) -> Floats:
    """Returns the rotations of quaternions x y z w, body to world."""
    norms = np.linalg.norm(quaternions, axis=1)
    wrong = np.nonzero(np.abs(norms - 1) > QUATERNION_NORM_TOLERANCE)[0]
    if len(wrong):
        row = int(wrong[0])
        raise ForeignFileError(
            path,
            f"the quaternion's norm is {norms[row]:.4f}; 1 is expected, in the order x y z w",
            at=f"{key} row {row}",
        )
    return Poses.of_quaternions(quaternions, np.zeros(3)).R


# --- the start ------------------------------------------------------------------------------------


def _start_time(path: Path, seconds: float, t_ns: Times) -> int:
    """Returns the time of `init`, or that of the reading at its rounded time."""
    arrays.check_seconds(path, "init[0]", np.array([seconds]))
    told = round(seconds * 1e9)
    nearest = int(t_ns[np.abs(t_ns - told).argmin()])
    if not t_ns[0] - SAME_TIME_NS <= told < t_ns[-1]:
        raise ForeignFileError(
            path,
            f"init is of {seconds:.6f} s, the readings of {t_ns[0] * 1e-9:.6f} to "
            f"{t_ns[-1] * 1e-9:.6f} s; a state within them is expected",
        )
    return nearest if abs(nearest - told) <= SAME_TIME_NS else told


def _start(path: Path, t_ns: int, init: Floats, sigmas: StartSigmas) -> Start:
    """Returns pose, velocity in body axes and biases (b_a, b_g), with their variances."""
    R = _rotations(path, "init", init[None, 1:5])[0]
    pose = np.repeat([sigmas.position_m, sigmas.rotation_rad], 3)
    bias = np.repeat([sigmas.bias_accel_mps2, sigmas.bias_gyro_radps], 3)
    return Start(
        t_ns,
        R,
        init[5:8],
        StartFlag.COVARIANCE | StartFlag.BIAS_PRIOR,
        pack_symmetric(np.diag(pose**2)),
        np.concatenate((init[14:17], init[11:14])),
        bias**2,
        velocity=R.T @ init[8:11],
        velocity_variance=np.full(3, sigmas.velocity_mps**2),
    )


# --- calib ----------------------------------------------------------------------------------------

NOISES = {  # by name in a HEADER, the name in calib
    "pixel_sigma_px": "pixel_sigma",
    "gyro_noise": "gyro_noise_density",
    "accel_noise": "accel_noise_density",
    "gyro_walk": "gyro_random_walk",
    "accel_walk": "accel_random_walk",
}


class _Calib(Named):
    def header(self, name: str) -> Header:
        four, baseline = intrinsics(self, "fx", "fy", "cx", "cy"), self.number("baseline_m")
        T_CB = se3.inverse(self._extrinsic(baseline))
        if self.number("cam_imu_time_offset_s", 0.0):
            raise self._wrong("cam_imu_time_offset_s", "0 is expected: times on one clock")
        return Header(
            arrays.camera_of(self.path, *four, baseline),
            T_CB.R,
            T_CB.p,
            body_axes=body_axes(T_CB.R),
            twist_timing=TwistTiming.MID,
            image_width_px=int(self.number("width", 0.0)),
            image_height_px=int(self.number("height", 0.0)),
            noise=Noise(gravity=self._gravity(), **self._noises()),
            name=header_name(name),
            process=Process.IMU,
        )

    def _wrong(self, key: str, expected: str) -> ForeignFileError:
        return self.error(key, self.get(key), expected)

    def _pose(self, key: str) -> Poses:
        matrix = self.array(key, 4, 4)
        return Poses(arrays.rotation(self.path, f"calib: {key}", matrix[:3, :3]), matrix[:3, 3])

    def _extrinsic(self, baseline: float) -> Poses:
        """Returns T_CB of the left camera; the right one must make a rectified pair with it."""
        left = self._pose("T_imu_cam0")
        if "T_imu_cam1" in self.content:
            right = se3.compose(se3.inverse(left), self._pose("T_imu_cam1"))
            off = max(
                float(np.abs(right.R - np.eye(3)).max()),
                float(np.abs(right.p - [baseline, 0.0, 0.0]).max()),
            )
            if off > ALIGNED_M:
                raise self._wrong(
                    "T_imu_cam1",
                    f"that of a rectified pair is expected, baseline_m = {baseline:g} to the right "
                    "of T_imu_cam0",
                )
        return left

    def _gravity(self) -> float:
        """Returns gravity's size; it must point down the world's z."""
        g = self.array("gravity_world", 3)
        if not g[2] < 0 or np.abs(g[:2]).max() > GRAVITY_TILT:
            raise self._wrong(
                "gravity_world", "(0, 0, -9.81) or so is expected: z of the world is up"
            )
        return float(-g[2])

    def _noises(self) -> dict[str, float]:
        found = {name: self.number(key) for name, key in NOISES.items()}
        for name, sigma in found.items():
            if not sigma > 0:
                raise self._wrong(NOISES[name], "a positive number is expected")
        return found
