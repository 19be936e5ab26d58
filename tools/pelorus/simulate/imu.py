# SPDX-License-Identifier: MIT
"""Simulates an IMU, its readings and its faults, and a drive with it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.io.recording import Recording
from pelorus.math.inertial import GRAVITY_MPS2, Inertial
from pelorus.math.motion import Times
from pelorus.simulate import drive, sensors, settings
from pelorus.simulate.drive import Drive, wave
from pelorus.simulate.settings import BELOW_ONE, FINITE, POSITIVE, Rule, Span, require, setting
from pelorus.wire.frames import IMU_READINGS_MAX, Noise, Process, Start, StartFlag
from pelorus.wire.layout import Floats, pack_symmetric

RATES = Rule(lambda x: x == 0 or 100 <= x <= 1000, "100 to 1000 Hz, or 0 for twists,")
SPIKE_MPS2, SPIKE_RADPS = 160.0, 35.0  # full scale of usual parts: 16 g, 2000 degrees a second
AXES = "xyz"
DEGREES = 57.29577951308232  # of a radian


class StartGiven(StrEnum):
    """What a START contains."""

    VELOCITY = "velocity"
    POSE = "pose"
    NONE = "none"


@dataclass(frozen=True)
class SimulatedImu:
    """An IMU instead of twists. Noises are as in Kalibr and data sheets."""

    imu_rate_hz: float = setting(
        0.0, "Write the readings of an IMU in place of twists; 0: twists.", "HZ", RATES
    )
    gyro_noise: float = setting(1e-3, "Density of the gyro's white noise.", "RAD/S/SQRT(HZ)")
    accel_noise: float = setting(
        1e-2, "Density of the accelerometer's white noise.", "M/S^2/SQRT(HZ)"
    )
    gyro_walk: float = setting(1e-4, "Random walk of the gyro's bias.", "RAD/S^2/SQRT(HZ)")
    accel_walk: float = setting(1e-3, "Random walk of the accelerometer's bias.", "M/S^3/SQRT(HZ)")
    bias_accel_sigma_mps2: float = setting(
        0.05,
        "The accelerometer's bias is drawn with it; the gyro's with --bias-gyro-sigma.",
        "M/S^2",
    )
    gravity_mps2: float = setting(GRAVITY_MPS2, "Gravity.", "M/S^2", POSITIVE)
    imu_batch: int = setting(
        IMU_READINGS_MAX,
        "Most readings of a message.",
        rule=Rule(lambda x: 1 <= x <= IMU_READINGS_MAX, f"1 to {IMU_READINGS_MAX}"),
    )
    rest_s: float = setting(0.0, "The body rests so long at first, and then sets off.", "S")
    start: StartGiven = setting(
        StartGiven.VELOCITY,
        "What START gives: pose and velocity; the pose, so that the filter aligns itself; or there "
        "is none, and the first TRUTH is the pose.",
        rule=None,
    )
    start_velocity_sigma_mps: float = setting(
        0.05, "A velocity that START gives is wrong by it, each axis.", "M/S", POSITIVE
    )
    start_tilt_sigma_rad: float = setting(
        0.005, "Roll and pitch that START gives are wrong by it.", "RAD", POSITIVE
    )

    @property
    def is_there(self) -> bool:
        return self.imu_rate_hz > 0

    def times(self, until_ns: int) -> Times:
        """Returns the times of its readings, up to the first one at or after the end."""
        period = 1e9 / self.imu_rate_hz
        count = int(np.ceil(until_ns / period)) + 1
        return np.round(np.arange(count) * period).astype(np.int64)


@dataclass(frozen=True)
class ImuFaults:
    """Faults of an IMU; by default there are none."""

    accel_vibration_mps2: float = setting(
        0.0, "A motor shakes the accelerometer, all axes, by this amplitude.", "M/S^2"
    )
    gyro_vibration_radps: float = setting(0.0, "And the gyro by this one.", "RAD/S")
    vibration_rate_hz: float = setting(87.0, "How often a second.", "HZ", POSITIVE)
    accel_range_mps2: float = setting(0.0, "Readings beyond it stay at it; 0: none are.", "M/S^2")
    gyro_range_radps: float = setting(0.0, "The same of the gyro.", "RAD/S")
    imu_clock_percent: float = setting(
        0.0,
        "The IMU's clock goes so much too fast; negative: too slow.",
        "PERCENT",
        settings.PERCENT,
    )
    camera_offset_s: float = setting(
        0.0, "Frames are stamped so much too early: IMU time = camera time + this.", "S", FINITE
    )
    imu_delay_s: float = setting(
        0.0, "Readings stand so much later in the file than their time.", "S"
    )
    imu_frozen: Span | None = setting(None, "From then on the IMU repeats its last reading.")
    imu_missing: Span | None = setting(None, "From then on there are no readings.")
    imu_drop: float = setting(0.0, "Share of the readings that are lost.", "SHARE", BELOW_ONE)
    imu_spikes: float = setting(
        0.0, "Share of the readings of which one number is anything.", "SHARE", BELOW_ONE
    )
    imu_nan: float = setting(
        0.0, "Share of the readings of which one number is none (NaN).", "SHARE", BELOW_ONE
    )
    accel_in_g: bool = setting(False, "The accelerometer reads in g, not in m/s^2.")
    gyro_in_degrees: bool = setting(False, "The gyro reads in degrees a second.")
    gravity_flipped: bool = setting(
        False, "At rest the accelerometer reads gravity downwards, with the wrong sign."
    )
    imu_axes: str = setting(
        "x,y,z", "What stands where x, y and z should, for example y,-x,z.", "X,Y,Z", None
    )

    def check(self, imu: SimulatedImu) -> None:
        """Refuses contradictory options, by the option's name."""
        settings.check(self)
        for part in (imu, self):
            given = next((f.name for f in fields(part) if getattr(part, f.name) != f.default), "")
            good = imu.is_there or not given
            require(given, getattr(part, given, None), good, "--imu-rate beside it")
        parts = [part.strip() for part in self.imu_axes.split(",")]
        sound = sorted(part.removeprefix("-") for part in parts) == list(AXES)
        expected = "x, y and z in some order, with or without -, parted by commas,"
        require("imu_axes", self.imu_axes, sound, expected)

    @property
    def mounting(self) -> Floats:
        """Returns (3, 3) that maps the true axes to the reported x, y, z."""
        out = np.zeros((3, 3))
        for row, part in enumerate(part.strip() for part in self.imu_axes.split(",")):
            out[row, AXES.index(part[-1])] = -1.0 if part.startswith("-") else 1.0
        return out


