# SPDX-License-Identifier: MIT
"""Covariances of positions as ellipsoids of three sigma."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from pelorus.wire.frames import Landmark, Pose
from pelorus.wire.layout import Floats, unpack_symmetric

SIGMAS = 3.0
POINT_M = 0.02  # half the size of a landmark without a useful ellipsoid


class Ellipsoids(NamedTuple):
    """Half axes (n, 3), m, and the rotation of the axes (n, 4), x y z w."""

    half_m: Floats
    turn: Floats


def ellipsoids(P: Floats) -> Ellipsoids:
    """Returns the ellipsoids of covariances (n, 3, 3); an invalid one becomes a point."""
    good = np.isfinite(P).all(axis=(1, 2), keepdims=True)
    variances, axes = np.linalg.eigh(np.where(good, P, 0.0))
    axes[np.linalg.det(axes) < 0, :, 0] *= -1
    half = SIGMAS * np.sqrt(np.clip(variances, 0, None))
    return Ellipsoids(
        half, scipy.spatial.transform.Rotation.from_matrix(axes).as_quat(canonical=True)
    )


def of_pose(pose: Pose) -> Ellipsoids | None:
    """Returns the position's ellipsoid, along the body's axes; None without a covariance."""
    if not pose.knows_covariance:
        return None
    return ellipsoids(unpack_symmetric(np.asarray(pose.covariance)[None], 6)[:, :3, :3])


def of_landmarks(landmarks: Sequence[Landmark], from_W_m: Floats) -> Ellipsoids:
    """Returns landmarks' ellipsoids along the world's axes.

    `from_W_m` (3,) or (n, 3) is where the body saw them from. An ellipsoid that reaches there is of
    no use, and becomes a point.
    """
    if not landmarks:
        return Ellipsoids(np.zeros((0, 3)), np.zeros((0, 4)))
    shapes = ellipsoids(unpack_symmetric(np.array([m.covariance for m in landmarks]), 3))
    distance = np.linalg.norm(np.array([m.p_W_m for m in landmarks]) - from_W_m, axis=1)
    vague = shapes.half_m.max(axis=1) > distance
    return shapes._replace(half_m=np.where(vague[:, None], POINT_M, shapes.half_m))
