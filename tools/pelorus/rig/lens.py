# SPDX-License-Identifier: MIT
"""A pinhole with its lens: from rays to pixels and back, as OpenCV and Kalibr compute them.

none         no distortion
radtan       radial and tangential: k1 k2 p1 p2, and of OpenCV k3 and more
equidistant  fisheye (Kannala and Brandt 2006): k1 k2 k3 k4

These project wide angles by way of a sphere, before K:

omni   unified (Mei and Rives 2007): onto a sphere, seen from a point xi above its middle, and
       k1 k2 p1 p2 of the distortion behind it
eucm   enhanced unified (Khomutenko et al. 2016): alpha, beta
ds     double sphere (Usenko et al. 2018): xi, alpha
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from pelorus.io.named import Named
from pelorus.program.extras import cv2
from pelorus.wire.layout import Floats


class LensModel(StrEnum):
    """A model of a lens's distortion."""

    NONE = "none"
    RADTAN = "radtan"
    EQUIDISTANT = "equidistant"
    OMNI = "omni"
    EUCM = "eucm"
    DS = "ds"


# How many coefficients each may have.
COEFFICIENTS = {
    LensModel.NONE: (0,),
    LensModel.RADTAN: (4, 5, 8, 12, 14),
    LensModel.EQUIDISTANT: (4,),
    LensModel.OMNI: (1, 5),
    LensModel.EUCM: (2,),
    LensModel.DS: (2,),
}
SPHERES = {"omni": 1, "eucm": 2, "ds": 2}  # parameters before those of the distortion
NEWTON_STEPS = 10
DIFFERENCE = 1e-6  # of a ray, for derivatives
MISS_MAX_PX = 0.01  # a ray's pixel may be off by so much
Intrinsics = tuple[float, float, float, float]  # fx, fy, cx, cy


def intrinsics(content: Named, *names: str) -> Intrinsics:
    """Reads fx, fy, cx, cy under these names."""
    fx, fy, cx, cy = (content.number(name) for name in names)
    return fx, fy, cx, cy


def intrinsics_in(K: Floats) -> Intrinsics:
    """Returns fx, fy, cx, cy of a camera matrix, or of a projection."""
    return float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])


def coefficients(content: Named, name: str, model: LensModel) -> tuple[float, ...]:
    """Reads a list with as many coefficients as the model may have."""
    if model is LensModel.NONE:
        return ()
    value = content.get(name)
    count = len(value) if isinstance(value, list) else 0
    if count not in COEFFICIENTS[model]:
        expected = " or ".join(map(str, COEFFICIENTS[model]))
        raise content.error(name, value, f"{expected} numbers are expected for {model}")
    return tuple(content.array(name, count).tolist())


