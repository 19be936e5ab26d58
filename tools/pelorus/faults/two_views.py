# SPDX-License-Identifier: MIT
"""The camera's motion between two frames, and how well it is known, from their common tracks.

Both views of a point are measured with the same noise, and the point itself is unknown: motion and
points are those that make all four pictures likeliest. A point is its left pixel and its disparity,
so that far points, whose disparity noise may take below zero, need not be left out; and every step
linearises where both views together have the point. To take points from the first view alone, as
pelorus.visual_motion does, makes every way about 1 % too short: that is what is measured here.
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
from pelorus.tracks import Indices, Tracks, sum_by_frame

ROW_GAP_MAX_PX = 4.0  # a rectified pair shows a point in one row; more is a bad match
ITERATIONS, WIDE_ITERATIONS = 8, 3
WIDE, NARROW = 10.0, 3.0  # sigmas that the weights of Geman and McClure accept
SIGMA_LEAST_PX = 0.02
RIDGE = 1e-3  # keeps frames without observations solvable
STEP_MAX = 1.0  # m and rad an iteration
CHI2_3_MEDIAN = 2.366
FAR_OFF = 50.0  # d^2 beyond which a point stays where the first view has it
# Of (uL, v, disparity) with v the mean of both rows, for pixels of unit noise; and its pivots.
NOISE = np.array([[1.0, 0.0, 1.0], [0.0, 0.5, 0.0], [1.0, 0.0, 2.0]])
PIVOTS = (1.0, 0.5, 1.0)


@dataclass(frozen=True)
class TwoViews:
    """For each k the motion that brings coordinates in camera k to camera k + lag, with the
    covariance of a small step on its left; and for each pair of observations its d^2 in that
    motion, of three degrees of freedom and in units of sigma_px.
    """

    lag: int
    motion: Poses
    covariance: Floats  # (k, 6, 6): metres, radians
    counts: NDArray[np.int64]
    sigma_px: float
    frame: Indices
    first: Indices  # row of the tracks
    second: Indices
    d2: Floats


def two_views(tracks: Tracks, camera: Camera, lag: int) -> TwoViews:
    """Gauss-Newton with robust weights, all frames at once."""
    pairs = tracks.pairs(lag)
    rows = np.abs(tracks.pixels[:, 1] - tracks.pixels[:, 3]) < ROW_GAP_MAX_PX
    good = rows[pairs.first] & rows[pairs.second]
    frame, first, second = pairs.frame[good], pairs.first[good], pairs.second[good]
    count = max(tracks.frame_count - lag, 0)
    solver = _Solver(camera, frame, count, tracks.pixels[first], tracks.pixels[second])
    for k in progress(range(ITERATIONS), "camera motion", ITERATIONS):
        solver.step(WIDE if k < WIDE_ITERATIONS else NARROW)
    return TwoViews(
        lag,
        Poses(se3.nearest_rotation(solver.R), solver.p),
        np.asarray(np.linalg.inv(solver.H) * solver.sigma**2, np.float64),
        np.bincount(frame, minlength=count),
        solver.sigma,
        frame,
        first,
        second,
        solver.d2 / solver.sigma**2,
    )


def measured(camera: Camera, pixels: Floats) -> Floats:
    """(uL, v, disparity) beside the principal point, px."""
    u, v = pixels[:, 0] - camera.cx_px, 0.5 * (pixels[:, 1] + pixels[:, 3]) - camera.cy_px
    return np.stack((u, v, pixels[:, 0] - pixels[:, 2]), axis=-1)


def predicted(camera: Camera, x: Floats, R: Floats, p: Floats) -> Floats:
    """Where points x (n, 3) of the first view stand in the second, (n, 3)."""
    return _linearised(camera, x.T, np.moveaxis(R, 0, -1), p.T)[0].T


# From here on the points are the last axis: of many small matrices numpy takes one by one, of these
# each element for all points at once.


def _linearised(camera: Camera, x: Floats, R: Floats, p: Floats) -> tuple[Floats, Floats, Floats]:
    """Where points x (3, n) of the first view stand in the second, h (3, n); dh/dx (3, 3, n); and
    dh/d motion (3, 6, n), NaN-free even behind the camera.
    """
    focal = np.array([camera.fx_px, camera.fy_px, camera.fx_px * camera.baseline_m])
    inverse_depth = x[2] / focal[2]
    q = R[:, 0] * (x[0] / focal[0]) + R[:, 1] * (x[1] / focal[1]) + R[:, 2] + inverse_depth * p
    z = np.where(np.abs(q[2]) < 1e-3, 1e-3, q[2])
    h = focal[:, None] * np.stack((q[0], q[1], inverse_depth)) / z
    by_x, by_y, by_z = focal[0] / z, focal[1] / z, -h / z  # dh/dq: the first two of one row each
    to_x = (R[:, 0] / focal[0], R[:, 1] / focal[1], p / focal[2])  # dq/dx
    Jx = np.stack([by_z * column[2] for column in to_x], axis=1)
    for k, column in enumerate(to_x):
        Jx[0, k] += by_x * column[0]
        Jx[1, k] += by_y * column[1]
    Jx[2, 2] += 1 / z
    J = np.zeros((3, 6, len(z)))
    J[0, 0], J[1, 1], J[:, 2] = by_x, by_y, by_z
    J[:, :3] *= inverse_depth
    J[:, 3], J[:, 4] = by_z * q[1], -by_z * q[0]
    J[0, 4] += by_x * q[2]
    J[0, 5] = -by_x * q[1]
    J[1, 3] -= by_y * q[2]
    J[1, 5] = by_y * q[0]
    return h, Jx, J


def _inverse(S: Floats) -> Floats:
    """Of symmetric (3, 3, n) that are NOISE and more: by L D L^T, whose pivots are no smaller than
    those of NOISE. A point that is hardly known in depth makes S so large that rounding alone would
    make them negative, and its d^2.
    """
    (a, b, c), (_, d, e), (_, _, f) = S
    l10, l20 = b / a, c / a
    p1 = np.maximum(d - l10 * b, PIVOTS[1])
    l21 = (e - l20 * b) / p1
    p2 = np.maximum(f - l20 * c - l21 * l21 * p1, PIVOTS[2])
    m20 = l10 * l21 - l20  # of L^-1
    W = np.empty_like(S)
    W[2, 2] = 1 / p2
    W[1, 2] = W[2, 1] = -l21 / p2
    W[0, 2] = W[2, 0] = m20 / p2
    W[1, 1] = 1 / p1 + l21 * l21 / p2
    W[0, 1] = W[1, 0] = -l10 / p1 - l21 * m20 / p2
    W[0, 0] = 1 / a + l10 * l10 / p1 + m20 * m20 / p2
    return W


def _apply(A: Floats, x: Floats) -> Floats:
    """A x, of (i, j, n) and (j, n)."""
    return np.asarray(np.einsum("ijn,jn->in", A, x))


def _product(A: Floats, B: Floats) -> Floats:
    """A B, of (i, j, n) and (j, k, n)."""
    return np.asarray(np.einsum("ijn,jkn->ikn", A, B))


class _Solver:
    """The state of the iteration."""

    def __init__(
        self, camera: Camera, frame: Indices, count: int, first: Floats, second: Floats
    ) -> None:
        self._camera, self._frame, self._count = camera, frame, count
        self._first, self._second = measured(camera, first).T, measured(camera, second).T
        self._x = self._first.copy()
        self.R, self.p = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
        self.H = np.tile(np.eye(6), (count, 1, 1))
        self.sigma = 1.0
        self.d2 = np.zeros(len(frame))

    def step(self, accepts: float) -> None:
        """All motions by one step, then the points."""
        frame = self._frame
        R, p = np.moveaxis(self.R, 0, -1)[..., frame], self.p.T[:, frame]
        h, Jx, J = _linearised(self._camera, self._x, R, p)
        noisy = np.einsum("ijn,jk->ikn", Jx, NOISE)
        e = self._second - h - _apply(Jx, self._first - self._x)
        W = _inverse(_product(noisy, Jx.swapaxes(0, 1)) + NOISE[:, :, None])
        d2 = np.maximum(np.sum(e * _apply(W, e), axis=0), 0.0)
        weight = 1 / (1 + d2 / (3 * (accepts * self.sigma) ** 2)) ** 2
        JW = _product(J.swapaxes(0, 1), W * weight)
        self.H = self._sums(_product(JW, J)) + RIDGE * np.eye(6)
        g = self._sums(_apply(JW, e))
        step = np.clip(np.linalg.solve(self.H, g[..., None])[..., 0], -STEP_MAX, STEP_MAX)
        moved = se3.compose(se3.exp(step[:, :3], step[:, 3:]), Poses(self.R, self.p))
        self.R, self.p = moved
        left = e - _apply(J, step.T[:, frame])
        better = self._first + _apply(noisy.swapaxes(0, 1), _apply(W, left))
        near = d2 < FAR_OFF * self.sigma**2
        self._x = np.where(near, better, self._first)
        self.d2 = d2
        if len(d2):
            self.sigma = max(float(np.sqrt(np.median(d2) / CHI2_3_MEDIAN)), SIGMA_LEAST_PX)

    def _sums(self, values: Floats) -> Floats:
        """Of (..., n) by frame, (count, ...)."""
        return sum_by_frame(self._frame, self._count, np.moveaxis(values, -1, 0))
