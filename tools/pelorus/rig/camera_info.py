# SPDX-License-Identifier: MIT
"""ROS's camera_info of two cameras, as messages or as the YAML files of camera_calibration.

K and D are of the raw pictures; R turns a camera into the rectified one, P projects there, and the
fourth number of the right one's P is -fx times the baseline.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig.lens import COEFFICIENTS, Lens, LensModel, intrinsics_in
from pelorus.rig.rig import Rig
from pelorus.wire.layout import Floats

LENSES = {
    "plumb_bob": LensModel.RADTAN,
    "rational_polynomial": LensModel.RADTAN,
    "equidistant": LensModel.EQUIDISTANT,
    "fisheye": LensModel.EQUIDISTANT,
    "": LensModel.NONE,
}


class Info(NamedTuple):
    """One camera's calibration; `path` and `at` say where it is written."""

    path: Path
    at: str
    K: Floats
    D: Floats
    R: Floats
    P: Floats
    model: str
    width_px: int
    height_px: int

    def lens(self, rectified: bool) -> Lens:
        """Returns the lens of the raw pictures, or of rectified ones."""
        K, P, D = self.K, self.P, self.D
        if P[0, 0] <= 0 or K[0, 0] <= 0:
            raise ForeignFileError(
                self.path,
                "the camera is not calibrated: K or P is 0; --calibration is expected",
                at=self.at,
            )
        size = self.width_px, self.height_px
        if rectified:
            return Lens(LensModel.NONE, intrinsics_in(P), (), *size)
        model = LENSES.get(self.model, LensModel.NONE) if D.any() else LensModel.NONE
        if D.any() and (self.model not in LENSES or len(D) not in COEFFICIENTS[model]):
            raise ForeignFileError(
                self.path,
                f"distortion model {self.model!r} with {len(D)} numbers; "
                f"{' or '.join(filter(None, LENSES))} is expected",
                at=self.at,
            )
        coefficients = tuple(D.tolist()) if D.any() else ()
        return Lens(model, intrinsics_in(K), coefficients, *size)


@dataclass(frozen=True)
class Infos:
    """Both cameras' calibrations; `rectified` if the pictures are rectified already."""

    left: Info
    right: Info
    rectified: bool

    @property
    def have_baseline(self) -> bool:
        return bool(self.left.P[0, 3] != self.right.P[0, 3])

    def rig(self, T_RL: Poses | None = None) -> Rig:
        """Returns the rig; `T_RL` is of the raw cameras, where P has no baseline."""
        left, right = self.left, self.right
        lenses = left.lens(self.rectified), right.lens(self.rectified)
        R_left, R_right = (
            Poses(se3.nearest_rotation(info.R) if info.R.any() else np.eye(3), np.zeros(3))
            for info in (left, right)
        )
        if T_RL is not None:
            outer = (R_right, se3.inverse(R_left)) if self.rectified else (se3.IDENTITY,) * 2
            T_RL = se3.compose(se3.compose(outer[0], T_RL), outer[1])
        else:
            shift_m = (right.P[0, 3] - left.P[0, 3]) / right.P[0, 0] if right.P[0, 0] else 0.0
            T_RL = Poses(np.eye(3), np.array([shift_m, 0.0, 0.0]))  # q_right = q_left + it
            if not self.rectified:
                T_RL = se3.compose(se3.compose(se3.inverse(R_right), T_RL), R_left)
        rig = Rig.of_cameras(right.path, *lenses, T_RL)
        if not self.rectified:
            return rig
        return replace(rig, T_LF=R_right if rig.swapped else R_left)


def is_camera_info(content: Named) -> bool:
    """Returns whether it is a file of camera_calibration."""
    return "camera_matrix" in content and "projection_matrix" in content


def read(content: Named) -> Info:
    """Reads one file."""
    return Info(
        content.path,
        content.at,
        content.matrix("camera_matrix", 3, 3),
        content.row("distortion_coefficients"),
        content.matrix("rectification_matrix", 3, 3),
        content.matrix("projection_matrix", 3, 4),
        str(content.content.get("distortion_model", "plumb_bob")),
        int(content.content.get("image_width", 0)),
        int(content.content.get("image_height", 0)),
    )


def pair(first: Named, second: Named, lens: LensModel | None) -> Rig:
    """Reads two files in any order; `lens` none means that the pictures are rectified already."""
    infos = Infos(read(first), read(second), lens is LensModel.NONE)
    if not infos.have_baseline:
        raise ForeignFileError(
            second.path,
            "the projection_matrix of neither camera has a baseline; files of a stereo calibration "
            "are expected: P[3] of the right one is -fx baseline",
        )
    return infos.rig()