NO_IMU = SimulatedImu()
NO_FAULTS = ImuFaults()


class Sensed(NamedTuple):
    """The readings as reported, and the true biases at all of the IMU's times."""

    readings: Inertial
    true: Inertial  # at all of the IMU's times, without noise and bias
    bias_accel: Floats
    bias_gyro: Floats


def read(
    imu: SimulatedImu,
    faults: ImuFaults,
    bias_gyro_sigma: float,
    true: Inertial,
    chance: np.random.Generator,
    bad: np.random.Generator,
) -> Sensed:
    """Returns the readings of the true motion at the IMU's times: noise and biases, then faults."""
    tau = np.diff(true.t_ns) * 1e-9
    count = len(true.t_ns)
    b_a = sensors.biases(imu.bias_accel_sigma_mps2, imu.accel_walk * imu.accel_walk, tau, chance)
    b_g = sensors.biases(bias_gyro_sigma, imu.gyro_walk * imu.gyro_walk, tau, chance)
    per_reading = np.sqrt(imu.imu_rate_hz)
    a = true.a_B_mps2 + b_a + sensors.white(imu.accel_noise * per_reading, count, chance)
    w = true.w_B_radps + b_g + sensors.white(imu.gyro_noise * per_reading, count, chance)
    told = _with_faults(faults, Inertial(true.t_ns, a, w), bad)
    return Sensed(told, true, b_a, b_g)


