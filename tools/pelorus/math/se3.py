# SPDX-License-Identifier: MIT
"""Rigid motions in float64, one or a stack of them.

A pose is a pair (R, p), in metres: the very numbers that a file has and that the simulator made.
scipy's RigidTransform changes four of five rotations in the last bit. Exp and Log of SE(3) are
its own (Barfoot, State Estimation for Robotics, chapter 7). Twists are (rho, theta), metres and
radians.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from pelorus.wire.layout import Floats


class Poses(NamedTuple):
    """A stack of poses: R (..., 3, 3), p (..., 3)."""

    R: Floats
    p: Floats

    @classmethod
    def of_quaternions(cls, q: ArrayLike, p: Floats) -> Poses:
        """Returns the poses of quaternions (..., 4), x y z w."""
        return cls(np.asarray(scipy.spatial.transform.Rotation.from_quat(q).as_matrix()), p)

    def at(self, index: int | slice | NDArray[np.intp] | NDArray[np.bool_]) -> Poses:
        return Poses(self.R[index], self.p[index])


IDENTITY = Poses(np.eye(3), np.zeros(3))


def skew(x: ArrayLike) -> Floats:
    """Returns [x]x, (..., 3) -> (..., 3, 3)."""
    x = np.asarray(x, float)
    out = np.zeros((*x.shape, 3))
    out[..., 2, 1] = x[..., 0]
    out[..., 0, 2] = x[..., 1]
    out[..., 1, 0] = x[..., 2]
    return out - np.swapaxes(out, -1, -2)


def exp(rho: ArrayLike, theta: ArrayLike) -> Poses:
    """Returns Exp(rho, theta) = (Exp theta, V rho)."""
    T = scipy.spatial.transform.RigidTransform.from_exp_coords(
        np.concatenate((theta, rho), axis=-1)
    )
    return Poses(T.rotation.as_matrix(), T.translation)


def log(T: Poses) -> Floats:
    """Returns the twist (..., 6) in the order (rho, theta) with Exp of it = T."""
    rigid = scipy.spatial.transform.RigidTransform.from_components(
        T.p, scipy.spatial.transform.Rotation.from_matrix(T.R)
    )
    return np.roll(rigid.as_exp_coords(), 3, axis=-1)  # scipy's order is (theta, rho)


def inverse(T: Poses) -> Poses:
    """Returns T^-1."""
    Rt = np.swapaxes(T.R, -1, -2)
    return Poses(Rt, -np.einsum("...ij,...j->...i", Rt, T.p))


def compose(A: Poses, B: Poses) -> Poses:
    """Returns A B."""
    return Poses(A.R @ B.R, apply(A, B.p))


def conjugate(T: Poses, A: Poses) -> Poses:
    """Returns T A T^-1: the motion A as seen in the axes that T leads to."""
    return compose(T, compose(A, inverse(T)))


def apply(T: Poses, s: Floats) -> Floats:
    """Returns R s + p."""
    return np.asarray(np.einsum("...ij,...j->...i", T.R, s) + T.p)


def nearest_rotation(M: ArrayLike) -> Floats:
    """Returns the rotation closest to M in the Frobenius norm."""
    u, _, vt = np.linalg.svd(np.asarray(M, float))
    u[..., :, 2] *= np.linalg.det(u @ vt)[..., None]
    return np.asarray(u @ vt)
