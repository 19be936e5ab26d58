# SPDX-License-Identifier: MIT
"""Measures how well an IMU's readings fit the true motion, from each true pose to the next one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from pelorus.faults.finding import Finding
from pelorus.io.recording import Recording
from pelorus.math import inertial
from pelorus.math.inertial import Inertial, MotionState
from pelorus.math.motion import Times
from pelorus.wire.layout import Floats

MAD_TO_SIGMA = 1.4826  # of a normal distribution
FAITHFUL = 1.5  # ratio to the given noise, above which the readings do not fit


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


def compare(recording: Recording, truth: TrueMotion) -> Finding:
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
