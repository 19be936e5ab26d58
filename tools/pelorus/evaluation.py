# SPDX-License-Identifier: MIT
"""The figures of a result against a reference: trajectory, covariance, map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pelorus import se3
from pelorus.errors import PelorusError
from pelorus.frames import Config, Landmark, Message, Role
from pelorus.layout import Floats, unpack_symmetric
from pelorus.motion import Times
from pelorus.se3 import Poses
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
    turn = Rotation.from_matrix(np.swapaxes(estimate.R, 1, 2) @ aligned.R).as_rotvec()
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


class Accuracy(NamedTuple):
    """At the frames with truth. The error e = Log(T^-1 A T_true), (rho, theta), m and rad (n, 6);
    A = T_0 T_true_0^-1 brings the truth to the estimate's start; sigma (n, 6);
    nees = e^T P^-1 e / 6 (n,), NaN at the first frame and where P is not positive.
    """

    t_ns: Times
    error: Floats
    sigma: Floats
    nees: Floats
    A: Poses
    truth: Poses  # A T_true


def assess(estimate: Trajectory, covariance: Floats, truth: Trajectory) -> Accuracy | None:
    """None if no pose has a truth of equal time."""
    mine, theirs = match(estimate, truth, 0)
    if not len(mine):
        return None
    T, P, T_true = estimate.poses.at(mine), covariance[mine], truth.poses.at(theirs)
    A = se3.compose(T.at(0), se3.inverse(T_true.at(0)))
    aligned = se3.compose(A, T_true)
    error = se3.log(se3.compose(se3.inverse(T), aligned))
    sigma = np.sqrt(np.clip(np.diagonal(P, axis1=1, axis2=2), 0, None))
    return Accuracy(estimate.t_ns[mine], error, sigma, nees_per_dof(error, P), A, aligned)


def nees_per_dof(error: Floats, P: Floats) -> Floats:
    """The first frame says nothing: its error is zero by the alignment."""
    out = np.full(len(error), np.nan)
    finite = np.nonzero(np.isfinite(P).all(axis=(1, 2)))[0]
    positive = np.linalg.eigvalsh(P[finite])[:, 0] > 0
    sound = finite[positive & (finite > 0)]
    weighted = np.linalg.solve(P[sound], error[sound, :, None])[..., 0]
    out[sound] = np.sum(error[sound] * weighted, axis=1) / error.shape[1]
    return out


MODE, MAPPING = 2, 1  # the setting's id, and its value for given poses
UNMOVED = Poses(np.eye(3), np.zeros(3))


@dataclass(frozen=True)
class MapFigures:
    """map_rms_m, map_median_m: distance of a landmark from where it is known to be;

    map_nees: squared error over covariance, an axis, mean over the landmarks: 1 is due.
    """

    map_rms_m: float
    map_median_m: float
    map_nees: float
    landmarks: int


def is_mapping(messages: Sequence[Message]) -> bool:
    """Whether the poses were given: then their error says nothing."""
    modes = [m.settings.get(MODE) for m in messages if isinstance(m, Config) if m.build_fingerprint]
    return bool(modes) and modes[-1] == MAPPING


def known_in(messages: Sequence[Message]) -> list[Landmark]:
    """The landmarks that a recording knows."""
    return [m for m in messages if isinstance(m, Landmark) and m.role == Role.KNOWN]


def compare_maps(
    messages: Sequence[Message], known: Sequence[Landmark], A: Poses = UNMOVED
) -> MapFigures | None:
    """A result's evicted and final landmarks against known ones, which A brings to its world.

    None if they have no id in common.
    """
    places = {landmark.id: landmark.p_W_m for landmark in known}
    mine = [
        m for m in messages if isinstance(m, Landmark) and m.role != Role.KNOWN and m.id in places
    ]
    if not mine:
        return None
    theirs = se3.apply(A, np.array([places[m.id] for m in mine]))
    error = np.array([m.p_W_m for m in mine]) - theirs
    P = unpack_symmetric(np.array([m.covariance for m in mine]), 3)
    weighted = np.linalg.solve(P, error[..., None])[..., 0]
    distance = np.linalg.norm(error, axis=1)
    return MapFigures(
        map_rms_m=float(np.sqrt(np.mean(distance**2))),
        map_median_m=float(np.median(distance)),
        map_nees=float(np.mean(np.sum(error * weighted, axis=1)) / 3),
        landmarks=len(mine),
    )
