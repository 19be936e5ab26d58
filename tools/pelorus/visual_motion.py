# SPDX-License-Identifier: MIT
"""The camera's motion between two frames from their common stereo tracks alone.

Gauss-Newton on the reprojection of the first frame's points into the second, with the weights
of Geman and McClure (1987) against bad matches; all frames at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pelorus import se3
from pelorus.console import progress
from pelorus.frames import Camera
from pelorus.layout import Floats
from pelorus.se3 import Poses
from pelorus.tracks import (
    Indices,
    Tracks,
    point_jacobian,
    project,
    sum_by_frame,
    triangulate,
)

DISPARITY_MIN_PX = 1.0  # below it a triangulated depth means little
ROW_GAP_MAX_PX = 2.0  # a rectified pair shows a point in one row; more is a bad match
DEPTH_MIN_M = 0.5
PAIRS_MIN = 10  # with fewer a motion is not trusted
ITERATIONS = 12
WIDE_ITERATIONS = 6  # the first ones accept larger residuals
WIDE_PX, NARROW_PX = 10.0, 2.0
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
        """RMS over the four pixel numbers of each pair, px; infinite behind the camera."""
        q = np.einsum("nij,nj->ni", motion.R[self.frame], self.q_C) + motion.p[self.frame]
        ahead = q[:, 2] > DEPTH_MIN_M
        error = np.full(len(q), np.inf)
        residual = project(camera, q[ahead]) - self.pixels[ahead]
        error[ahead] = np.sqrt(np.mean(residual**2, axis=1))
        return error

    def median_by_frame(self, values: Floats, at_least: int = PAIRS_MIN) -> Floats:
        """(frame_count,): the median of each frame's values, NaN with fewer than `at_least`."""
        order = np.lexsort((values, self.frame))
        counts = self.counts()
        middle = np.concatenate(([0], np.cumsum(counts)[:-1])) + counts // 2
        enough = counts >= at_least
        out = np.full(self.frame_count, np.nan)
        out[enough] = values[order][middle[enough]]
        return out


def seen_pairs(tracks: Tracks, camera: Camera, lag: int) -> SeenPairs:
    """The pairs whose first pixels give a depth and whose rows agree."""
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


def estimate(seen: SeenPairs, camera: Camera) -> Poses:
    """For each k the motion that brings coordinates in camera k to camera k + lag."""
    motion = Poses(np.tile(np.eye(3), (seen.frame_count, 1, 1)), np.zeros((seen.frame_count, 3)))
    for iteration in progress(range(ITERATIONS), "camera motion", ITERATIONS):
        scale_px = WIDE_PX if iteration < WIDE_ITERATIONS else NARROW_PX
        step = se3.exp(*_gauss_newton(seen, camera, motion, scale_px))
        motion = se3.compose(step, motion)
    return Poses(se3.nearest_rotation(motion.R), motion.p)


def _gauss_newton(
    seen: SeenPairs, camera: Camera, motion: Poses, scale_px: float
) -> tuple[Floats, Floats]:
    """One robust step (rho, theta) on the left of each motion.

    A residual has the noise of the second pixels and of the point, which the first pixels gave:
    W is its inverse covariance for pixels of unit noise. Without the second part far points, whose
    depth is hardly known, bend the motion.
    """
    R = motion.R[seen.frame]
    q = np.einsum("nij,nj->ni", R, seen.q_C) + motion.p[seen.frame]
    ahead = q[:, 2] > DEPTH_MIN_M
    q[:, 2] = np.maximum(q[:, 2], DEPTH_MIN_M)
    residual = seen.pixels - project(camera, q)
    D = point_jacobian(camera, q)
    from_first = D @ R @ triangulation_jacobian(camera, seen.first_pixels, seen.q_C)
    W = np.linalg.inv(np.eye(4) + from_first @ np.swapaxes(from_first, 1, 2))
    weight = ahead / (1 + np.einsum("na,nab,nb->n", residual, W, residual) / scale_px**2) ** 2
    J = np.concatenate((D, -D @ se3.skew(q)), axis=-1)
    WJ = (W @ J) * weight[:, None, None]
    H = sum_by_frame(seen.frame, seen.frame_count, np.swapaxes(J, 1, 2) @ WJ) + RIDGE * np.eye(6)
    g = sum_by_frame(seen.frame, seen.frame_count, np.einsum("nai,na->ni", WJ, residual))
    step = np.clip(np.linalg.solve(H, g[..., None])[..., 0], -STEP_MAX, STEP_MAX)
    return step[:, :3], step[:, 3:]


def triangulation_jacobian(camera: Camera, pixels: Floats, q_C: Floats) -> Floats:
    """d triangulate / d pixels, (n, 3, 4)."""
    disparity = pixels[:, 0] - pixels[:, 2]
    scale = camera.baseline_m / disparity
    J = np.zeros((len(pixels), 3, 4))
    J[:, :, 0] = -q_C / disparity[:, None]
    J[:, :, 2] = q_C / disparity[:, None]
    J[:, 0, 0] += scale
    J[:, 1, 1] = J[:, 1, 3] = 0.5 * scale * camera.fx_px / camera.fy_px
    return J


def pixel_sigma(seen: SeenPairs, camera: Camera, motion: Poses) -> float:
    """The pixels' noise as the two views of the points tell it, px; NaN with too few pairs.

    A pair's residual weighted by its covariance for unit noise is chi-square with four degrees of
    freedom; the median makes it robust. Only frames count whose motion has pairs enough.
    """
    enough = (seen.counts() >= 2 * PAIRS_MIN)[seen.frame]
    q = np.einsum("nij,nj->ni", motion.R[seen.frame], seen.q_C) + motion.p[seen.frame]
    good = enough & (q[:, 2] > DEPTH_MIN_M)
    if good.sum() < PAIRS_MIN:
        return float("nan")
    q, R = q[good], motion.R[seen.frame[good]]
    residual = seen.pixels[good] - project(camera, q)
    D = point_jacobian(camera, q)
    J = triangulation_jacobian(camera, seen.first_pixels[good], seen.q_C[good])
    from_first = D @ R @ J
    W = np.linalg.inv(np.eye(4) + from_first @ np.swapaxes(from_first, 1, 2))
    squared = np.einsum("na,nab,nb->n", residual, W, residual)
    return float(np.sqrt(np.median(squared) / CHI2_4_MEDIAN))
