# SPDX-License-Identifier: MIT
"""Predicts points of one frame in another, as left pixel and disparity, with derivatives.

A rectified pair has a point in one row, so that its four pixels are three numbers: the rows differ
by noise alone, which contains nothing of the motion.
"""

from __future__ import annotations

import numpy as np

from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

# Covariance of (uL, v, disparity) with v the mean of both rows, for pixels of unit noise; its
# pivots.
NOISE = np.array([[1.0, 0.0, 1.0], [0.0, 0.5, 0.0], [1.0, 0.0, 2.0]])
PIVOTS = (1.0, 0.5, 1.0)


def measured(camera: Camera, pixels: Floats) -> Floats:
    """Returns (uL, v, disparity) relative to the principal point, px."""
    u, v = pixels[:, 0] - camera.cx_px, 0.5 * (pixels[:, 1] + pixels[:, 3]) - camera.cy_px
    return np.stack((u, v, pixels[:, 0] - pixels[:, 2]), axis=-1)


def predicted(camera: Camera, x: Floats, R: Floats, p: Floats) -> Floats:
    """Returns points x (n, 3) of the first view in the second, (n, 3)."""
    return linearised(camera, x.T, np.moveaxis(R, 0, -1), p.T)[0].T


# From here on the points are the last axis: numpy takes many small matrices one by one, but here
# each element for all points at once.


def linearised(camera: Camera, x: Floats, R: Floats, p: Floats) -> tuple[Floats, Floats, Floats]:
    """Returns points x (3, n) of the first view in the second, h (3, n), with derivatives.

    These are dh/dx (3, 3, n) and dh/d motion (3, 6, n), without NaN even behind the camera.
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


def inverse(S: Floats) -> Floats:
    """Inverts symmetric S (3, 3, n), NOISE or larger, by L D L^T.

    No pivot is taken smaller than NOISE's. A point of nearly unknown depth makes S so large that
    rounding alone would make pivots negative, and d^2 with them.
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


def apply(A: Floats, x: Floats) -> Floats:
    """Returns A x, of (i, j, n) and (j, n)."""
    return np.asarray(np.einsum("ijn,jn->in", A, x))


def product(A: Floats, B: Floats) -> Floats:
    """Returns A B, of (i, j, n) and (j, k, n)."""
    return np.asarray(np.einsum("ijn,jkn->ikn", A, B))
