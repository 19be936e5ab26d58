# SPDX-License-Identifier: MIT
"""The camera's motion between two frames from their common stereo tracks alone.

Gauss-Newton on the reprojection of the first frame's points into the second, with the weights
of Geman and McClure (1987) against bad matches; all frames at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.io.tracks import Indices, Tracks, project, sum_by_frame, triangulate
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.program.console import progress
from pelorus.tracking.second_view import NOISE, apply, inverse, linearised, measured, product
from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

DISPARITY_MIN_PX = 1.0  # below it a triangulated depth is worthless
ROW_GAP_MAX_PX = 2.0  # a rectified pair shows a point in one row; more is a bad match
DEPTH_MIN_M = 0.5
PAIRS_MIN = 10  # with fewer a motion is not trusted
ITERATIONS = 12
WIDE_ITERATIONS = 6  # the first ones accept larger residuals
WIDE_PX, NARROW_PX = 10.0, 2.0
RIGID_ITERATIONS = 8
RIDGE = 1e-3  # keeps frames without observations solvable
STEP_MAX = 1.0  # m and rad an iteration
CHI2_4_MEDIAN = 3.3567  # of chi-square with four degrees of freedom


@dataclass(frozen=True)
class SeenPairs:
    """Usable pairs of frames k and k + lag: pixels in both, points in camera k."""

    frame_count: int  # number of k
    frame: Indices
    first_pixels: Floats
    q_C: Floats
    pixels: Floats

    def counts(self) -> NDArray[np.int64]:
        return np.bincount(self.frame, minlength=self.frame_count)

    def reproject(self, camera: Camera, motion: Poses) -> Floats:
        """Returns the RMS over each pair's four pixel numbers; infinite behind the camera."""
        q = np.einsum("nij,nj->ni", motion.R[self.frame], self.q_C) + motion.p[self.frame]
        ahead = q[:, 2] > DEPTH_MIN_M
        error = np.full(len(q), np.inf)
        residual = project(camera, q[ahead]) - self.pixels[ahead]
        error[ahead] = np.sqrt(np.mean(residual**2, axis=1))
        return error

    def median_by_frame(self, values: Floats, at_least: int = PAIRS_MIN) -> Floats:
        """Returns (frame_count,) each frame's median, NaN with fewer than `at_least`."""
        order = np.lexsort((values, self.frame))
        counts = self.counts()
        middle = np.concatenate(([0], np.cumsum(counts)[:-1])) + counts // 2
        enough = counts >= at_least
        out = np.full(self.frame_count, np.nan)
        out[enough] = values[order][middle[enough]]
        return out


def seen_pairs(tracks: Tracks, camera: Camera, lag: int) -> SeenPairs:
    """Returns the pairs whose first pixels give a depth and whose rows agree."""
    pairs = tracks.pairs(lag)
    first, second = tracks.pixels[pairs.first], tracks.pixels[pairs.second]
    good = (
        (first[:, 0] - first[:, 2] > DISPARITY_MIN_PX)
        & (second[:, 0] > second[:, 2])
        & (np.abs(first[:, 1] - first[:, 3]) < ROW_GAP_MAX_PX)
        & (np.abs(second[:, 1] - second[:, 3]) < ROW_GAP_MAX_PX)
    )
    frame_count = max(tracks.frame_count - lag, 0)
    return SeenPairs(
        frame_count,
        pairs.frame[good],
        first[good],
        triangulate(camera, first[good]),
        second[good],
    )


def estimate(seen: SeenPairs, camera: Camera, first: Poses | None = None) -> Poses:
    """Returns for each k the motion that maps coordinates in camera k to camera k + lag.

    The search begins at rest, or with `first`; it converges from within some tens of pixels.
    """
    at_rest = Poses(np.tile(np.eye(3), (seen.frame_count, 1, 1)), np.zeros((seen.frame_count, 3)))
    motion = at_rest if first is None else first
    return _searched(seen, camera, motion, progress(range(ITERATIONS), "camera motion", ITERATIONS))


def _searched(seen: SeenPairs, camera: Camera, motion: Poses, steps: Iterable[int]) -> Poses:
    for iteration in steps:
        scale_px = WIDE_PX if iteration < WIDE_ITERATIONS else NARROW_PX
        step = se3.exp(*_gauss_newton(seen, camera, motion, scale_px))
        motion = se3.compose(step, motion)
    return Poses(se3.nearest_rotation(motion.R), motion.p)


def of_pair(tracks: Tracks, camera: Camera) -> Poses | None:
    """Returns the motion between the only two frames of these tracks; None with too few pairs."""
    seen = seen_pairs(tracks, camera, 1)
    if len(seen.frame) < PAIRS_MIN:
        return None
    return _searched(seen, camera, rigid(seen, camera), range(ITERATIONS)).at(0)


