# SPDX-License-Identifier: MIT
"""The scene: landmarks along the path, and the camera that sees them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.math.se3 import Poses
from pelorus.simulate.drive import rotate
from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

CAMERA = Camera(fx_px=420.0, fy_px=420.0, cx_px=320.0, cy_px=240.0, baseline_m=0.2)
IMAGE_PX = (640, 480)
R_CB = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # body forward-left-up
CAMERA_IN_BODY_M = np.array([1.0, 0.3, 0.6])  # of a car: turns move the camera sideways
T_CB = Poses(R_CB, -rotate(R_CB, CAMERA_IN_BODY_M))

DEPTH_MIN_M = 0.8
SIDE_M = (3.0, 15.0)  # distance of landmarks from the path, on either side
HEIGHT_M = (-1.0, 5.0)


class View(NamedTuple):
    """Landmarks in the left camera (m, 3) and in the images (m, 4), and which are visible."""

    q_C: Floats
    pixels: Floats
    visible: NDArray[np.bool_]


class Depths(NamedTuple):
    """Limits of the landmarks' depth; 0: as camera and range allow."""

    least_m: float = 0.0
    most_m: float = 0.0

    @property
    def side_m(self) -> tuple[float, float]:
        """Returns how far beside the path they stand, so that there are some at these depths."""
        return (self.least_m or SIDE_M[0], self.most_m or max(SIDE_M[1], 2 * self.least_m))

    @property
    def given(self) -> bool:
        return bool(self.least_m or self.most_m)


ANY_DEPTH = Depths()


def landmarks(
    path: Poses, count: int, chance: np.random.Generator, depths: Depths = ANY_DEPTH
) -> Floats:
    """Returns (count, 3) landmarks in the world, beside random poses of the path."""
    at = chance.integers(0, len(path.p), count)
    side = chance.uniform(*depths.side_m, count) * chance.choice((-1.0, 1.0), count)
    ahead = chance.uniform(-3.0, 3.0, count)
    up = chance.uniform(*HEIGHT_M, count) * max(1.0, depths.side_m[0] / SIDE_M[1])
    return path.p[at] + rotate(path.R[at], np.stack((ahead, side, up), axis=-1))


def view(
    R_WB: Floats,
    p_WB: Floats,
    points_W: Floats,
    range_m: float,
    camera: Camera = CAMERA,
    depths: Depths = ANY_DEPTH,
    extrinsic: Poses = T_CB,
) -> View:
    """Returns the points in the camera of a body at (R, p)."""
    in_body = rotate(R_WB.T, points_W - p_WB)
    q = rotate(extrinsic.R, in_body) + extrinsic.p
    x, y, z = q.T
    depth = np.maximum(z, DEPTH_MIN_M)
    u_left = camera.fx_px * x / depth + camera.cx_px
    v = camera.fy_px * y / depth + camera.cy_px
    u_right = camera.fx_px * (x - camera.baseline_m) / depth + camera.cx_px
    width, height = IMAGE_PX
    distance = np.sqrt(x * x + y * y + z * z)
    visible = (z > DEPTH_MIN_M) & (distance < range_m) & (u_left < width) & (u_right >= 0)
    visible &= (v >= 0) & (v < height) & (z >= depths.least_m)
    if depths.most_m:
        visible &= z <= depths.most_m
    return View(q, np.stack((u_left, v, u_right, v), axis=-1), visible)
