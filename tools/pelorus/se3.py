# SPDX-License-Identifier: MIT
"""Rigid motions in float64. All functions take stacks: leading axes are free.

A pose is a pair (R, p): R (..., 3, 3), p (..., 3) in metres; twists are (rho, theta), metres and
radians. Exp and Log are those of SE(3) (Barfoot, State Estimation for Robotics, chapter 7).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
SERIES_BELOW_RAD = 1e-2  # below it the closed coefficients lose digits to cancellation


class Poses(NamedTuple):
    """A stack of poses: R (..., 3, 3), p (..., 3)."""

    R: Floats
    p: Floats

    def at(self, index: int | slice | NDArray[np.intp] | NDArray[np.bool_]) -> Poses:
        return Poses(self.R[index], self.p[index])


def skew(x: ArrayLike) -> Floats:
    """[x]x, (..., 3) -> (..., 3, 3)."""
    x = np.asarray(x, float)
    out = np.zeros((*x.shape, 3))
    out[..., 2, 1] = x[..., 0]
    out[..., 0, 2] = x[..., 1]
    out[..., 1, 0] = x[..., 2]
    return out - np.swapaxes(out, -1, -2)


def _coefficients(angle: Floats) -> tuple[Floats, Floats, Floats]:
    """sin(a)/a, (1 - cos a)/a^2, (a - sin a)/a^3."""
    small = angle < SERIES_BELOW_RAD
    a = np.where(small, 1.0, angle)
    s = angle * angle
    return (
        np.where(small, 1 - s / 6 * (1 - s / 20 * (1 - s / 42)), np.sin(a) / a),
        np.where(small, 0.5 * (1 - s / 12 * (1 - s / 30 * (1 - s / 56))), (1 - np.cos(a)) / a**2),
        np.where(small, (1 - s / 20 * (1 - s / 42 * (1 - s / 72))) / 6, (a - np.sin(a)) / a**3),
    )


def so3_exp(theta: ArrayLike) -> Floats:
    """Rotation vector, rad (..., 3) -> rotation matrix (..., 3, 3)."""
    theta = np.asarray(theta, float)
    a, b, _ = _coefficients(np.linalg.norm(theta, axis=-1)[..., None, None])
    hat = skew(theta)
    return np.asarray(np.eye(3) + a * hat + b * (hat @ hat))


def so3_log(R: ArrayLike) -> Floats:
    """Rotation matrix (..., 3, 3) -> rotation vector, rad (..., 3)."""
    R = np.asarray(R, float)
    flat = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec()
    return np.asarray(flat.reshape(R.shape[:-1]))


def exp(rho: ArrayLike, theta: ArrayLike) -> Poses:
    """Exp(rho, theta) = (Exp theta, V rho)."""
    rho, theta = np.asarray(rho, float), np.asarray(theta, float)
    _, b, c = _coefficients(np.linalg.norm(theta, axis=-1)[..., None, None])
    hat = skew(theta)
    V = np.eye(3) + b * hat + c * (hat @ hat)
    return Poses(so3_exp(theta), np.einsum("...ij,...j->...i", V, rho))


def log(T: Poses) -> Floats:
    """The twist (..., 6) in the order (rho, theta) with Exp of it = T."""
    theta = so3_log(T.R)
    _, b, c = _coefficients(np.linalg.norm(theta, axis=-1)[..., None, None])
    hat = skew(theta)
    V = np.eye(3) + b * hat + c * (hat @ hat)
    rho = np.linalg.solve(V, T.p[..., None])[..., 0]
    return np.concatenate((rho, theta), axis=-1)


def inverse(T: Poses) -> Poses:
    """T^-1."""
    Rt = np.swapaxes(T.R, -1, -2)
    return Poses(Rt, -np.einsum("...ij,...j->...i", Rt, T.p))


def compose(A: Poses, B: Poses) -> Poses:
    """A B."""
    return Poses(A.R @ B.R, apply(A, B.p))


def apply(T: Poses, s: Floats) -> Floats:
    """R s + p."""
    return np.asarray(np.einsum("...ij,...j->...i", T.R, s) + T.p)


def nearest_rotation(M: ArrayLike) -> Floats:
    """The rotation closest to M in the Frobenius norm."""
    u, _, vt = np.linalg.svd(np.asarray(M, float))
    u[..., :, 2] *= np.linalg.det(u @ vt)[..., None]
    return np.asarray(u @ vt)


def quaternion(R: ArrayLike) -> Floats:
    """(..., 3, 3) -> (..., 4) in the order x y z w."""
    R = np.asarray(R, float)
    flat = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat()
    return np.asarray(flat.reshape(*R.shape[:-2], 4))


def from_quaternion(q: ArrayLike) -> Floats:
    """(n, 4) in the order x y z w -> (n, 3, 3)."""
    return np.asarray(Rotation.from_quat(np.asarray(q, float)).as_matrix())
