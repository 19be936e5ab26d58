# SPDX-License-Identifier: MIT
"""The figures of a trajectory against a reference, as the design defines them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pelorus import se3
from pelorus.errors import PelorusError
from pelorus.se3 import Floats, Poses
from pelorus.trajectory import Trajectory

POSES_MIN = 3  # three points fix a rigid fit


@dataclass(frozen=True)
class Figures:
    """err0_m: RMS position error with the first poses aligned; rot_deg: RMS angle likewise;

    ate_m: RMS position error after the best rigid fit.
    """

    err0_m: float
    ate_m: float
    rot_deg: float
    poses: int
    path_m: float


def match(
    estimate: Trajectory, truth: Trajectory, tolerance_ns: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of the poses of equal time, each truth used once."""
    right = np.clip(np.searchsorted(truth.t_ns, estimate.t_ns), 1, max(len(truth.t_ns) - 1, 1))
    right = np.minimum(right, len(truth.t_ns) - 1)
    left = np.maximum(right - 1, 0)
    closer = estimate.t_ns - truth.t_ns[left] <= truth.t_ns[right] - estimate.t_ns
    nearest = np.where(closer, left, right)
    good = np.nonzero(np.abs(truth.t_ns[nearest] - estimate.t_ns) <= tolerance_ns)[0]
    _, first = np.unique(nearest[good], return_index=True)
    return good[first], nearest[good[first]]


def compare(
    estimate: Trajectory, truth: Trajectory, tolerance_ns: int, names: tuple[Path, Path]
) -> Figures:
    """All figures over the poses of equal time."""
    mine, theirs = match(estimate, truth, tolerance_ns)
    if len(mine) < POSES_MIN:
        raise PelorusError(
            f"{names[0]}: {len(mine)} of its {len(estimate.t_ns)} poses "
            f"({_span(estimate)}) have a pose of equal time among the {len(truth.t_ns)} of "
            f"{names[1]} ({_span(truth)}); {POSES_MIN} are due"
        )
    return figures(estimate.poses.at(mine), truth.poses.at(theirs))


def figures(estimate: Poses, truth: Poses) -> Figures:
    """Pose k of one against pose k of the other."""
    start = se3.compose(estimate.at(0), se3.inverse(truth.at(0)))
    aligned = se3.compose(start, truth)
    turn = se3.so3_log(np.swapaxes(estimate.R, 1, 2) @ aligned.R)
    fitted = se3.apply(rigid_fit(truth.p, estimate.p), truth.p)
    return Figures(
        err0_m=rms(estimate.p - aligned.p),
        ate_m=rms(estimate.p - fitted),
        rot_deg=float(np.degrees(rms(turn))),
        poses=len(estimate.p),
        path_m=float(np.linalg.norm(np.diff(estimate.p, axis=0), axis=1).sum()),
    )


def rigid_fit(source: Floats, target: Floats) -> Poses:
    """The rigid motion, no scale, with the least squared distance of (n, 3) to (n, 3).

    Umeyama, Least-squares estimation of transformation parameters between two point patterns, 1991.
    """
    middle_source, middle_target = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((target - middle_target).T @ (source - middle_source))
    R = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return Poses(R, middle_target - R @ middle_source)


def step_change(poses: Poses) -> float:
    """How erratic a trajectory is: RMS change of the body's step from one pose to the next, m."""
    steps = np.einsum("nij,ni->nj", poses.R[:-1], np.diff(poses.p, axis=0))
    return rms(np.diff(steps, axis=0)) if len(steps) > 1 else 0.0


def rms(errors: Floats) -> float:
    """Root of the mean squared norm of the rows."""
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=-1))))


def _span(trajectory: Trajectory) -> str:
    return f"{trajectory.t_ns[0] * 1e-9:.3f} to {trajectory.t_ns[-1] * 1e-9:.3f} s"