@dataclass(frozen=True)
class Lens:
    """fx, fy, cx, cy in px, with the distortion; a width of 0 is unknown."""

    model: LensModel
    intrinsics: Intrinsics
    coefficients: tuple[float, ...] = ()
    width_px: int = 0
    height_px: int = 0

    def sized(self, width_px: int, height_px: int) -> Lens:
        return replace(self, width_px=width_px, height_px=height_px)

    def scaled(self, width_px: int, height_px: int) -> Lens:
        """Returns the lens of pictures whose pixels are larger or smaller squares of the same
        picture; ValueError where they cannot show the same."""
        if not self.width_px or width_px * self.height_px != height_px * self.width_px:
            own = f"{self.width_px} x {self.height_px}"
            raise ValueError(f"pictures of {width_px} x {height_px} px are no scaled {own}")
        scale = width_px / self.width_px
        fx, fy, cx, cy = self.intrinsics
        cx, cy = (cx + 0.5) * scale - 0.5, (cy + 0.5) * scale - 0.5
        intrinsics = fx * scale, fy * scale, cx, cy
        return replace(self, intrinsics=intrinsics, width_px=width_px, height_px=height_px)

    @property
    def K(self) -> Floats:
        return self._matrix(self.intrinsics)

    @staticmethod
    def _matrix(four: tuple[float, ...]) -> Floats:
        fx, fy, cx, cy = four
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])

    def distort(self, rays: Floats) -> Floats:
        """Maps rays (n, 2), x/z and y/z in the camera, to pixels (n, 2)."""
        if not len(rays):
            return np.empty((0, 2))
        if self._sphere:
            rays = _onto_plane(self.model, self._sphere, rays)
        points = np.column_stack((rays, np.ones(len(rays))))[:, None]
        project = cv2.fisheye.projectPoints if self._is_fisheye else cv2.projectPoints
        zero = np.zeros(3)
        pixels, _ = project(points, zero, zero, self.K, self._D)
        return np.asarray(pixels, np.float64).reshape(-1, 2)

    def maps(
        self, R: Floats, four: Intrinsics, size: tuple[int, int]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Returns for each pixel of a camera without distortion, turned by R, the column and the
        row in this one's picture. `four`: its fx, fy, cx, cy; `size`: width, height, px."""
        K = self._matrix(four)
        if not self._sphere:
            find = cv2.fisheye if self._is_fisheye else cv2
            u, v = find.initUndistortRectifyMap(self.K, self._D, R, K, size, cv2.CV_32FC1)
            return u, v
        grid = np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), -1).reshape(-1, 2)
        rays = (grid - four[2:]) / four[:2]
        x, y, z = (np.column_stack((rays, np.ones(len(rays)))) @ R).T
        at = self.distort(np.stack((x / z, y / z), axis=-1)).astype(np.float32)
        u, v = at.T.reshape(2, size[1], size[0])
        return u, v

    def undistort(self, pixels: Floats) -> Floats:
        """Maps pixels (n, 2) to rays (n, 2), x/z and y/z; NaN where the lens has no ray for a
        pixel.

        It begins with OpenCV's few iterations (and the way back from the sphere), then takes
        Newton's until a ray meets its pixel.
        """
        if not len(pixels):
            return np.empty((0, 2))
        find = cv2.fisheye.undistortPoints if self._is_fisheye else cv2.undistortPoints
        rays = np.asarray(
            find(np.ascontiguousarray(pixels[:, None], np.float64), self.K, self._D), np.float64
        ).reshape(-1, 2)
        if self._sphere:
            rays = _from_plane(self.model, self._sphere, rays)
        with np.errstate(all="ignore"):
            for _ in range(NEWTON_STEPS):
                J = self._slope(rays)
                det = np.abs(np.linalg.det(J))
                sound = (det > 1) & np.isfinite(det)  # px^2: elsewhere the lens folds
                miss = pixels - self.distort(rays)
                rays[sound] += np.linalg.solve(J[sound], miss[sound, :, None])[..., 0]
            off = np.linalg.norm(pixels - self.distort(rays), axis=1)
            rays[~(off < MISS_MAX_PX)] = np.nan
        return rays

    def _slope(self, rays: Floats) -> Floats:
        """Returns (n, 2, 2) d px / d ray."""
        steps = DIFFERENCE * np.eye(2)
        sides = [self.distort(rays + step) - self.distort(rays - step) for step in steps]
        return np.stack(sides, axis=-1) / (2 * DIFFERENCE)

    @property
    def _is_fisheye(self) -> bool:
        return self.model is LensModel.EQUIDISTANT

    @property
    def _sphere(self) -> tuple[float, ...]:
        return self.coefficients[: SPHERES.get(self.model, 0)]

    @property
    def _D(self) -> Floats:
        return np.array(self.coefficients[len(self._sphere) :] or (0.0,) * 4)


# --- by way of a sphere ---------------------------------------------------------------------------


def _onto_plane(model: str, parameters: tuple[float, ...], rays: Floats) -> Floats:
    """Maps rays (n, 2) ahead of the camera, x/z and y/z, to the plane m of a pinhole."""
    r2 = np.sum(rays**2, axis=1)
    if model == "eucm":
        alpha, beta = parameters
        return np.asarray(rays / (alpha * np.sqrt(beta * r2 + 1) + 1 - alpha)[:, None])
    length = np.sqrt(r2 + 1)
    if model == "omni":
        return np.asarray(rays / (1 + parameters[0] * length)[:, None])
    xi, alpha = parameters
    z = xi * length + 1
    return np.asarray(rays / (alpha * np.sqrt(r2 + z**2) + (1 - alpha) * z)[:, None])


def _from_plane(model: str, parameters: tuple[float, ...], m: Floats) -> Floats:
    """Maps m to rays; NaN where none is ahead."""
    r2 = np.sum(m**2, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        if model == "omni":
            z = 1 - parameters[0] * (1 + r2) / (
                parameters[0] + np.sqrt(1 + (1 - parameters[0] ** 2) * r2)
            )
        elif model == "eucm":
            alpha, beta = parameters
            z = _lifted(alpha, beta, r2)
        else:
            xi, alpha = parameters
            up = _lifted(alpha, 1.0, r2)
            k = (up * xi + np.sqrt(up**2 + (1 - xi**2) * r2)) / (up**2 + r2)
            z = up - xi / k
        return np.where((z > 0)[:, None], m / z[:, None], np.nan)


def _lifted(alpha: float, beta: float, r2: Floats) -> Floats:
    root = np.sqrt(1 - (2 * alpha - 1) * beta * r2)
    return np.asarray((1 - beta * alpha**2 * r2) / (alpha * root + 1 - alpha))
