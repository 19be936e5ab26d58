# SPDX-License-Identifier: MIT
"""Simulates a drive with an IMU, from the path to the recording."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from pelorus.io.recording import Recording
from pelorus.math.inertial import Inertial
from pelorus.math.motion import Times
from pelorus.simulate import imu as sensor
from pelorus.simulate import smooth
from pelorus.simulate.drive import Drive, exp
from pelorus.simulate.imu import ImuFaults, Sensed, SimulatedImu, StartGiven
from pelorus.wire.frames import Noise, Process, Start, StartFlag
from pelorus.wire.layout import Floats, pack_symmetric


class ImuDrive(NamedTuple):
    """The options on which an IMU depends."""

    way: smooth.Way
    imu: SimulatedImu
    faults: ImuFaults
    bias_gyro_sigma_radps: float


class Chances(Protocol):
    """Random generators by name."""

    def __getitem__(self, name: str) -> np.random.Generator: ...


def drive_and_read(given: ImuDrive, t_ns: Times, chances: Chances) -> tuple[Drive, Sensed]:
    """Returns the motion at t_ns, and the readings over the same time."""
    own = given.imu.times(int(t_ns[-1]))
    times = np.union1d(t_ns, own)
    poses = smooth.poses(times, given.way)
    v, w = given.way.velocities(smooth.seconds(times))
    at, nodes = np.searchsorted(times, own), np.searchsorted(times, t_ns)
    a = smooth.specific_force(own, given.way, poses.R[at], given.imu.gravity_mps2)
    sensed = sensor.read(
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
        start=_later(_start(recording, given, chance), late_ns),
        truth_velocity=given.way.velocities(smooth.seconds(recording.truth_t_ns))[0],
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


def _start(recording: Recording, given: ImuDrive, chance: np.random.Generator) -> Start | None:
    """Returns the first pose, with errors of roll, pitch and velocity by their sigmas.

    Position and yaw are exact, for nothing can be learnt of them.
    """
    imu = given.imu
    if imu.start is StartGiven.NONE:
        return None
    R, p = recording.truth.at(0)
    v, _ = given.way.velocities(smooth.seconds(recording.truth_t_ns[:1]))
    wrong = imu.start_tilt_sigma_rad * chance.standard_normal(3)
    wrong[2] = 0.0
    faulty = v[0] + imu.start_velocity_sigma_mps * chance.standard_normal(3)
    tilt = np.eye(3) - np.outer(R[2], R[2])
    covariance: Floats = np.zeros((6, 6))
    covariance[3:, 3:] = imu.start_tilt_sigma_rad**2 * tilt
    start = Start(
        int(recording.truth_t_ns[0]),
        _turned(wrong) @ R,
        p,
        StartFlag.COVARIANCE,
        pack_symmetric(covariance),
    )
    if imu.start is StartGiven.POSE:
        return start
    variance = np.full(3, imu.start_velocity_sigma_mps**2)
    return replace(start, velocity=faulty, velocity_variance=variance)


def _later(start: Start | None, by_ns: int) -> Start | None:
    return None if start is None else replace(start, t_ns=start.t_ns + by_ns)


def _turned(small: Floats) -> Floats:
    """Returns Exp of a small rotation of the world."""
    R: Floats = exp(np.zeros((1, 3)), small[None]).R[0]
    return R
