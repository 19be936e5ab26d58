# SPDX-License-Identifier: MIT
"""Detects velocities in axes that do not turn with the body, as some odometry drivers write them.

Such a velocity is R_k v_k with the body's attitude R_k. The pictures show v_k, and the rates of
turn give R_k up to a rotation R_0 at the start. The best R_0 competes with the given axes, turned
as fits best. On a straight way both are the same, and nothing is shown.
"""

from __future__ import annotations

import numpy as np

from pelorus.faults.fit import BLOCKS_LEAST
from pelorus.faults.handeye import mean_twists
from pelorus.faults.seen import BLOCKS, CameraMotion, standard_error
from pelorus.faults.twist_body import TwistBody
from pelorus.io.recording import Recording
from pelorus.math import se3
from pelorus.wire.layout import Floats

ROUNDS = 8
MOVES_SHARE = 0.1  # share of the usual speed by the pictures


def world_axes(recording: Recording, seen: CameraMotion) -> float:
    """Returns 2 ln of the likelihood ratio of world axes to body axes; 0 with too few data."""
    t_s = (recording.frame_t_ns - recording.twist_t_ns[0]) * 1e-9
    R = TwistBody(recording).at(0.5 * (t_s[1:] + t_s[:-1])).R
    told = mean_twists(recording)[:, :3]
    arm = -recording.T_CB.R.T @ recording.T_CB.p
    own = seen.rates[:, :3] - np.cross(seen.rates[:, 3:], arm)
    good = seen.usable & np.isfinite(told).all(axis=1)
    # wheels of a robot that is carried or lifted stand, and have no direction
    usual = float(np.median(np.linalg.norm(own[good], axis=1))) if good.any() else 0.0
    good &= np.linalg.norm(np.nan_to_num(told), axis=1) > MOVES_SHARE * usual
    if good.sum() < BLOCKS_LEAST * BLOCKS:
        return 0.0
    R, told, own = R[good], told[good], own[good]
    in_world = np.einsum("kij,kj->ki", R, own)
    given = told @ _turn(told, own).T
    other = np.einsum("kji,kj->ki", R, told @ _turn(told, in_world).T)
    apart, off = other - given, own - given
    size = np.sum((own - other) ** 2, axis=1)
    weight = 1 / (1 + size / (4 * np.median(size) + 1e-12))
    power = float(np.sum(weight * np.sum(apart**2, axis=1))) + 1e-12
    share = (
        float(np.sum(weight * np.sum(apart * off, axis=1))) / power
    )  # 0 as given, 1 in the world
    left = weight * np.sum(apart * (off - share * apart), axis=1)
    sigma = standard_error(left) / power
    return (2 * share - 1) / sigma**2


def _turn(a: Floats, b: Floats) -> Floats:
    """Returns the rotation that maps a to b, robustly."""
    R, weight = np.eye(3), np.ones(len(a))
    for _ in range(ROUNDS):
        R = se3.nearest_rotation((b * weight[:, None]).T @ a)
        left = np.sum((b - a @ R.T) ** 2, axis=1)
        weight = 1 / (1 + left / (np.median(left) + 1e-12)) ** 2
    return R