def rigid(seen: SeenPairs, camera: Camera) -> Poses:
    """Returns for each k the motion that roughly fits the points in space, as a start for large
    motions.

    Points weigh by the square of their disparity, and less the less they fit.
    """
    u_left, u_right = seen.pixels[:, 0], seen.pixels[:, 2]
    here, there = seen.q_C, triangulate(camera, seen.pixels)
    sure = (np.minimum(seen.first_pixels[:, 0] - seen.first_pixels[:, 2], u_left - u_right)) ** 2
    # error of a depth by one pixel of disparity
    blur_m = here[:, 2] ** 2 / (camera.fx_px * camera.baseline_m)
    weight = np.minimum(sure, np.quantile(sure, 0.9)) if len(sure) else sure
    for _ in range(RIGID_ITERATIONS):
        motion = _fit(seen, here, there, weight)
        moved = np.einsum("nij,nj->ni", motion.R[seen.frame], here) + motion.p[seen.frame]
        off = np.linalg.norm(moved - there, axis=1) / blur_m
        weight = sure / (1 + (off / WIDE_PX) ** 2) ** 2
    return motion


def _fit(seen: SeenPairs, here: Floats, there: Floats, weight: Floats) -> Poses:
    """Fits each frame's there = R here + p with weights (Kabsch 1976)."""

    def total(values: Floats) -> Floats:
        return sum_by_frame(seen.frame, seen.frame_count, values)

    w = np.maximum(total(weight), 1e-12)[:, None]
    a, b = (total(weight[:, None] * q) / w for q in (here, there))
    out, back = here - a[seen.frame], there - b[seen.frame]
    M = total(weight[:, None, None] * back[:, :, None] * out[:, None, :])
    R = se3.nearest_rotation(M + 1e-9 * np.eye(3))
    return Poses(R, b - np.einsum("nij,nj->ni", R, a))


def _gauss_newton(
    seen: SeenPairs, camera: Camera, motion: Poses, scale_px: float
) -> tuple[Floats, Floats]:
    """Returns one robust step (rho, theta) on the left of each motion."""
    pairs = _residuals(seen, camera, motion)
    weight = pairs.ahead / (1 + pairs.d2 / scale_px**2) ** 2
    JW = product(pairs.J.swapaxes(0, 1), pairs.W * weight)
    H, g = (
        sum_by_frame(seen.frame, seen.frame_count, np.moveaxis(values, -1, 0))
        for values in (product(JW, pairs.J), apply(JW, pairs.e))
    )
    step = np.linalg.solve(H + RIDGE * np.eye(6), g[..., None])[..., 0]
    step = np.clip(step, -STEP_MAX, STEP_MAX)
    return step[:, :3], step[:, 3:]


class _Residuals(NamedTuple):
    """Residuals of (uL, v, disparity), with the pairs on the last axis."""

    e: Floats  # (3, n)
    J: Floats  # (3, 6, n), by a small step on the left of the motion
    W: Floats  # (3, 3, n), inverse covariance for pixels of unit noise
    d2: Floats  # of all four pixels: chi-square with four degrees of freedom
    ahead: NDArray[np.bool_]  # in front of the second camera


def _residuals(seen: SeenPairs, camera: Camera, motion: Poses) -> _Residuals:
    """Returns the residuals, with the noise of the second pixels and of the point by the first
    ones.

    Without the latter far points, whose depth is hardly known, would bend the motion.
    """
    R, p = np.moveaxis(motion.R, 0, -1)[..., seen.frame], motion.p.T[:, seen.frame]
    h, Jx, J = linearised(camera, measured(camera, seen.first_pixels).T, R, p)
    of_first = product(np.einsum("ijn,jk->ikn", Jx, NOISE), Jx.swapaxes(0, 1))
    W = inverse(of_first + NOISE[:, :, None])
    e = measured(camera, seen.pixels).T - h
    of_rows = 0.5 * (seen.pixels[:, 1] - seen.pixels[:, 3]) ** 2
    nearest_px = camera.fx_px * camera.baseline_m / DEPTH_MIN_M
    ahead = (h[2] > 0) & (h[2] < nearest_px)
    return _Residuals(e, J, W, np.sum(e * apply(W, e), axis=0) + of_rows, ahead)


def distance2(seen: SeenPairs, camera: Camera, motion: Poses) -> Floats:
    """Returns each pair's squared distance from the motion, in pixels' unit noise: chi-square of
    four.

    Infinite behind the camera. An uncertain depth adds nothing.
    """
    pairs = _residuals(seen, camera, motion)
    return np.where(pairs.ahead, pairs.d2, np.inf)


def pixel_sigma(seen: SeenPairs, camera: Camera, motion: Poses) -> float:
    """Returns the pixel noise by the two views of the points, px; NaN with too few pairs.

    The median makes it robust. Only frames count whose motion has enough pairs.
    """
    enough = (seen.counts() >= 2 * PAIRS_MIN)[seen.frame]
    pairs = _residuals(seen, camera, motion)
    good = enough & pairs.ahead
    if good.sum() < PAIRS_MIN:
        return float("nan")
    return float(np.sqrt(np.median(pairs.d2[good]) / CHI2_4_MEDIAN))