def _with_faults(faults: ImuFaults, readings: Inertial, bad: np.random.Generator) -> Inertial:
    t_ns, a, w = readings
    shaken = wave(t_ns[:, None] * 1e-9 * faults.vibration_rate_hz + np.array([0.0, 0.3, 0.7]))
    a, w = a + faults.accel_vibration_mps2 * shaken, w + faults.gyro_vibration_radps * shaken
    a, w = _spiking(faults.imu_spikes, a, w, bad)
    a, w = _clipped(a, faults.accel_range_mps2), _clipped(w, faults.gyro_range_radps)
    if faults.imu_frozen is not None:
        stuck = np.nonzero(faults.imu_frozen.holds(t_ns))[0]
        a[stuck], w[stuck] = a[max(stuck[0] - 1, 0)], w[max(stuck[0] - 1, 0)]
    a = a * (1 / GRAVITY_MPS2 if faults.accel_in_g else 1.0)
    a = -a if faults.gravity_flipped else a
    w = w * (DEGREES if faults.gyro_in_degrees else 1.0)
    mounted = faults.mounting.T
    a, w = _no_numbers(faults.imu_nan, a @ mounted, w @ mounted, bad)
    clock = 1 + faults.imu_clock_percent / 100
    told = Inertial(np.round(t_ns * clock).astype(np.int64), a, w)
    kept = bad.random(len(t_ns)) >= faults.imu_drop
    if faults.imu_missing is not None:
        kept &= ~faults.imu_missing.holds(t_ns)
    return told.at(kept)


def _clipped(x: Floats, most: float) -> Floats:
    return np.clip(x, -most, most) if most else x


def _spiking(share: float, a: Floats, w: Floats, bad: np.random.Generator) -> tuple[Floats, Floats]:
    hit, which = _one_number(share, len(a), bad)
    full = np.where(which < 3, SPIKE_MPS2, SPIKE_RADPS) * bad.uniform(-1.0, 1.0, len(a))
    return _replaced(a, w, hit, which, full)


def _no_numbers(
    share: float, a: Floats, w: Floats, bad: np.random.Generator
) -> tuple[Floats, Floats]:
    hit, which = _one_number(share, len(a), bad)
    return _replaced(a, w, hit, which, np.full(len(a), np.nan))


