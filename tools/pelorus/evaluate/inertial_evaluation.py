# SPDX-License-Identifier: MIT
"""Compares each state of a filter with an IMU with the truth, where TRUTH has it.

Each NEES is a mean over frames and degrees of freedom, of e^T P^-1 e with the state's own block of
P; for the biases, which have only variances in a POSE, of e^2 / variance. 1 is expected for all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pelorus.math.consistency import Figures, mean, nees_per_dof, rms
from pelorus.math.motion import Times
from pelorus.wire.frames import Message, Pose, Truth, TruthKnows
from pelorus.wire.layout import Floats, unpack_symmetric

MEANING = {
    "nees_position": "mean NEES of the position, a degree of freedom: 1 is expected",
    "nees_rotation": "of the rotation",
    "nees_velocity": "of the velocity",
    "nees_bias_accel": "of the accelerometer's bias",
    "nees_bias_gyro": "of the gyro's bias",
    "velocity_rms_mps": "RMS velocity error",
    "counted_from_s": "since the first frame, when the world was laid: no frame before it counts",
}


def figures(
    messages: Sequence[Message], truths: Sequence[Message], t_ns: Times, error: Floats, P: Floats
) -> Figures:
    """Returns the figures of a result.

    `truths` contain the TRUTH; error and P are those of the poses at t_ns (n, 6).
    """
    poses = {m.t_ns: m for m in messages if isinstance(m, Pose) and m.after_stereo}
    found: Figures = dict.fromkeys(MEANING)
    found["counted_from_s"] = (int(t_ns[0]) - min(poses)) * 1e-9
    later = slice(1, None)  # the alignment makes the first error zero
    error, P = error[later], P[later]
    found["nees_position"] = mean(nees_per_dof(error[:, :3], P[:, :3, :3]))
    found["nees_rotation"] = mean(nees_per_dof(error[:, 3:], P[:, 3:, 3:]))
    known = {m.t_ns: m for m in truths if isinstance(m, Truth)}
    times = [t for t in t_ns[later].tolist() if t in known and poses[t].knows_covariance]
    return found | _velocity(times, poses, known) | _biases(times, poses, known)


def _velocity(times: list[int], poses: dict[int, Pose], known: dict[int, Truth]) -> Figures:
    times = [t for t in times if known[t].knows & TruthKnows.VELOCITY]
    if not times:
        return {}
    error = np.array([poses[t].v_B_mps - known[t].velocity for t in times])
    P = unpack_symmetric(np.array([poses[t].velocity_covariance for t in times]), 6)
    return {
        "nees_velocity": mean(nees_per_dof(error, P[:, :3, :3])),
        "velocity_rms_mps": rms(error),
    }


def _biases(times: list[int], poses: dict[int, Pose], known: dict[int, Truth]) -> Figures:
    times = [t for t in times if known[t].knows & TruthKnows.BIAS]
    times = [t for t in times if (np.asarray(poses[t].bias_variance) > 0).all()]
    if not times:
        return {}
    error = np.array([poses[t].bias - known[t].bias for t in times])
    nees = error**2 / np.array([poses[t].bias_variance for t in times])
    return {"nees_bias_accel": mean(nees[:, :3]), "nees_bias_gyro": mean(nees[:, 3:])}
