# SPDX-License-Identifier: MIT
"""Reprojection residuals of a frame's points, with landmarks from the frames before.

Each point is triangulated anew from the frames just before, at the poses that the filter had then,
and projected at the frame's own pose. So a residual is that frame's alone: it depends neither on
what the filter learnt later of the landmark nor on a common drift. At rest it is the pixel noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.explain.log import FilterLog
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.wire.layout import Floats

BEFORE = 10  # frames
SEEN_LEAST = 3  # views among them
FAR_PX = 20.0  # a larger one is a wrong match
NEAR_M = 1e-2
REFINED = 3  # steps of Gauss-Newton
FRAMES_MOST = 150  # evenly over the log


class Residuals(NamedTuple):
    """Residuals of n observations: `pixels` (n, 4) as in STEREO, and `off` (n, 4), seen minus
    expected.
    """

    pixels: Floats
    off: Floats


class _View(NamedTuple):
    """Points of an earlier frame, by their numbers in the examined frame."""

    point: NDArray[np.intp]
    pixels: Floats
    T_CW: Poses


NOTHING = Residuals(np.empty((0, 4)), np.empty((0, 4)))


def residuals_of(log: FilterLog, k: int) -> Residuals:
    """Returns the residuals of frame k."""
    own = _camera_pose(log, k)
    frames = [j for j in range(max(k - BEFORE, 0), k) if log.poses[j] is not None]
    if own is None or len(frames) < SEEN_LEAST:
        return NOTHING
    ids = log.frames[k].ids.astype(np.int64)
    views = [_view(log, j, ids) for j in frames]
    sums = _Sums(len(ids))
    for view in views:
        sums.add(view.point, _rows(log, view))
    p_W, told = sums.solved()
    for _ in range(REFINED):  # the linear solution is too near, for its rows contain the noise
        sums = _Sums(len(ids))
        for view in views:
            sums.add(view.point, _about(log, view, p_W[view.point]))
        p_W = p_W + np.where(told[:, None], sums.solved()[0], 0.0)
    seen = log.frames[k].pixels.astype(np.float64)
    off = seen - _projected(log, p_W, own)
    with np.errstate(invalid="ignore"):
        near = told & np.isfinite(off).all(axis=1) & (np.abs(off) <= FAR_PX).all(axis=1)
    return Residuals(seen[near], off[near])


def residuals(log: FilterLog) -> Residuals:
    """Returns the residuals of frames evenly over the log."""
    count = len(log.frames)
    chosen = np.unique(np.linspace(0, count - 1, min(FRAMES_MOST, count)).round().astype(int))
    return _joined([residuals_of(log, int(k)) for k in chosen])


def _joined(parts: Sequence[Residuals]) -> Residuals:
    if not parts:
        return NOTHING
    return Residuals(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


class _Sums:
    """Normal equations of many points, three unknowns each."""

    def __init__(self, count: int) -> None:
        self._N = np.zeros((count, 3, 3))
        self._b = np.zeros((count, 3))
        self._times = np.zeros(count, np.int64)

    def add(self, point: NDArray[np.intp], rows: tuple[Floats, Floats]) -> None:
        A, y = rows
        np.add.at(self._N, point, np.einsum("nri,nrj->nij", A, A))
        np.add.at(self._b, point, np.einsum("nri,nr->ni", A, y))
        np.add.at(self._times, point, 1)

    def solved(self) -> tuple[Floats, NDArray[np.bool_]]:
        """Returns (n, 3) points, and which are known."""
        told = (self._times >= SEEN_LEAST) & (np.linalg.det(self._N) > 0)
        N = np.where(told[:, None, None], self._N, np.eye(3))
        p = np.linalg.solve(N, self._b[:, :, None])[:, :, 0]
        return p.astype(np.float64), np.asarray(told)


def _camera_pose(log: FilterLog, k: int) -> Poses | None:
    """Returns world to left camera."""
    pose = log.poses[k]
    if pose is None:
        return None
    T_CB = Poses(np.asarray(log.header.R_CB), np.asarray(log.header.t_CB_m))
    T_WB = Poses(np.asarray(pose.R_WB, np.float64), np.asarray(pose.p_WB_m, np.float64))
    return se3.compose(T_CB, se3.inverse(T_WB))


def _view(log: FilterLog, j: int, ids: NDArray[np.int64]) -> _View:
    T_CW = _camera_pose(log, j)
    assert T_CW is not None
    _, at, there = np.intersect1d(ids, log.frames[j].ids.astype(np.int64), return_indices=True)
    pixels = log.frames[j].pixels.astype(np.float64)[there]
    good = np.isfinite(pixels).all(axis=1) & (pixels[:, 0] > pixels[:, 2])
    return _View(at[good], pixels[good], T_CW)


def _rows(log: FilterLog, view: _View) -> tuple[Floats, Floats]:
    """Returns (n, 4, 3) and (n, 4): linear equations of the point by uL, vL, uR and vR, in
    pixels.
    """
    camera, pixels, T_CW = log.header.camera, view.pixels, view.T_CW
    z = camera.fx_px * camera.baseline_m / (pixels[:, 0] - pixels[:, 2])
    focal = np.array([camera.fx_px, camera.fy_px, camera.fx_px, camera.fy_px])
    ray = (pixels - [camera.cx_px, camera.cy_px, camera.cx_px, camera.cy_px]) / focal
    first = np.array([0, 1, 0, 1])  # axis of each
    shift = np.array([0.0, 0.0, camera.baseline_m, 0.0])  # shift of the right camera along x
    weight = focal / z[:, None]
    A: Floats = (T_CW.R[first] - ray[:, :, None] * T_CW.R[2]) * weight[:, :, None]
    y: Floats = (ray * T_CW.p[2] - T_CW.p[first] + shift) * weight
    return A, y


def _about(log: FilterLog, view: _View, p_W: Floats) -> tuple[Floats, Floats]:
    """Returns (n, 4, 3) the pixels' derivatives by the point, and (n, 4) seen minus expected.

    Zero where the point is behind the camera.
    """
    camera = log.header.camera
    x, y, z = se3.apply(view.T_CW, p_W).T
    good = z > NEAR_M
    z = np.where(good, z, 1.0)
    fx, fy, zero = camera.fx_px / z, camera.fy_px / z, np.zeros_like(z)
    rows = [
        (fx, zero, -fx * x / z),
        (zero, fy, -fy * y / z),
        (fx, zero, -fx * (x - camera.baseline_m) / z),
        (zero, fy, -fy * y / z),
    ]
    J = np.stack([np.stack(row, axis=-1) for row in rows], axis=1) @ view.T_CW.R
    off = view.pixels - _projected(log, p_W, view.T_CW)
    keep = good & (np.abs(np.nan_to_num(off, nan=np.inf)) <= FAR_PX).all(axis=1)
    return J * keep[:, None, None], np.where(keep[:, None], off, 0.0)


def _projected(log: FilterLog, p_W: Floats, T_CW: Poses) -> Floats:
    camera = log.header.camera
    x, y, z = se3.apply(T_CW, p_W).T
    z = np.where(z > NEAR_M, z, np.nan)
    u, v = camera.fx_px * x / z + camera.cx_px, camera.fy_px * y / z + camera.cy_px
    return np.stack((u, v, u - camera.fx_px * camera.baseline_m / z, v), axis=-1)
