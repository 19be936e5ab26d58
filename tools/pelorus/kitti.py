# SPDX-License-Identifier: MIT
"""KITTI pose files: a row of 12 numbers, [R | p] row by row, left camera to world."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pelorus import foreign, se3
from pelorus.foreign import ForeignFileError
from pelorus.se3 import Poses

COLUMNS = 12


def read_poses(path: Path) -> Poses:
    """C_k, left camera k to world. Rotations are re-orthonormalised: the files hold 7 digits."""
    rows = foreign.rows(path)
    if len(rows[0].cells) != COLUMNS:
        raise ForeignFileError(
            path,
            f"has {len(rows[0].cells)} cells",
            at=f"line {rows[0].line}",
            due=f"{COLUMNS} numbers are due ([R | p])",
        )
    numbers = foreign.numbers(path, rows, COLUMNS)
    matrices = numbers.reshape(-1, 3, 4)
    R = matrices[:, :, :3]
    off = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    if off.max() > 1e-2:
        at = f"line {rows[int(off.argmax())].line}"
        raise ForeignFileError(path, "holds no rotation", at=at, due="[R | p] is due, row by row")
    return Poses(se3.nearest_rotation(R), matrices[:, :, 3])


def body_poses(camera_poses: Poses, T_CB: Poses) -> Poses:
    """T_k = T_CB^-1 C_0^-1 C_k T_CB: the body's poses, the first one is the origin."""
    from_first = se3.compose(se3.inverse(camera_poses.at(0)), camera_poses)
    return se3.compose(se3.compose(se3.inverse(T_CB), from_first), T_CB)
