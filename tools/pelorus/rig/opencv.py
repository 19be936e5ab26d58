# SPDX-License-Identifier: MIT
"""Reads OpenCV's stereo calibration: K1 D1 K2 D2 R T, in one file or in two.

R and T (or t) map points of the first camera to the second one (stereoCalibrate).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math.se3 import Poses
from pelorus.rig.lens import COEFFICIENTS, Lens, LensModel, intrinsics_in
from pelorus.rig.rig import Rig
from pelorus.wire.layout import Floats

# Names of the matrix of camera {} and of its lens; and what {} may be for the two.
MATRICES = ("K{}", "M{}", "CM{}", "cameraMatrix{}", "CameraMatrix{}", "camera_matrix{}")
DISTORTIONS = ("D{}", "distCoeffs{}", "DistCoeffs{}", "dist_coeffs{}", "distortion{}")
SIDES = (("1", "2"), ("_1", "_2"), ("L", "R"), ("_left", "_right"), ("Left", "Right"))
LENSES = (LensModel.NONE, LensModel.RADTAN, LensModel.EQUIDISTANT)
SHIFTS = ("T", "t")
SIZES = ("imageSize", "image_size")
FISHEYE_OR_NOT = 4  # number of coefficients that both models may have


def is_opencv(content: Named) -> bool:
    """Returns whether it has the cameras of a stereo calibration, or their relative pose."""
    has_one = any(pattern.format(side[0]) in content for pattern in MATRICES for side in SIDES)
    return has_one or ("R" in content and any(name in content for name in SHIFTS))


def stereo(content: Named, model: LensModel | None) -> Rig:
    """Reads the pair; `model` is needed where the number of coefficients leaves it open."""
    T_21 = Poses(content.rotation("R"), _shift(content, content.first_of(SHIFTS) or SHIFTS[0]))
    return Rig.of_cameras(content.path, _lens(content, 1, model), _lens(content, 2, model), T_21)


def _shift(content: Named, name: str) -> Floats:
    is_object = isinstance(content.get(name), dict)
    return content.matrix(name, 3, 1).ravel() if is_object else content.array(name, 3)


def _lens(content: Named, number: int, model: LensModel | None) -> Lens:
    K = content.matrix(_one_of(content, MATRICES, number), 3, 3)
    four = intrinsics_in(K)
    fx, fy, *_ = four
    if min(fx, fy) <= 0 or abs(K[0, 1]) > 1e-6 * fx:
        raise ForeignFileError(
            content.path,
            f"camera {number} has fx {fx:g}, fy {fy:g}, skew {K[0, 1]:g}; positive focal lengths "
            "and no skew are expected",
        )
    name = _one_of(content, DISTORTIONS, number)
    D = tuple(content.row(name).tolist())
    size = content.first_of(SIZES)
    width, height = content.size(size) if size else (0, 0)
    if not any(D):
        return Lens(LensModel.NONE, four, (), width, height)
    return Lens(_model(content, name, len(D), model), four, D, width, height)


def _model(content: Named, name: str, count: int, asked: LensModel | None) -> LensModel:
    if asked is None and count == FISHEYE_OR_NOT:
        raise ForeignFileError(
            content.path,
            f"{name} has 4 numbers, as radtan and a fisheye have; --lens radtan or --lens "
            "equidistant is expected",
        )
    model = asked if asked in LENSES and asked is not None else LensModel.RADTAN
    if count not in COEFFICIENTS[model]:
        expected = " or ".join(map(str, COEFFICIENTS[model]))
        raise ForeignFileError(
            content.path, f"{name} has {count} numbers; {expected} are expected for {model}"
        )
    return model


def _one_of(content: Named, patterns: tuple[str, ...], number: int) -> str:
    for name in (pattern.format(side[number - 1]) for pattern in patterns for side in SIDES):
        if name in content:
            return name
    raise ForeignFileError(
        content.path,
        f"lacks {' or '.join(pattern.format(number) for pattern in patterns)}; there are: "
        f"{', '.join(content.content) or 'none'}",
    )


# --- XML ------------------------------------------------------------------------------------------


def xml_words(path: Path, words: str) -> dict[str, Any]:
    """Reads what cv::FileStorage writes as XML: the same names and matrices as in its YAML."""
    try:
        root = ET.fromstring(words)
    except ET.ParseError as error:
        raise ForeignFileError(path, f"is no XML: {error}") from None
    if root.tag != "opencv_storage":
        raise ForeignFileError(path, f"is XML of {root.tag}; opencv_storage is expected")
    return {one.tag: _value(one) for one in root}


def _value(one: ET.Element) -> Any:
    if len(one):
        return {inner.tag: _value(inner) for inner in one}
    words = (one.text or "").split()
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return (one.text or "").strip()
    return numbers[0] if len(numbers) == 1 and one.tag != "data" else numbers
