# SPDX-License-Identifier: MIT
"""KITTI pose files: a row of 12 numbers, [R | p] row by row, left camera to world."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from pelorus import se3
from pelorus.errors import PelorusError
from pelorus.se3 import Poses


def read_poses(path: Path) -> Poses:
    """C_k, left camera k to world. Rotations are re-orthonormalised: the files hold 7 digits."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an empty file is our error, not numpy's warning
            rows = np.loadtxt(path, ndmin=2)
    except OSError as error:
        raise PelorusError(f"{path}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise PelorusError(f"{path}: is no pose file: {error}") from error
    if not rows.size:
        raise PelorusError(f"{path}: the file is empty")
    if rows.shape[1] != 12:
        raise PelorusError(f"{path}: rows of {rows.shape[1]} numbers, 12 are due ([R | p])")
    if not np.isfinite(rows).all():
        row = int(np.nonzero(~np.isfinite(rows).all(axis=1))[0][0])
        raise PelorusError(f"{path}: row {row + 1} holds a number that is not finite")
    matrices = rows.reshape(-1, 3, 4)
    R = matrices[:, :, :3]
    off = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    if off.max() > 1e-2:
        raise PelorusError(f"{path}: row {int(off.argmax()) + 1} holds no rotation")
    return Poses(se3.nearest_rotation(R), matrices[:, :, 3])


def body_poses(camera_poses: Poses, T_CB: Poses) -> Poses:
    """T_k = T_CB^-1 C_0^-1 C_k T_CB: the body's poses, the first one is the origin."""
    from_first = se3.compose(se3.inverse(camera_poses.at(0)), camera_poses)
    return se3.compose(se3.compose(se3.inverse(T_CB), from_first), T_CB)
