# SPDX-License-Identifier: MIT
"""Rectification of two cameras to the pair of a HEADER: same direction, side by side.

The new x axis is the baseline, z is half way between the two optical axes. Both have one focal
length, chosen so that the pictures have no empty edges, on which a tracker would find corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.math.se3 import Poses
from pelorus.program.extras import cv2
from pelorus.rig.lens import Lens
from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

Gray = NDArray[np.uint8]

SIDEWAYS_MIN = 0.5  # of the baseline, across the viewing direction
ANGLE_MAX_DEG = 70.0  # off the axis; beyond, one pixel of a fisheye becomes a dozen
ZOOM = (0.8, 2.0)  # ratio to the cameras' own focal length
ZOOM_STEPS = 49
EDGE_POINTS = 25  # of each side of a picture


class Side(NamedTuple):
    """One camera: its lens, and the rotation from it into the rectified camera."""

    lens: Lens
    R: Floats


@dataclass(frozen=True)
class Rectification:
    """The rectification; `camera` is that of the rectified pixels."""

    camera: Camera
    left: Side
    right: Side
    width_px: int
    height_px: int

    @classmethod
    def of(cls, left: Lens, right: Lens, T_RL: Poses) -> Rectification:
        """Rectifies a pair; raises ValueError unless the second camera stands on the right."""
        R_left = _towards(T_RL)
        sides = Side(left, R_left), Side(right, R_left @ T_RL.R.T)
        width, height = left.width_px, left.height_px
        baseline_m = float(np.linalg.norm(T_RL.p))
        own_px = float(np.mean([f for lens in (left, right) for f in lens.intrinsics[:2]]))
        found = None
        for zoom in np.linspace(*ZOOM, ZOOM_STEPS).tolist() if width else [1.0]:
            f = zoom * own_px
            camera = Camera(f, f, *_centre(sides, f), baseline_m)
            found = cls(camera, *sides, width, height)
            if not width or found._filled():
                break
        assert found is not None
        if not np.isfinite([found.camera.cx_px, found.camera.cy_px]).all():
            raise ValueError("no ray reaches the middle of the pictures; another lens is expected")
        return found

    def pixels(self, raw: Floats) -> Floats:
        """Rectifies (n, 4) raw pixels, uL vL uR vR; NaN where there is none."""
        return np.hstack(
            [
                self._project(_turned(side.lens.undistort(raw[:, columns]), side.R))
                for side, columns in ((self.left, slice(0, 2)), (self.right, slice(2, 4)))
            ]
        )

    def pictures(self, left: Gray, right: Gray) -> tuple[Gray, Gray]:
        """Returns the pair, resampled."""
        pair = [
            np.asarray(cv2.remap(picture, *maps, cv2.INTER_LINEAR), np.uint8)
            for picture, maps in zip((left, right), self._maps, strict=True)
        ]
        return pair[0], pair[1]

    @cached_property
    def _maps(self) -> list[tuple[NDArray[np.float32], NDArray[np.float32]]]:
        camera, size = self.camera, (self.width_px, self.height_px)
        four = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
        return [side.lens.maps(side.R, four, size) for side in (self.left, self.right)]

    def _project(self, directions: Floats) -> Floats:
        x, y, z = directions.T
        with np.errstate(invalid="ignore", divide="ignore"):
            u = self.camera.fx_px * x / z + self.camera.cx_px
            v = self.camera.fy_px * y / z + self.camera.cy_px
            cosine = z / np.linalg.norm(directions, axis=1)
            seen = cosine > np.cos(np.radians(ANGLE_MAX_DEG))
        return np.where(seen[:, None], np.stack((u, v), axis=-1), np.nan)

    def _source(self, side: Side, pixels: Floats) -> Floats:
        """Returns the raw pixels of rectified ones."""
        camera = self.camera
        rays = (pixels - [camera.cx_px, camera.cy_px]) / [camera.fx_px, camera.fy_px]
        x, y, z = _turned(rays, side.R.T).T
        return side.lens.distort(np.stack((x / z, y / z), axis=-1))

    def _filled(self) -> bool:
        """Returns whether the edges of both rectified pictures show something."""
        across = np.linspace(0, self.width_px - 1, EDGE_POINTS)
        down = np.linspace(0, self.height_px - 1, EDGE_POINTS)
        edges = [np.column_stack((across, np.full_like(across, v))) for v in (down[0], down[-1])]
        edges += [np.column_stack((np.full_like(down, u), down)) for u in (across[0], across[-1])]
        rim = np.concatenate(edges)
        most = [self.width_px - 1, self.height_px - 1]
        return all(
            bool(((at >= 0) & (at <= most)).all())
            for at in (self._source(side, rim) for side in (self.left, self.right))
        )


def _towards(T_RL: Poses) -> Floats:
    """Returns the rotation from the left camera into the rectified one."""
    at = -T_RL.R.T @ T_RL.p
    x = at / np.linalg.norm(at)
    view = np.array([0, 0, 1.0]) + T_RL.R[2]
    z = view / np.linalg.norm(view)
    if not x[0] > SIDEWAYS_MIN:
        raise ValueError(
            f"the second camera stands at ({at[0]:.3g}, {at[1]:.3g}, {at[2]:.3g}) m as the first "
            "one sees it (x right, y down, z ahead); cameras side by side are expected"
        )
    z -= x * (x @ z)
    z /= np.linalg.norm(z)
    return np.stack((x, np.cross(z, x), z))


def _turned(rays: Floats, R: Floats) -> Floats:
    return np.column_stack((rays, np.ones(len(rays)))) @ R.T


def _centre(sides: tuple[Side, Side], f: float) -> tuple[float, float]:
    """Returns the principal point that brings both pictures' centres to the middle, on average."""
    centres = []
    for lens, R in sides:
        middle = np.array(lens.intrinsics[2:])
        if lens.width_px:
            middle = np.array([(lens.width_px - 1) / 2, (lens.height_px - 1) / 2])
        x, y, z = _turned(lens.undistort(middle[None]), R)[0]
        centres.append(middle - [f * x / z, f * y / z])
    u, v = np.mean(centres, axis=0).tolist()
    return u, v
