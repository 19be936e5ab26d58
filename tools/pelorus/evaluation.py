# SPDX-License-Identifier: MIT
"""The figures of a result against a reference: trajectory, covariance, map.

With T^ the estimate, T the truth, both at frames of equal time, and A = T^_0 T_0^-1 at the first:

err0_m        RMS of |p^_k - p(A T_k)|
ate_m         RMS of |p^_k - p(A' T_k)| with the best rigid A', no scale
rot_deg       RMS angle of R^_k^T R(A T_k)
nees_per_dof  mean of e^T P^-1 e / 6, e = Log(T^_k^-1 A T_k), the first frame left out: 1 is due
map_*         of e = m^ - A m over the landmarks of equal id; NEES e^T P^-1 e / 3

A figure that cannot be had is None: without truth or covariance, and the poses' own where they
were given (mode mapping).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pelorus import se3
from pelorus.frames import Landmark, Message, Role
from pelorus.layout import Floats, unpack_symmetric
from pelorus.motion import Times
from pelorus.se3 import Poses
from pelorus.settings import in_force, mode_in_force
from pelorus.trajectory import Trajectory, estimate_in, truth_in

Figures = dict[str, float | int | None]

MEANING = {
    "err0_m": "RMS position error, first poses aligned",
    "ate_m": "RMS position error after the best rigid fit",
    "rot_deg": "RMS rotation error, first poses aligned",
    "nees_per_dof": "mean NEES of the pose, a degree of freedom: 1 is due",
    "truth_frames": "poses compared",
    "nees_left_out": "of them with a covariance that has no inverse, left out of NEES",
    "path_m": "length of the trajectory",
    "map_landmarks": "landmarks compared",
    "map_rms_m": "RMS distance of the landmarks from where they are known to be",
    "map_median_m": "median of that distance",
    "map_nees_per_dof": "mean NEES of a landmark, an axis: 1 is due",
    "map_nees_left_out": "landmarks with a covariance that has no inverse, left out of that",
    "map_sigma_least_m": "what the map claims of its best landmark, an axis",
    "map_sigma_largest_m": "and of its worst",
}


# --- trajectories ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Accuracy:
    """At the n frames with truth, the truth brought to the estimate's start.

    error (n, 6) is Log(T^-1 A T_true), (rho, theta), m and rad; sigma (n, 6); nees = e^T P^-1 e / 6
    (n,), NaN at the first frame and where P is not positive.
    """

    t_ns: Times
    estimate: Poses
    truth: Poses  # A T_true
    A: Poses
    error: Floats
    sigma: Floats
    nees: Floats

    @property
    def err0_m(self) -> float:
        return rms(self.estimate.p - self.truth.p)

    @property
    def rot_deg(self) -> float:
        return float(np.degrees(rms(self.error[:, 3:])))

    @cached_property
    def ate_m(self) -> float:
        fit = rigid_fit(self.truth.p, self.estimate.p)
        return rms(self.estimate.p - se3.apply(fit, self.truth.p))

    @property
    def nees_per_dof(self) -> float | None:
        return _mean(self.nees)

    @property
    def figures(self) -> Figures:
        return {
            "err0_m": self.err0_m,
            "ate_m": self.ate_m,
            "rot_deg": self.rot_deg,
            "nees_per_dof": self.nees_per_dof,
            "truth_frames": len(self.t_ns),
            "nees_left_out": int(np.isnan(self.nees[1:]).sum()),
        }


def assess(
    estimate: Trajectory, truth: Trajectory, covariance: Floats | None = None, tolerance_ns: int = 0
) -> Accuracy | None:
    """None if no pose has a truth of equal time. `covariance` (n, 6, 6), NaN where unknown."""
    mine, theirs = match(estimate, truth, tolerance_ns)
    if not len(mine):
        return None
    unknown = np.full((len(estimate.t_ns), 6, 6), np.nan)
    P = (unknown if covariance is None else covariance)[mine]
    T, T_true = estimate.poses.at(mine), truth.poses.at(theirs)
    A = se3.compose(T.at(0), se3.inverse(T_true.at(0)))
    aligned = se3.compose(A, T_true)
    error = se3.log(se3.compose(se3.inverse(T), aligned))
    sigma = np.sqrt(np.clip(np.diagonal(P, axis1=1, axis2=2), 0, None))
    nees = nees_per_dof(error, P)
    nees[0] = np.nan  # its error is zero by the alignment: it says nothing
    return Accuracy(estimate.t_ns[mine], T, aligned, A, error, sigma, nees)


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


def nees_per_dof(error: Floats, P: Floats) -> Floats:
    """e^T P^-1 e / d of (n, d) and (n, d, d); NaN where P is not positive."""
    out = np.full(len(error), np.nan)
    finite = np.nonzero(np.isfinite(P).all(axis=(1, 2)))[0]
    sound = finite[np.linalg.eigvalsh(P[finite])[:, 0] > 0]
    weighted = np.linalg.solve(P[sound], error[sound, :, None])[..., 0]
    out[sound] = np.sum(error[sound] * weighted, axis=1) / error.shape[1]
    return out


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


def path_m(poses: Poses) -> float:
    """Length of the way."""
    return float(np.linalg.norm(np.diff(poses.p, axis=0), axis=1).sum())


def rms(errors: Floats) -> float:
    """Root of the mean squared norm of the rows."""
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=-1))))


def _mean(values: Floats) -> float | None:
    return float(np.nanmean(values)) if np.isfinite(values).any() else None


# --- maps -----------------------------------------------------------------------------------------

UNMOVED = Poses(np.eye(3), np.zeros(3))


def made_in(messages: Sequence[Message]) -> list[Landmark]:
    """The landmarks that a filter left behind, evicted and final."""
    return [m for m in messages if isinstance(m, Landmark) and m.role != Role.KNOWN]


def known_in(messages: Sequence[Message]) -> list[Landmark]:
    """The landmarks that a recording knows; none whose place is not finite."""
    known = [m for m in messages if isinstance(m, Landmark) and m.role == Role.KNOWN]
    return [m for m in known if np.isfinite(m.p_W_m).all()]


def sigmas_m(landmarks: Sequence[Landmark]) -> Floats:
    """(n,): root of the mean variance of an axis."""
    packed = np.array([m.covariance for m in landmarks]).reshape(-1, 6)
    return np.asarray(np.sqrt(np.trace(unpack_symmetric(packed, 3), axis1=1, axis2=2) / 3))


def map_figures(made: Sequence[Landmark], known: Sequence[Landmark], A: Poses = UNMOVED) -> Figures:
    """A filter's landmarks against known ones, which A brings to its world."""
    places = {landmark.id: landmark.p_W_m for landmark in known}
    mine = [m for m in made if m.id in places]
    if not mine:
        return {key: None for key in MEANING if key.startswith("map_")} | {"map_landmarks": 0}
    error = np.array([m.p_W_m for m in mine])
    error -= se3.apply(A, np.array([places[m.id] for m in mine]))
    P = unpack_symmetric(np.array([m.covariance for m in mine]), 3)
    nees = nees_per_dof(error, P)
    sigma = sigmas_m(mine)
    return {
        "map_landmarks": len(mine),
        "map_rms_m": rms(error),
        "map_median_m": float(np.median(np.linalg.norm(error, axis=1))),
        "map_nees_per_dof": _mean(nees),
        "map_nees_left_out": int(np.isnan(nees).sum()),
        "map_sigma_least_m": float(sigma.min()),
        "map_sigma_largest_m": float(sigma.max()),
    }


