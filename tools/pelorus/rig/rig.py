# SPDX-License-Identifier: MIT
"""A stereo camera on a body, as calibrations of every kind describe it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from pelorus.errors import PelorusError
from pelorus.io import arrays
from pelorus.io.foreign import ForeignFileError
from pelorus.math import se3
from pelorus.math.axes import body_axes
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.rig.imu_model import ImuModel
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rectification import Rectification, Side
from pelorus.wire.frames import Camera, Header, header_name

SAME = 1e-9  # a smaller error counts as rectified


@dataclass(frozen=True)
class Rig:
    """Both cameras: q_R = T_RL q_L; q_L = T_LB s_B, None where the file has no body."""

    path: Path
    left: Lens
    right: Lens
    T_RL: Poses
    T_LB: Poses | None = None
    imu: ImuModel = field(default_factory=ImuModel)  # where the file has it
    offset_s: float = 0.0  # the body's clock = the cameras' + offset
    swapped: bool = False  # the file's second camera is the left one
    topics: tuple[str, ...] = ()  # of the left and the right camera, where the file names them
    T_LF: Poses = se3.IDENTITY  # from the frame in its messages, which rectification turns
    others: tuple[Rig, ...] = ()  # of the same cameras at other resolutions
    remarks: tuple[str, ...] = ()  # on the choice of cameras, where there are more than two

    @classmethod
    def of_cameras(
        cls,
        path: Path,
        first: Lens,
        second: Lens,
        T_21: Poses,
        T_1B: Poses | None = None,
        topics: Sequence[str] = (),
    ) -> Rig:
        """Returns the rig of two cameras; whichever stands on the left becomes the left one.

        `topics` are of the first and the second one.
        """
        arrays.require_baseline(path, float(np.linalg.norm(T_21.p)))
        x = -(T_21.R.T @ T_21.p)[0]
        if x > 0:
            return cls(path, first, second, T_21, T_1B, topics=tuple(topics))
        T_2B = None if T_1B is None else se3.compose(T_21, T_1B)
        ordered = tuple(reversed(topics))
        return cls(path, second, first, se3.inverse(T_21), T_2B, swapped=True, topics=ordered)

    def on_body(self, T_LB: Poses) -> Rig:
        return replace(self, T_LB=T_LB)

    def with_imu(self, imu: ImuModel, offset_s: float) -> Rig:
        return replace(self, imu=imu, offset_s=offset_s)

    @property
    def sizes(self) -> list[tuple[int, int]]:
        """Returns widths and heights of the pictures for which it was made; 0 where unknown."""
        return [(rig.left.width_px, rig.left.height_px) for rig in (self, *self.others)]

    def of_size(self, width_px: int, height_px: int) -> Rig:
        """Returns the rig for pictures of this size, else the first one."""
        size = width_px, height_px
        found = (self, *self.others)[self.sizes.index(size) if size in self.sizes else 0]
        left, right = found.left.sized(*size), found.right.sized(*size)
        return replace(self, left=left, right=right, T_RL=found.T_RL, others=())

    @property
    def is_rectified(self) -> bool:
        """Returns whether its pixels are those of a HEADER's camera without rectification."""
        T = self.T_RL
        apart = np.abs(T.R - np.eye(3)).max() + np.abs(T.p[1:]).max()
        plain = self.left.model is LensModel.NONE and self.right.model is LensModel.NONE
        return plain and self.left.intrinsics == self.right.intrinsics and bool(apart < SAME)

    def rectification(self) -> Rectification:
        """Returns the rectification, which is made once; raises ForeignFileError where there is
        none."""
        return self._rectification

    @cached_property
    def _rectification(self) -> Rectification:
        if self.is_rectified:
            baseline_m = float(np.linalg.norm(self.T_RL.p))
            sides = Side(self.left, np.eye(3)), Side(self.right, np.eye(3))
            size = self.left.width_px, self.left.height_px
            return Rectification(Camera(*self.left.intrinsics, baseline_m), *sides, *size)
        try:
            return Rectification.of(self.left, self.right, self.T_RL)
        except ValueError as error:
            raise ForeignFileError(self.path, str(error)) from None

    def header(self, rectification: Rectification, name: str) -> Header:
        """Returns the HEADER of the rectified camera; raises ForeignFileError without a body."""
        if self.T_LB is None:
            raise ForeignFileError(
                self.path,
                "does not say where the camera sits on the body; a file with T_cam_imu or "
                "T_imu_cam is expected (camchain-imucam), or --extrinsic FILE: JSON with R_CB and "
                "t_CB_m, or R_BC and t_BC_m",
            )
        R = rectification.left.R
        T_CB = Poses(R @ self.T_LB.R, R @ self.T_LB.p)
        return Header(
            rectification.camera,
            T_CB.R,
            T_CB.p,
            body_axes=body_axes(T_CB.R),
            image_width_px=rectification.width_px,
            image_height_px=rectification.height_px,
            name=header_name(name),
        )

    def on_body_clock(self, t_ns: Times) -> Times:
        """Returns pictures' times, given on the cameras' clock, on the body's."""
        shifted = t_ns + round(self.offset_s * 1e9)
        if len(shifted) and shifted[0] < 0:
            raise PelorusError(
                f"{self.path}: an offset of {self.offset_s} s brings the first picture before 0 s"
            )
        return shifted
