# SPDX-License-Identifier: MIT
"""Tests whether a trajectory fits another one if its file is read otherwise.

Its unit may be another one, its quaternion's order, the direction of its transforms, or its frame
on the same body. Each is a way to write the same poses, and none shows in one file alone: a
quaternion whose numbers are taken in another order is a rotation, too. Two trajectories of one
drive show it. Nothing is changed; the user is asked.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy

from pelorus.math import motion, se3
from pelorus.math.consistency import rms
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.wire.layout import Floats

POSES_MIN = 3
SCALE_MIN = 1.5  # ratio of scales by a unit or a monocular camera; odometry is off by some per cent
UNITS = {1000.0: "mm", 100.0: "cm", 1 / 0.3048: "feet"}
UNIT_TOLERANCE = 0.2  # they are three times or more apart
NEAR_S = 0.1  # poses that would be of one time with a larger tolerance
BETTER = 2.0  # least ratio by which an error must become smaller
FRAME_MIN_DEG = 10.0  # between axes of another frame; less is an error of a mount or an estimate
UNEXPLAINED_MAX = 0.25  # share of the positions' variance, where they fit at all


class NamedPoses(NamedTuple):
    """Poses, and the name of their file."""

    name: str
    poses: Poses


def times_apart(a: tuple[str, Times], b: tuple[str, Times]) -> str:
    """Returns advice where no times of the two are equal: another unit, or a larger tolerance."""
    middle_a, middle_b = float(np.median(a[1])), float(np.median(b[1]))
    larger = max(middle_a, middle_b) / max(min(middle_a, middle_b), 1.0)
    if any(abs(larger / factor - 1) < UNIT_TOLERANCE for factor in (1e3, 1e6, 1e9)):
        small = a[0] if middle_a < middle_b else b[0]
        return f"the times of {small} are {larger:.3g} times too small: are they in us or ms?"
    apart_ns = np.abs(b[1][motion.nearest(b[1], a[1])] - a[1])
    near_s = float(np.percentile(apart_ns, 90)) * 1e-9
    if near_s > NEAR_S:
        return ""
    return f"most are within {near_s:.2g} s: --tolerance {1.1 * near_s:.2g} would take them"


class SimilarityFit(NamedTuple):
    """How well b's positions, moved, turned and scaled, fit a's."""

    scale: float
    scaled_m: float  # RMS distance with the scale
    plain_m: float  # and without
    unexplained: float  # share of a's variance, with the scale


def doubts(a: NamedPoses, b: NamedPoses, fixed: bool) -> list[str]:
    """Returns questions about poses of the same times; `fixed`: a was certainly read right."""
    if len(a.poses.p) < POSES_MIN:
        return []
    found = fit(a.poses.p, b.poses.p)
    if found is None:
        return []
    inverse = _inverse(a, b, found)
    if inverse or found.unexplained > UNEXPLAINED_MAX:
        return inverse
    return [*_scale(found, a, b), *_turned(found, a, b, fixed)]


def fit(a: Floats, b: Floats) -> SimilarityFit | None:
    """Fits a = s R b + t by least squares (Umeyama 1991); None where one of them does not move."""
    from_a, from_b = a - a.mean(axis=0), b - b.mean(axis=0)
    moved_a, moved_b = rms(from_a), rms(from_b)
    if not moved_a or not moved_b:
        return None
    turned = from_b @ se3.nearest_rotation(from_a.T @ from_b).T
    scale = float((turned * from_a).sum() / (turned * turned).sum())
    scaled_m, plain_m = rms(from_a - scale * turned), rms(from_a - turned)
    return SimilarityFit(scale, scaled_m, plain_m, (scaled_m / moved_a) ** 2)


def _scale(found: SimilarityFit, a: NamedPoses, b: NamedPoses) -> list[str]:
    larger = max(found.scale, 1 / found.scale)
    if larger < SCALE_MIN or found.plain_m < BETTER * found.scaled_m:
        return []
    large, small = (a, b) if found.scale > 1 else (b, a)
    asked = "is one of them of a camera that knows no scale?"
    for scale, unit in UNITS.items():
        if abs(larger / scale - 1) < UNIT_TOLERANCE:
            larger, asked = scale, f"is it in {unit}?"
    return [
        f"a scale of {larger:.4g} fits: {large.name} is by so much larger than {small.name}: "
        f"{asked} With it positions fit to {found.scaled_m:.2g} m, without it to "
        f"{found.plain_m:.2g} m"
    ]


# --- rotations ------------------------------------------------------------------------------------


def _turned(found: SimilarityFit, a: NamedPoses, b: NamedPoses, fixed: bool) -> list[str]:
    as_read = _apart_deg(a.poses.R, b.poses.R)
    sides = [(a, b)] if fixed else [(a, b), (b, a)]
    best_deg, best = as_read / BETTER, ""
    for one, other in sides:
        for words, R in _readings(other.poses.R):
            apart_deg = _apart_deg(one.poses.R, R)
            if apart_deg < best_deg:
                best_deg, best = apart_deg, words.format(other.name)
    if not best:
        turn_deg, apart_deg, words = _other_frame(a, b)
        if apart_deg >= best_deg or turn_deg < FRAME_MIN_DEG:
            return []
        best_deg, best = apart_deg, words
    return [
        f"positions fit to {found.scaled_m:.2f} m, rotations do not ({as_read:.1f} deg RMS): "
        f"{best} Read so, rotations fit to {best_deg:.2g} deg"
    ]


def _readings(R: Floats) -> Iterator[tuple[str, Floats]]:
    q = scipy.spatial.transform.Rotation.from_matrix(R).as_quat()
    for words, by in (
        ("is the quaternion of {} w first?", -1),
        ("is the quaternion of {} w last?", 1),
    ):
        rolled = scipy.spatial.transform.Rotation.from_quat(np.roll(q, by, axis=1)).as_matrix()
        yield words, rolled
    yield "are the rotations of {} world to body? Body to world is expected.", np.swapaxes(R, 1, 2)


def _steps(R: Floats) -> Floats:
    """Returns (n, 3) rotation vectors from the first pose to each, in no world's axes."""
    return np.asarray(scipy.spatial.transform.Rotation.from_matrix(R[0].T @ R).as_rotvec())


