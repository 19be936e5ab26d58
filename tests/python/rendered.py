# SPDX-License-Identifier: MIT
"""Raw pictures of a wall behind a board, as cameras of `rigs` take them, and how they moved."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pelorus.math import se3
from pelorus.math.se3 import Poses
from rigs import Cameras, lens

Gray = NDArray[np.uint8]
Floats = NDArray[np.float64]

WIDTH, HEIGHT = 376, 240
FRAMES, RATE_HZ, SPEED_MPS = 6, 10.0, 2.0
WALL_M, BOARD_M, BOARD_HALF_M = 8.0, 4.0, 0.8
BEGIN_NS = 1403636579763555584
INVERSIONS = 200

SMALL = Cameras(
    left=(229.3, 228.6, 183.6, 124.2),
    right=(228.8, 228.1, 190.0, 127.6),
)


@dataclass(frozen=True)
class Scene:
    """The left camera at (0, 0, k SPEED / RATE) of the world, which looks along z."""

    cameras: Cameras = SMALL
    shades: list[NDArray[np.float32]] = field(default_factory=lambda: [texture(1), texture(2)])

    @property
    def t_ns(self) -> list[int]:
        return [BEGIN_NS + round(k * 1e9 / RATE_HZ) for k in range(FRAMES)]

    def pair(self, k: int) -> tuple[Gray, Gray]:
        """Left and right."""
        T_WL = Poses(np.eye(3), np.array([0, 0, SPEED_MPS * k / RATE_HZ]))
        T_WR = se3.compose(T_WL, se3.inverse(self.cameras.T_RL))
        return self._seen(T_WL, self.cameras.left), self._seen(T_WR, self.cameras.right)

    def body(self) -> Poses:
        """Where the body is at the frames: body to world."""
        z = SPEED_MPS * np.arange(FRAMES) / RATE_HZ
        T_WL = Poses(np.tile(np.eye(3), (FRAMES, 1, 1)), np.stack((0 * z, 0 * z, z), axis=-1))
        return se3.compose(T_WL, self.cameras.T_LB)

    def off_surface(self, p_W: Floats) -> Floats:
        """How far points are from the wall and from the board, m."""
        return np.minimum(abs(p_W[:, 2] - WALL_M), abs(p_W[:, 2] - BOARD_M))

    def _seen(self, T_WC: Poses, intrinsics: tuple[float, ...]) -> Gray:
        cameras = self.cameras
        rays = rays_of(cameras.model, intrinsics, cameras.coefficients) @ T_WC.R.T
        picture = np.zeros((HEIGHT, WIDTH), np.float32)
        for shade, depth_m, dots_per_m in zip(
            self.shades, (WALL_M, BOARD_M), (30, 60), strict=True
        ):
            way = (depth_m - T_WC.p[2]) / rays[:, 2:]
            x, y = (rays[:, :2] * way + T_WC.p[:2]).T.reshape(2, HEIGHT, WIDTH)
            column, row = (np.asarray(a * dots_per_m + 512, np.float32) for a in (x, y))
            plane = cv2.remap(shade, column, row, cv2.INTER_CUBIC, borderMode=cv2.BORDER_WRAP)
            there = (depth_m == WALL_M) | (np.hypot(x, y) < BOARD_HALF_M)
            picture = np.where(there, plane, picture)
        return np.clip(np.round(picture), 0, 255).astype(np.uint8)


@cache
def rays_of(model: str, intrinsics: tuple[float, ...], D: tuple[float, ...]) -> Floats:
    """Returns every pixel's ray: the lens' formula, inverted by iteration."""
    u, v = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    wanted = np.stack((u.ravel(), v.ravel()), axis=-1)
    rays = (wanted - intrinsics[2:]) / intrinsics[:2]
    for _ in range(INVERSIONS):
        at = np.column_stack((rays, np.ones(len(rays))))
        rays -= (lens(model, intrinsics, D, at) - wanted) / intrinsics[:2]
    return np.column_stack((rays, np.ones(len(rays))))


def texture(seed: int) -> NDArray[np.float32]:
    """Soft blobs, which a point can be followed on."""
    noise = np.random.default_rng(seed).uniform(0, 255, (1024, 1024)).astype(np.float32)
    soft = cv2.GaussianBlur(noise, (0, 0), 2.5)
    return np.asarray(cv2.normalize(soft, np.empty(0), 0, 255, cv2.NORM_MINMAX), np.float32)


def write_picture(path: Path, picture: Gray) -> None:
    """Its folder too."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), picture)
