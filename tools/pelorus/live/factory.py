# SPDX-License-Identifier: MIT
"""The calibration of an open camera: the user's files, else what the factory wrote into it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from pelorus.errors import PelorusError
from pelorus.live.camera import Asked
from pelorus.rig import read as rig_files
from pelorus.rig.read import Calibrated
from pelorus.rig.rig import Rig


def calibrated(
    asked: Asked, size: tuple[int, int], name: str, own: Callable[[], Rig]
) -> Calibrated:
    """Returns what holds for pictures of this size; `own` reads what the camera knows itself."""
    if asked.calibration:
        if rig_files.is_own(asked.calibration):
            return rig_files.read(asked.calibration, name, asked.extrinsic)
        rig = rig_files.read_rig(asked.calibration)
        if rig.sizes[0][0] and size not in rig.sizes:
            told = " or ".join(f"{width} x {height}" for width, height in rig.sizes)
            raise PelorusError(
                f"{asked.calibration[0]}: is of pictures of {told} px, the camera gives {size[0]} "
                f"x {size[1]}: --size, or the calibration of these"
            )
        return rig_files.of_rig(rig.of_size(*size), name, asked.extrinsic)
    return rig_files.of_rig(scaled(own(), size), name, asked.extrinsic)


def scaled(rig: Rig, size: tuple[int, int]) -> Rig:
    """Returns the rig of pictures of this size, which show what its own ones show."""
    if size in rig.sizes:
        return rig.of_size(*size)
    try:
        left, right = rig.left.scaled(*size), rig.right.scaled(*size)
    except ValueError as error:
        raise PelorusError(f"--size: {error}: a size of the same shape is expected") from error
    return replace(rig, left=left, right=right, others=())
