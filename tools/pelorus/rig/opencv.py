# SPDX-License-Identifier: MIT
"""OpenCV's stereo calibration: K1 D1 K2 D2 R T, in one file or in two (intrinsics, extrinsics).

R and T bring points of the first camera to the second one (stereoCalibrate).
"""

from __future__ import annotations

import numpy as np

from pelorus import arrays, se3
from pelorus.foreign import ForeignFileError
from pelorus.named import Named
from pelorus.rig.kalibr import matrix
from pelorus.rig.lens import COEFFICIENTS, Lens, LensModel
from pelorus.rig.rig import Rig
from pelorus.se3 import Poses

# How the matrix of camera {} is called, and its lens.
MATRICES = ("K{}", "M{}", "cameraMatrix{}", "camera_matrix_{}")
DISTORTIONS = ("D{}", "distCoeffs{}", "dist_coeffs_{}")
SIZES = ("imageSize", "image_size")
FISHEYE_OR_NOT = 4  # so many coefficients both have


def is_opencv(content: Named) -> bool:
    """Of a stereo calibration the cameras, or where they stand."""
    return any(pattern.format(1) in content for pattern in MATRICES) or (
        "R" in content and "T" in content
    )


def stereo(content: Named, model: LensModel | None) -> Rig:
    """`model` is asked for where the number of coefficients does not tell."""
    T_21 = Poses(
        se3.nearest_rotation(arrays.rotation(content.path, "R", matrix(content, "R", 3, 3))),
        _column(content, "T"),
    )
    return Rig.of_cameras(content.path, _lens(content, 1, model), _lens(content, 2, model), T_21)


def _column(content: Named, name: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    value = content.get(name)
    if isinstance(value, dict) and value.get("rows") == 1:
        return matrix(content, name, 1, 3).ravel()
    if isinstance(value, dict):
        return matrix(content, name, 3, 1).ravel()
    return content.array(name, 3)


def _lens(content: Named, number: int, model: LensModel | None) -> Lens:
    K = matrix(content, _one_of(content, MATRICES, number), 3, 3)
    fx, fy, cx, cy = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
    if min(fx, fy) <= 0 or abs(K[0, 1]) > 1e-6 * fx:
        raise ForeignFileError(
            content.path,
            f"camera {number} has fx {fx:g}, fy {fy:g}, skew {K[0, 1]:g}",
            due="positive focal lengths and no skew are due",
        )
    name = _one_of(content, DISTORTIONS, number)
    D = _numbers(content, name)
    size = next((name for name in SIZES if name in content), None)
    width, height = content.size(size) if size else (0, 0)
    intrinsics = (float(fx), float(fy), float(cx), float(cy))
    if not any(D):
        return Lens(LensModel.NONE, intrinsics, (), width, height)
    return Lens(_model(content, name, len(D), model), intrinsics, D, width, height)


def _model(content: Named, name: str, count: int, asked: LensModel | None) -> LensModel:
    if asked is None and count == FISHEYE_OR_NOT:
        raise ForeignFileError(
            content.path,
            f"{name} has 4 numbers, as radtan and a fisheye have",
            due="--lens radtan or --lens equidistant is due",
        )
    model = asked or LensModel.RADTAN
    if count not in COEFFICIENTS[model]:
        due = " or ".join(map(str, COEFFICIENTS[model]))
        raise ForeignFileError(
            content.path, f"{name} has {count} numbers", due=f"{due} are due for {model}"
        )
    return model


def _numbers(content: Named, name: str) -> tuple[float, ...]:
    value = content.get(name)
    if not isinstance(value, dict):
        value = np.ravel(value).tolist()
        return tuple(Named(content.path, {name: value}).array(name, len(value)).tolist())
    inner = content.object(name)
    count = int(inner.number("rows") * inner.number("cols"))
    return tuple(inner.array("data", count).tolist())


def _one_of(content: Named, patterns: tuple[str, ...], number: int) -> str:
    names = [pattern.format(number) for pattern in patterns]
    for name in names:
        if name in content:
            return name
    raise ForeignFileError(
        content.path,
        f"lacks {' or '.join(names)}",
        due=f"there are: {', '.join(content.content) or 'none'}",
    )