def _one_number(
    share: float, count: int, bad: np.random.Generator
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Returns which readings are hit, and which of their six numbers."""
    return bad.random(count) < share, bad.integers(0, 6, count)


def _replaced(
    a: Floats, w: Floats, hit: NDArray[np.bool_], which: NDArray[np.int64], by: Floats
) -> tuple[Floats, Floats]:
    rows = np.hstack((a, w))
    rows[hit, which[hit]] = by[hit]
    return rows[:, :3], rows[:, 3:]


# --- a drive with it ------------------------------------------------------------------------------


class ImuDrive(NamedTuple):
    """The options on which an IMU depends."""

    way: drive.Way
    imu: SimulatedImu
    faults: ImuFaults
    bias_gyro_sigma_radps: float


def drive_and_read(given: ImuDrive, t_ns: Times, chances: sensors.Chances) -> tuple[Drive, Sensed]:
    """Returns the motion at t_ns, and the readings over the same time."""
    own = given.imu.times(int(t_ns[-1]))
    times = np.union1d(t_ns, own)
    poses = drive.way_poses(times, given.way)
    v, w = given.way.velocities(drive.seconds(times))
    at, nodes = np.searchsorted(times, own), np.searchsorted(times, t_ns)
    a = drive.specific_force(own, given.way, poses.R[at], given.imu.gravity_mps2)
    sensed = read(
        given.imu,
        given.faults,
        given.bias_gyro_sigma_radps,
        Inertial(own, a, w[at]),
        chances["imu"],
        chances["imu_faults"],
    )
    return Drive(t_ns, v[nodes], w[nodes], poses.at(nodes)), sensed


def driven(
    recording: Recording, given: ImuDrive, sensed: Sensed, chance: np.random.Generator
) -> Recording:
    """Returns the recording with an IMU's readings instead of twists."""
    none: Floats = np.empty((0, 3))
    ahead_ns = round(given.faults.camera_offset_s * 1e9)
    late_ns = max(ahead_ns, 0)  # of all but the frames, for no time may be negative
    recording = replace(
        recording,
        twist_t_ns=np.empty(0, np.int64),
        v_B_mps=none,
        w_B_radps=none,
        frame_t_ns=recording.frame_t_ns + late_ns - ahead_ns,
        truth_t_ns=recording.truth_t_ns + late_ns,
        readings=[replace(m, t_ns=m.t_ns + late_ns) for m in recording.readings],
        inertial=sensed.readings._replace(t_ns=sensed.readings.t_ns + late_ns),
        imu_batch=given.imu.imu_batch,
        twist_delay_ns=round(given.faults.imu_delay_s * 1e9),
        start=_start(recording, given, chance, late_ns),
        truth_velocity=given.way.velocities(drive.seconds(recording.truth_t_ns))[0],
        truth_bias=_biases(sensed, recording.truth_t_ns),
    )
    noise = recording.header.noise
    return recording.with_header(process=Process.IMU, noise=_noise(noise, given))


def _biases(sensed: Sensed, t_ns: Times) -> Floats:
    """Returns (n, 6) biases at these times, in the order of START."""
    own = sensed.true._replace(a_B_mps2=sensed.bias_accel, w_B_radps=sensed.bias_gyro)
    return np.hstack(own.between(t_ns)[1:])


def _noise(noise: Noise, given: ImuDrive) -> Noise:
    """Returns the noise; zero noise becomes no suggestion."""
    imu = given.imu
    told = {
        "gyro_noise": imu.gyro_noise,
        "accel_noise": imu.accel_noise,
        "gyro_walk": imu.gyro_walk,
        "accel_walk": imu.accel_walk,
        "bias_accel_sigma": imu.bias_accel_sigma_mps2,
    }
    kept = {
        name: value
        for name, value in vars(noise).items()
        if name in ("pixel_sigma_px", "bias_gyro_sigma_radps")
    }
    suggested = {name: value if value > 0 else -1.0 for name, value in told.items()}
    return Noise(**kept, **suggested, gravity=imu.gravity_mps2)


def _start(
    recording: Recording, given: ImuDrive, chance: np.random.Generator, late_ns: int
) -> Start | None:
    """Returns the first pose, with errors of roll, pitch and velocity by their sigmas.

    Position and yaw are exact, for nothing can be learnt of them.
    """
    imu = given.imu
    if imu.start is StartGiven.NONE:
        return None
    R, p = recording.truth.at(0)
    v, _ = given.way.velocities(drive.seconds(recording.truth_t_ns[:1]))
    wrong = imu.start_tilt_sigma_rad * chance.standard_normal(3)
    wrong[2] = 0.0
    faulty = v[0] + imu.start_velocity_sigma_mps * chance.standard_normal(3)
    tilt = np.eye(3) - np.outer(R[2], R[2])
    covariance: Floats = np.zeros((6, 6))
    covariance[3:, 3:] = imu.start_tilt_sigma_rad**2 * tilt
    start = Start(
        int(recording.truth_t_ns[0]) + late_ns,
        drive.exp(np.zeros((1, 3)), wrong[None]).R[0] @ R,
        p,
        StartFlag.COVARIANCE,
        pack_symmetric(covariance),
    )
    if imu.start is StartGiven.POSE:
        return start
    variance = np.full(3, imu.start_velocity_sigma_mps**2)
    return replace(start, velocity=faulty, velocity_variance=variance)
