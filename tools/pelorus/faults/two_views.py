# SPDX-License-Identifier: MIT
"""Estimates the camera's motion between two frames, with its covariance, from common tracks.

Both views of a point are measured with the same noise, and the point itself is unknown: motion and
points maximise the likelihood of all four pictures. A point is its left pixel and its disparity, so
that far points, whose disparity noise may take below zero, need not be left out; and every step
linearises at the point by both views together. Taking points from the first view alone, as
pelorus.tracking.visual_motion does, shortens every displacement by about 1 %, which is the size of
what is measured here.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from pelorus.io.tracks import Indices, Tracks, sum_by_frame
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.program.console import progress
from pelorus.tracking.second_view import NOISE, apply, inverse, linearised, measured, product
from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

ROW_GAP_MAX_PX = 4.0  # a rectified pair shows a point in one row; more is a bad match
ITERATIONS, WIDE_ITERATIONS = 8, 3
WIDE, NARROW = 10.0, 3.0  # sigmas that the weights of Geman and McClure accept
SIGMA_LEAST_PX = 0.02
RIDGE = 1e-3  # keeps frames without observations solvable
STEP_MAX = 1.0  # m and rad an iteration
CHI2_3_MEDIAN = 2.366
KEPT = 8  # results
FAR_OFF = 50.0  # d^2 beyond which a point stays where the first view has it


@dataclass(frozen=True)
class TwoViews:
    """The motion between frames k and k + lag.

    `motion` maps coordinates in camera k to camera k + lag, with the covariance of a small step on
    its left. `d2` is for each pair of observations, of three degrees of freedom, in units of
    sigma_px.
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
    """Estimates all motions at once, by Gauss-Newton with robust weights.

    The results of the last pictures are kept: many faults are looked for in the same ones.
    """
    digest = sha256(repr((camera, lag, tracks.frame_count)).encode())
    for column in (tracks.frame, tracks.id, tracks.pixels):
        digest.update(np.ascontiguousarray(column).data)
    key = digest.digest()
    found = _known.pop(key, None)
    _known[key] = found = _estimated(tracks, camera, lag) if found is None else found
    while len(_known) > KEPT:
        del _known[next(iter(_known))]
    return found


def _estimated(tracks: Tracks, camera: Camera, lag: int) -> TwoViews:
    pairs = tracks.pairs(lag)
    rows = np.abs(tracks.pixels[:, 1] - tracks.pixels[:, 3]) < ROW_GAP_MAX_PX
    good = rows[pairs.first] & rows[pairs.second]
    frame, first, second = pairs.frame[good], pairs.first[good], pairs.second[good]
    count = max(tracks.frame_count - lag, 0)
    solver = _Solver(camera, frame, count, tracks.pixels[first], tracks.pixels[second])
    for k in progress(range(ITERATIONS), "camera motion", ITERATIONS):
        solver.step(WIDE if k < WIDE_ITERATIONS else NARROW)
    found = TwoViews(
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
    for shared in (*found.motion, *vars(found).values()):
        if isinstance(shared, np.ndarray):
            shared.flags.writeable = False
    return found


_known: dict[bytes, TwoViews] = {}  # by a digest of the pictures


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
        """Moves all motions by one step, then the points."""
        frame = self._frame
        R, p = np.moveaxis(self.R, 0, -1)[..., frame], self.p.T[:, frame]
        h, Jx, J = linearised(self._camera, self._x, R, p)
        noisy = np.einsum("ijn,jk->ikn", Jx, NOISE)
        e = self._second - h - apply(Jx, self._first - self._x)
        W = inverse(product(noisy, Jx.swapaxes(0, 1)) + NOISE[:, :, None])
        d2 = np.maximum(np.sum(e * apply(W, e), axis=0), 0.0)
        weight = 1 / (1 + d2 / (3 * (accepts * self.sigma) ** 2)) ** 2
        JW = product(J.swapaxes(0, 1), W * weight)
        self.H = self._sums(product(JW, J)) + RIDGE * np.eye(6)
        g = self._sums(apply(JW, e))
        step = np.clip(np.linalg.solve(self.H, g[..., None])[..., 0], -STEP_MAX, STEP_MAX)
        moved = se3.compose(se3.exp(step[:, :3], step[:, 3:]), Poses(self.R, self.p))
        self.R, self.p = moved
        left = e - apply(J, step.T[:, frame])
        better = self._first + apply(noisy.swapaxes(0, 1), apply(W, left))
        near = d2 < FAR_OFF * self.sigma**2
        self._x = np.where(near, better, self._first)
        self.d2 = d2
        if len(d2):
            self.sigma = max(float(np.sqrt(np.median(d2) / CHI2_3_MEDIAN)), SIGMA_LEAST_PX)

    def _sums(self, values: Floats) -> Floats:
        """Returns the sums (count, ...) by frame of values (..., n)."""
        return sum_by_frame(self._frame, self._count, np.moveaxis(values, -1, 0))