# --- a whole result -------------------------------------------------------------------------------

OF_POSES = ("err0_m", "ate_m", "rot_deg", "nees_per_dof", "nees_left_out")


def is_mapping(messages: Sequence[Message]) -> bool:
    """Whether the poses were given: then their error says nothing."""
    return mode_in_force(messages) == "mapping"


def _found_by_itself(messages: Sequence[Message]) -> list[Landmark]:
    """What the filter made; without the known ones that it was located by."""
    made = made_in(messages)
    if mode_in_force(messages) == "localization" or in_force(messages, "known-map"):
        given = {m.id for m in known_in(messages)}
        made = [m for m in made if m.id not in given]
    return made


def judge(
    messages: Sequence[Message],
    truth: Trajectory | None = None,
    known: Sequence[Landmark] = (),
    tolerance_ns: int = 0,
) -> Figures:
    """A result against truth and known landmarks, by default its own."""
    truth = truth_in(messages) if truth is None else truth
    found = estimate_in(messages)
    accuracy = None
    if found is not None and truth is not None:
        accuracy = assess(found[0], truth, found[1], tolerance_ns)
    figures: Figures = dict.fromkeys(OF_POSES) | {"truth_frames": 0}
    if accuracy is not None:
        figures = accuracy.figures
    if is_mapping(messages):
        figures |= dict.fromkeys(OF_POSES)
    A = accuracy.A if accuracy else UNMOVED
    return figures | map_figures(_found_by_itself(messages), known or known_in(messages), A)
