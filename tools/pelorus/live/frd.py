# SPDX-License-Identifier: MIT
"""The estimate as MAVLink's ODOMETRY (331) has it: in MAV_FRAME_LOCAL_FRD and MAV_FRAME_BODY_FRD.

`odom` and the base are forward-left-up; M = diag(1, -1, -1) brings vectors of either into the
autopilot's axes, and rotations to M R M. LOCAL_FRD, not NED: x is where the base looked when it
began. The covariance is of (x, y, z, roll, pitch, yaw): with T = T^ Exp(rho, theta) to first order

    d(x, y, z) = R rho        d(roll, pitch, yaw) = E theta

E = [1, sr tp, cr tp; 0, cr, -sr; 0, sr/cp, cr/cp]; it has no meaning within 3 degrees of straight
up or down. port/mavlink/odometry.h is the same for firmware.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from pelorus.online.drive import UNKNOWN_COVARIANCE
from pelorus.online.odometry import Odom
from pelorus.wire.frames import UNKNOWN_VARIANCE
from pelorus.wire.layout import Floats

M = np.diag([1.0, -1.0, -1.0])
BOTH = np.kron(np.eye(2), M)
COS_PITCH_LEAST = 0.05
QUALITIES = {0: 100, 1: 50, 2: 1}  # percent, by health; -1 is failed
UPPER = np.triu_indices(6)
UNKNOWN = np.full(21, np.nan)


class Fields(NamedTuple):
    """Those of the message; covariances (21,) are upper triangles, row by row, the first number NaN
    where nothing is known."""

    time_usec: int
    p: Floats
    q_wxyz: Floats
    v: Floats
    w: Floats
    pose_covariance: Floats
    velocity_covariance: Floats
    reset_counter: int
    quality: int


def fields(odom: Odom) -> Fields:
    """Returns the message's fields."""
    R = M @ odom.T_OB.R @ M
    x, y, z, w = scipy.spatial.transform.Rotation.from_matrix(R).as_quat(canonical=True)
    velocity = BOTH @ odom.velocity
    return Fields(
        odom.t_ns // 1000,
        M @ odom.T_OB.p,
        np.array([w, x, y, z]),
        velocity[:3],
        velocity[3:],
        _pose_covariance(R, odom.covariance),
        _upper(BOTH @ odom.velocity_covariance @ BOTH),
        odom.reset_count % 256,
        QUALITIES.get(odom.estimate.health, -1),
    )


def euler_rates(R: Floats) -> Floats | None:
    """Returns E; None where roll and yaw cannot be told apart."""
    cp = float(np.hypot(R[2, 1], R[2, 2]))
    if cp <= COS_PITCH_LEAST:
        return None
    sr, cr, tp = R[2, 1] / cp, R[2, 2] / cp, -R[2, 0] / cp
    return np.array([[1, sr * tp, cr * tp], [0, cr, -sr], [0, sr / cp, cr / cp]])


def _pose_covariance(R: Floats, P: Floats) -> Floats:
    E = euler_rates(R)
    if E is None:
        return UNKNOWN
    J = np.zeros((6, 6))
    J[:3, :3], J[3:, 3:] = R, E
    return _upper(J @ BOTH @ P @ BOTH @ J.T)


def _upper(C: Floats) -> Floats:
    known = np.isfinite(C).all() and C[0, 0] < min(UNKNOWN_VARIANCE, UNKNOWN_COVARIANCE[0, 0])
    return C[UPPER] if known else UNKNOWN
