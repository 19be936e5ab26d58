# SPDX-License-Identifier: MIT
"""Tracks held to the patch of their birth, which is what keeps them from drifting.

From one picture to the next a point is found to some tenth of a pixel, and followed so from frame
to frame it wanders, for the errors add up. So each is found once more, by the patch that it had
when it was born, under an affine change of shape, for what comes closer grows and turns, and a
change of brightness and contrast. Inverse compositional, as in Baker and Matthews, Lucas-Kanade 20
years on, 2004, all patches at once. A patch that has grown or shrunk by too much is cut anew where
it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pelorus.program.extras import cv2
from pelorus.tracking.images import Gray
from pelorus.wire.layout import Floats

from opencv_tracker.matching import Mask, Points

SMOOTH_PX = 0.8  # so that the values between pixels are what their neighbours say
ITERATIONS = 12
STILL_PX = 0.003  # a smaller step is none
GREY_SIGMA = 4.0  # of what no change of shape explains
# what a step may be, by its sigma: u, v in px; shape (4); brightness and contrast in parts and grey
STEP = np.array([1.0, 1.0, 0.05, 0.05, 0.05, 0.05, 0.2, 20.0])
STEP_MOST = np.array([2.0, 2.0, 0.3, 0.3, 0.3, 0.3, np.inf, np.inf])
INSIDE_LEAST = 0.6  # of a patch that must be in the picture
SCALES = (0.67, 1.5)  # beyond which a patch is cut anew


class Patches(NamedTuple):
    """grey (n, w^2) as at birth; J (n, w^2, 8) its derivatives; A (n, 2, 2) its shape by now."""

    grey: Floats
    J: Floats
    A: Floats

    def where(self, chosen: Mask | NDArray[np.intp]) -> Patches:
        return Patches(self.grey[chosen], self.J[chosen], self.A[chosen])


class Refined(NamedTuple):
    """points (n, 2) and patches as they are now; likeness (n,): normalised correlation."""

    points: Floats
    patches: Patches
    likeness: Floats


def smooth(image: Gray) -> Floats:
    """What patches are cut from and found in."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), SMOOTH_PX).astype(np.float64))


def grid(window_px: int) -> Floats:
    """The pixels of a patch about its middle, (w^2, 2)."""
    half = window_px // 2
    v, u = np.mgrid[-half : half + 1, -half : half + 1]
    return np.stack((u.ravel(), v.ravel()), axis=-1).astype(np.float64)


def cut(image: Floats, points: Points, window_px: int) -> Patches:
    """The patches about the points."""
    x = grid(window_px)
    at = points[:, None, :].astype(np.float64) + x
    grey = _sample(image, at)
    right, below = np.eye(2)
    du = 0.5 * (_sample(image, at + right) - _sample(image, at - right))
    dv = 0.5 * (_sample(image, at + below) - _sample(image, at - below))
    middle = grey - grey.mean(axis=1, keepdims=True)
    J = (du, dv, du * x[:, 0], du * x[:, 1], dv * x[:, 0], dv * x[:, 1], middle, 0 * grey + 1)
    return Patches(grey, np.stack(J, axis=-1), np.tile(np.eye(2), (len(points), 1, 1)))


def joined(first: Patches, second: Patches) -> Patches:
    """One after the other."""
    return Patches(*(np.concatenate(both) for both in zip(first, second, strict=True)))


def find(image: Floats, patches: Patches, points: Points, window_px: int) -> Refined:
    """Where the patches are, near the points."""
    x, A, c = grid(window_px), patches.A.copy(), points.astype(np.float64)
    if not len(points):
        return Refined(c, patches, np.zeros(0))
    ridge = np.diag((GREY_SIGMA / STEP) ** 2)
    active = np.arange(len(points))
    for _ in range(ITERATIONS):
        some = patches.where(active)
        seen, inside = _seen(image, A[active], c[active], x)
        JW = np.swapaxes(some.J * inside[..., None], 1, 2)
        expected = JW @ (seen - some.grey)[..., None]
        step = np.linalg.solve(JW @ some.J + ridge, expected)[..., 0]
        step[:, :6] /= np.maximum(1 + step[:, 6:7], 0.3)  # contrast steepens all slopes alike
        step = np.clip(step, -STEP_MOST, STEP_MOST)
        A[active] = A[active] @ np.linalg.inv(np.eye(2) + step[:, 2:6].reshape(-1, 2, 2))
        c[active] -= (A[active] @ step[:, :2, None])[..., 0]
        active = active[np.abs(step[:, :2]).max(axis=1) >= STILL_PX]
        if not len(active):
            break
    seen, inside = _seen(image, A, c, x)
    likeness = _likeness(seen, patches.grey, inside)
    return Refined(c, patches._replace(A=A), likeness)


def renewed(patches: Patches, image: Floats, points: Points, window_px: int) -> Patches:
    """With those cut anew that have grown or shrunk by too much: their pixels show other things."""
    length = np.linalg.svd(patches.A, compute_uv=False)
    outgrown = np.nonzero((length[:, 0] > SCALES[1]) | (length[:, 1] < SCALES[0]))[0]
    anew = cut(image, points[outgrown], window_px)
    for old, new in zip(patches, anew, strict=True):
        old[outgrown] = new
    return patches


def _seen(image: Floats, A: Floats, c: Floats, x: Floats) -> tuple[Floats, Floats]:
    """(n, w^2): what is there now, and 1 where that is in the picture."""
    at = c[:, None, :] + x @ np.swapaxes(A, 1, 2)
    rows, columns = image.shape
    inside = (at >= 0).all(axis=2) & (at[..., 0] <= columns - 1) & (at[..., 1] <= rows - 1)
    return _sample(image, at), inside.astype(np.float64)


def _likeness(seen: Floats, grey: Floats, inside: Floats) -> Floats:
    count = np.maximum(inside.sum(axis=1, keepdims=True), 1)
    a = (seen - (seen * inside).sum(axis=1, keepdims=True) / count) * inside
    b = (grey - (grey * inside).sum(axis=1, keepdims=True) / count) * inside
    scale = np.sqrt((a * a).sum(axis=1) * (b * b).sum(axis=1))
    likeness = (a * b).sum(axis=1) / np.maximum(scale, 1e-9)
    return np.asarray(np.where(count[:, 0] < INSIDE_LEAST * inside.shape[1], 0.0, likeness))


def _sample(image: Floats, at: Floats) -> Floats:
    """Between the pixels by their four neighbours; beyond the edge as at it."""
    rows, columns = image.shape
    at = np.nan_to_num(at)
    u = np.clip(at[..., 0], 0, columns - 1.001)
    v = np.clip(at[..., 1], 0, rows - 1.001)
    i, j = v.astype(np.intp), u.astype(np.intp)
    dv, du = v - i, u - j
    flat, at_first = image.ravel(), i * columns + j
    top = flat[at_first] * (1 - du) + flat[at_first + 1] * du
    below = flat[at_first + columns] * (1 - du) + flat[at_first + columns + 1] * du
    return np.asarray(top * (1 - dv) + below * dv)
