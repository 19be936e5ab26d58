# SPDX-License-Identifier: MIT
"""ROS' conventions (REP-103, REP-105) and the filter's, and the way between them.

The filter: T = T^ Exp(xi), xi = (rho, theta) in the body's axes, T the true pose.
ROS: a position error in the axes of the fixed frame, p = p^ + dp, and a rotation about the fixed
axes x, y, z, R = Exp(dr) R^; row by row x y z rotx roty rotz. To first order

    dp = R^ rho        dr = R^ theta

for Exp(R theta) R = R Exp(theta). A twist is in the body's axes in both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.online.odometry import turned
from pelorus.wire.layout import Floats
from scipy.spatial.transform import Rotation

LANDMARK = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("id", "<u4"),
     *((f"cov_{name}", "<f4") for name in ("xx", "xy", "xz", "yy", "yz", "zz"))]
)  # fmt: skip


def to_ros(R: Floats, P: Floats) -> Floats:
    """Returns the covariance about the fixed axes, of one of (rho, theta) at attitude R."""
    return turned(R, P)


def from_ros(R: Floats, C: Floats) -> Floats:
    """Returns the covariance of (rho, theta) at attitude R, of one about the fixed axes."""
    return turned(R.T, C)


def error_in_ros(truth: Poses, told: Poses) -> Floats:
    """Returns (dp, dr) (..., 6), by which the truth differs from what was told, as ROS means it."""
    turn = Rotation.from_matrix(truth.R @ np.swapaxes(told.R, -1, -2)).as_rotvec()
    return np.concatenate((truth.p - told.p, turn), axis=-1)


def quaternion(R: Floats) -> tuple[float, float, float, float]:
    """Returns x, y, z, w."""
    x, y, z, w = Rotation.from_matrix(R).as_quat().tolist()
    return x, y, z, w


def pose_of(position: tuple[float, ...], xyzw: tuple[float, ...]) -> Poses | None:
    """Returns the pose; None where that is none."""
    q, p = np.array(xyzw, float), np.array(position, float)
    if not (np.isfinite(p).all() and 0.9 < np.linalg.norm(q) < 1.1):
        return None
    return Poses(Rotation.from_quat(q).as_matrix(), p)


def landmark_rows(landmarks: NDArray[np.void], T_OW: Poses) -> NDArray[np.void]:
    """Returns the filter's landmarks in `odom`, (n,) of LANDMARK."""
    rows = np.zeros(len(landmarks), LANDMARK)
    p = se3.apply(T_OW, landmarks["p_W_m"].astype(np.float64))
    P = T_OW.R @ landmarks["P_W_m2"] @ T_OW.R.T
    for k, axis in enumerate("xyz"):
        rows[axis] = p[:, k]
    rows["id"] = landmarks["id"]
    for i in range(3):
        for j in range(i, 3):
            rows[f"cov_{'xyz'[i]}{'xyz'[j]}"] = P[:, i, j]
    return rows