def _apart_deg(R_a: Floats, R_b: Floats) -> float:
    between = np.swapaxes(R_a[0].T @ R_a, 1, 2) @ (R_b[0].T @ R_b)
    return float(np.degrees(rms(scipy.spatial.transform.Rotation.from_matrix(between).as_rotvec())))


def _other_frame(a: NamedPoses, b: NamedPoses) -> tuple[float, float, str]:
    """Tests whether poses are those of another frame on the same body.

    Returns the angle between the axes, the remaining difference, in degrees, and what to ask.
    """
    B = se3.nearest_rotation(_steps(a.poses.R).T @ _steps(b.poses.R))  # maps b's vectors to a's
    angle_deg = float(np.degrees(scipy.spatial.transform.Rotation.from_matrix(B).magnitude()))
    apart_deg = _apart_deg(a.poses.R, b.poses.R @ B.T)
    return (
        angle_deg,
        apart_deg,
        (
            f"are the poses of {b.name} those of another frame, such as the camera's? Its axes are "
            f"turned by {angle_deg:.0f} deg."
        ),
    )


def _inverse(a: NamedPoses, b: NamedPoses, as_read: SimilarityFit) -> list[str]:
    """Returns a question where the positions of the inverse transforms fit better."""
    found = fit(a.poses.p, se3.inverse(b.poses).p)
    if found is None or found.unexplained > min(UNEXPLAINED_MAX, as_read.unexplained / BETTER**2):
        return []
    return [
        f"positions fit to {as_read.plain_m:.2g} m, those of the inverse transforms to "
        f"{found.plain_m:.2g} m: "
        f"are the poses of {b.name} world to body? Body to world is expected"
    ]
