# SPDX-License-Identifier: MIT
"""The figures of a result against a reference: trajectory, covariance, drift, map.

With T^ the estimate, T the truth, both at frames of equal time, and A = T^_0 T_0^-1 at the first:

err0_m        RMS of |p^_k - p(A T_k)|
ate_m         RMS of |p^_k - p(A' T_k)| with the best rigid A', no scale
rot_deg       RMS angle of R^_k^T R(A T_k)
nees_per_dof  mean of e^T P^-1 e / 6, e = Log(T^_k^-1 A T_k), the first frame left out: expected 1
map_*         of e = m^ - A m over the landmarks of equal id; NEES e^T P^-1 e / 3

With an IMU gravity shows the vertical, so A turns about it alone, and is taken at the frame at
which the world was laid for good: where the filter's position is known as it was set, at the start,
or some seconds after a start in motion (docs/MATH.md, the anchor). Frames before it do not count.
A filter that has not started yet tells the pose that it was given, if only that of nobody: then
the heading is compared at the first frame after it.
What the filter knows besides is judged too, where TRUTH has it, each state by its own block of P;
the biases, which have only variances in a POSE, by e^2 / variance.

A figure that cannot be had is None: without truth or covariance, and the poses' own where they
were given (mode mapping).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.io.trajectory import Trajectory, estimate_in, filled, truth_in
from pelorus.math import motion, se3
from pelorus.math.consistency import Figures, mean, nees_per_dof, rms
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Landmark, Message, Pose, Role, Truth, TruthKnows
from pelorus.wire.layout import Floats, unpack_symmetric
from pelorus.wire.settings import in_force, mode_in_force

INERTIAL_MEANING = {
    "nees_position": "mean NEES of the position, a degree of freedom: 1 is expected",
    "nees_rotation": "of the rotation",
    "nees_velocity": "of the velocity",
    "nees_bias_accel": "of the accelerometer's bias",
    "nees_bias_gyro": "of the gyro's bias",
    "velocity_rms_mps": "RMS velocity error",
    "counted_from_s": "since the first frame, when the world was laid: no frame before it counts",
}


def inertial_figures(
    messages: Sequence[Message], truths: Sequence[Message], t_ns: Times, error: Floats, P: Floats
) -> Figures:
    """Returns the figures of a result.

    `truths` contain the TRUTH; error and P are those of the poses at t_ns (n, 6).
    """
    poses = {m.t_ns: m for m in messages if isinstance(m, Pose) and m.after_stereo}
    found: Figures = dict.fromkeys(INERTIAL_MEANING)
    found["counted_from_s"] = (int(t_ns[0]) - min(poses)) * 1e-9
    later = slice(1, None)  # the alignment makes the first error zero
    error, P = error[later], P[later]
    found["nees_position"] = mean(nees_per_dof(error[:, :3], P[:, :3, :3]))
    found["nees_rotation"] = mean(nees_per_dof(error[:, 3:], P[:, 3:, 3:]))
    known = {m.t_ns: m for m in truths if isinstance(m, Truth)}
    times = [t for t in t_ns[later].tolist() if t in known and poses[t].knows_covariance]
    return found | _velocity(times, poses, known) | _biases(times, poses, known)


def _velocity(times: list[int], poses: dict[int, Pose], known: dict[int, Truth]) -> Figures:
    times = [t for t in times if known[t].knows & TruthKnows.VELOCITY]
    if not times:
        return {}
    error = np.array([poses[t].v_B_mps - known[t].velocity for t in times])
    P = unpack_symmetric(np.array([poses[t].velocity_covariance for t in times]), 6)
    return {
        "nees_velocity": mean(nees_per_dof(error, P[:, :3, :3])),
        "velocity_rms_mps": rms(error),
    }


def _biases(times: list[int], poses: dict[int, Pose], known: dict[int, Truth]) -> Figures:
    times = [t for t in times if known[t].knows & TruthKnows.BIAS]
    times = [t for t in times if (np.asarray(poses[t].bias_variance) > 0).all()]
    if not times:
        return {}
    error = np.array([poses[t].bias - known[t].bias for t in times])
    nees = error**2 / np.array([poses[t].bias_variance for t in times])
    return {"nees_bias_accel": mean(nees[:, :3]), "nees_bias_gyro": mean(nees[:, 3:])}


MEANING = {
    "err0_m": "RMS position error, first poses aligned",
    "ate_m": "RMS position error after the best rigid fit",
    "ate_sim3_m": "RMS position error after the best fit of place, turn and scale",
    "scale": "by which the estimate is to be multiplied for that",
    "rot_deg": "RMS rotation error, first poses aligned",
    "nees_per_dof": "mean NEES of the pose, a degree of freedom: 1 is expected",
    **INERTIAL_MEANING,
    "truth_frames": "poses compared",
    "nees_left_out": "of them with a covariance that has no inverse, left out of NEES",
    "path_m": "length of the trajectory",
    "map_landmarks": "landmarks compared",
    "map_rms_m": "RMS distance of the landmarks from where they are known to be",
    "map_median_m": "median of that distance",
    "map_nees_per_dof": "mean NEES of a landmark, an axis: 1 is expected",
    "map_nees_left_out": "landmarks with a covariance that has no inverse, left out of that",
    "map_sigma_least_m": "what the map claims of its best landmark, an axis",
    "map_sigma_largest_m": "and of its worst",
}


# --- trajectories ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Accuracy:
    """Errors at the n frames with truth, which is moved to the estimate's start.

    error (n, 6) is Log(T^-1 A T_true), (rho, theta), m and rad; P (n, 6, 6) its covariance, sigma
    (n, 6); nees = e^T P^-1 e / 6 (n,), NaN at the first frame and where P is not positive.
    """

    t_ns: Times
    estimate: Poses
    truth: Poses  # A T_true
    A: Poses
    error: Floats
    P: Floats
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
    def sim3(self) -> Figures:
        """Returns the ATE with the best scale, and that scale, as for one camera's path."""
        fit, scale = similarity_fit(self.estimate.p, self.truth.p)
        off = self.truth.p - scale * self.estimate.p @ fit.R.T - fit.p
        return {"ate_sim3_m": rms(off), "scale": scale}

    @property
    def nees_per_dof(self) -> float | None:
        return mean(self.nees)

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
    estimate: Trajectory,
    truth: Trajectory,
    covariance: Floats | None = None,
    tolerance_ns: int = 0,
    upright: bool = False,
) -> Accuracy | None:
    """Compares a trajectory with the truth; None if no pose has a truth of equal time.

    `covariance` (n, 6, 6), NaN where unknown. `upright`: the filter knows the vertical, as with an
    IMU.
    """
    mine, theirs = match(estimate, truth, tolerance_ns)
    if not len(mine):
        return None
    if covariance is None:
        covariance = np.full((len(estimate.t_ns), 6, 6), np.nan)
    whole = np.array_equal(mine, np.arange(len(covariance)))  # of an hour 20 MB
    P = covariance if whole else covariance[mine]
    T, T_true = estimate.poses.at(mine), truth.poses.at(theirs)
    if upright:
        laid = world_laid(P)
        begun = slice(laid + int(laid + 1 < len(P) and is_as_set(P[laid])), None)
        T_laid, T_true_laid = T.at(laid), T_true.at(laid)
        mine, P, T, T_true = mine[begun], P[begun], T.at(begun), T_true.at(begun)
        A = about_vertical(T.at(0), T_true.at(0))
        A = Poses(A.R, T_laid.p - A.R @ T_true_laid.p)
    else:
        A = _onto(T.at(0), T_true.at(0))
    aligned = se3.compose(A, T_true)
    error = se3.log(se3.compose(se3.inverse(T), aligned))
    sigma = np.sqrt(np.clip(np.diagonal(P, axis1=1, axis2=2), 0, None))
    nees = nees_per_dof(error, P)
    nees[0] = np.nan  # the alignment makes this error zero
    return Accuracy(estimate.t_ns[mine], T, aligned, A, error, P, sigma, nees)


def _onto(T: Poses, T_true: Poses) -> Poses:
    """Returns A with T = A T_true."""
    return se3.compose(T, se3.inverse(T_true))


def about_vertical(T: Poses, T_true: Poses) -> Poses:
    """Returns A that turns about the vertical alone, and maps T_true to T as well as it can."""
    between = T.R @ T_true.R.T
    x, y = between[0, 0] + between[1, 1], between[1, 0] - between[0, 1]
    cosine, sine = np.array([x, y]) / np.hypot(x, y)
    R = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return Poses(R, T.p - R @ T_true.p)


def world_laid(P: Floats) -> int:
    """Returns the last frame whose position covariance is still the initial one: equal and
    uncorrelated.

    It is the first frame if there is none: then the world was placed before it. If it is the last
    frame of all, the filter has never started.
    """
    rho, cross = P[:, :3, :3], P[:, :3, 3:]
    alike = (rho == rho[:, :1, :1] * np.eye(3)).all(axis=(1, 2))
    as_set = np.nonzero(alike & (cross == 0).all(axis=(1, 2)))[0]
    return int(as_set[-1]) if len(as_set) and as_set[-1] < len(P) - 1 else 0


def is_as_set(P: Floats) -> bool:
    """Returns whether a pose has its initial covariance, with one sigma of m and rad.

    That is before the filter starts, or where nothing has moved yet.
    """
    return np.array_equal(P, P[0, 0] * np.eye(len(P)))


def match(
    estimate: Trajectory, truth: Trajectory, tolerance_ns: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Returns indices of the poses of equal time, each truth used once."""
    nearest = motion.nearest(truth.t_ns, estimate.t_ns)
    good = np.nonzero(np.abs(truth.t_ns[nearest] - estimate.t_ns) <= tolerance_ns)[0]
    _, first = np.unique(nearest[good], return_index=True)
    return good[first], nearest[good[first]]


def rigid_fit(source: Floats, target: Floats) -> Poses:
    """Returns the rigid motion, without scale, that fits (n, 3) to (n, 3) by least squares.

    Umeyama, Least-squares estimation of transformation parameters between two point patterns, 1991.
    """
    middle_source, middle_target = source.mean(axis=0), target.mean(axis=0)
    R = se3.nearest_rotation((target - middle_target).T @ (source - middle_source))
    return Poses(R, middle_target - R @ middle_source)


def similarity_fit(source: Floats, target: Floats) -> tuple[Poses, float]:
    """Returns the rigid motion and the scale s of the least-squares fit of s source to target.

    Umeyama's equation 42, as `rigid_fit`.
    """
    fit = rigid_fit(source, target)
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    spread = float(np.sum(a * a))
    scale = float(np.sum((a @ fit.R.T) * b)) / spread if spread > 0 else 1.0
    return Poses(fit.R, target.mean(axis=0) - scale * fit.R @ source.mean(axis=0)), scale


def beside(other: Trajectory, own: Trajectory, tolerance_ns: int) -> Trajectory | None:
    """Returns another program's path, moved to this world where both first have a pose."""
    mine, theirs = match(own, other, tolerance_ns)
    if not len(mine):
        return None
    A = _onto(own.poses.at(int(mine[0])), other.poses.at(int(theirs[0])))
    kept = se3.compose(A, other.poses.at(theirs))
    return Trajectory(own.t_ns[mine], kept)


def step_change(poses: Poses) -> float:
    """Returns how erratic a trajectory is: RMS change of the step from one pose to the next, m."""
    steps = np.einsum("nij,ni->nj", poses.R[:-1], np.diff(poses.p, axis=0))
    return rms(np.diff(steps, axis=0)) if len(steps) > 1 else 0.0


def path_m(poses: Poses) -> float:
    """Returns the length of the path."""
    return float(np.linalg.norm(np.diff(poses.p, axis=0), axis=1).sum())


# --- maps -----------------------------------------------------------------------------------------


def made_in(messages: Sequence[Message]) -> list[Landmark]:
    """Returns the landmarks that a filter left behind, evicted and final."""
    return [m for m in messages if isinstance(m, Landmark) and m.role != Role.KNOWN]


def known_in(messages: Sequence[Message]) -> list[Landmark]:
    """Returns the known landmarks of a recording; positions that are not finite are left out."""
    known = [m for m in messages if isinstance(m, Landmark) and m.role == Role.KNOWN]
    return [m for m in known if np.isfinite(m.p_W_m).all()]


def sigmas_m(landmarks: Sequence[Landmark]) -> Floats:
    """Returns (n,) the root of the mean variance of an axis."""
    packed = np.array([m.covariance for m in landmarks]).reshape(-1, 6)
    trace = np.trace(unpack_symmetric(packed, 3), axis1=1, axis2=2)
    return np.asarray(np.sqrt(np.where(trace >= 0, trace, np.nan) / 3))


def map_figures(
    made: Sequence[Landmark], known: Sequence[Landmark], A: Poses = se3.IDENTITY
) -> Figures:
    """Compares a filter's landmarks with known ones, which A maps to its world."""
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
        "map_nees_per_dof": mean(nees),
        "map_nees_left_out": int(np.isnan(nees).sum()),
        "map_sigma_least_m": float(sigma.min()),
        "map_sigma_largest_m": float(sigma.max()),
    }


# --- a whole result -------------------------------------------------------------------------------

OF_POSES = ("err0_m", "ate_m", "rot_deg", "nees_per_dof", "nees_left_out")


def is_mapping(messages: Sequence[Message]) -> bool:
    """Returns whether the poses were given, so that their error means nothing."""
    return mode_in_force(messages) == "mapping"


def by_imu(messages: Sequence[Message]) -> bool:
    """Returns whether an IMU moved the filter of this result."""
    return bool(in_force(messages, "process"))


def _found_by_itself(messages: Sequence[Message]) -> list[Landmark]:
    """Returns the landmarks that the filter made, without the known ones of its map."""
    made = made_in(messages)
    if mode_in_force(messages) == "localization" or in_force(messages, "known-map"):
        given = {m.id for m in known_in(messages)}
        made = [m for m in made if m.id not in given]
    return made


def on_its_clock(
    messages: Sequence[Message], truth: Trajectory, estimate: Trajectory
) -> Trajectory:
    """Returns the truth on the result's clock, which a camera-offset shifts."""
    return filled(truth, estimate.t_ns) if in_force(messages, "camera-offset") else truth


def accuracy_of(
    messages: Sequence[Message], truth: Trajectory | None = None, tolerance_ns: int = 0
) -> Accuracy | None:
    """Compares the poses of a result with the truth, by default its own; None without either."""
    truth = truth_in(messages) if truth is None else truth
    found = estimate_in(messages)
    if truth is None or found is None:
        return None
    truth = on_its_clock(messages, truth, found[0])
    return assess(found[0], truth, found[1], tolerance_ns, by_imu(messages))


def judge(
    messages: Sequence[Message],
    truth: Trajectory | None = None,
    known: Sequence[Landmark] = (),
    tolerance_ns: int = 0,
    truths: Sequence[Message] = (),
) -> Figures:
    """Compares a result with truth and known landmarks, by default its own.

    `truths` are messages that may have more of the truth than its poses.
    """
    accuracy = accuracy_of(messages, truth, tolerance_ns)
    figures: Figures = dict.fromkeys(OF_POSES) | {"truth_frames": 0}
    if accuracy is not None:
        figures = accuracy.figures
    if is_mapping(messages):
        figures |= dict.fromkeys(OF_POSES)
    elif accuracy is not None and by_imu(messages):
        figures |= inertial_figures(
            messages, truths or messages, accuracy.t_ns, accuracy.error, accuracy.P
        )
    A = accuracy.A if accuracy else se3.IDENTITY
    return figures | map_figures(_found_by_itself(messages), known or known_in(messages), A)


# --- drift by length ------------------------------------------------------------------------------


STARTS_MOST = 2000
STARTS_LEAST = 10  # fewer say little, for they share most of their path
LENGTHS_MOST = 7
SHARE = 0.5  # of the path; longer ones have few distinct starts


class Drift(NamedTuple):
    """The drift over one length: RMS over `starts`."""

    length_m: float
    starts: int
    position_m: float
    rotation_deg: float

    @property
    def percent(self) -> float:
        return 100 * self.position_m / self.length_m


def drifts(accuracy: Accuracy) -> list[Drift]:
    """Returns the drifts over lengths 1, 2, 5, 10 ... up to half the path; short ones first.

    For each start i and length L, with j the first frame at which the true distance since i is L or
    more, T the estimate and T* the truth:

        E = (T_i^-1 T_j)^-1 (T*_i^-1 T*_j)

    The figures are |p(E)| / L and the angle of R(E) / L, as RMS over the starts. Geiger, Lenz,
    Urtasun: Are we ready for autonomous driving? The KITTI vision benchmark suite, 2012.
    """
    steps = np.linalg.norm(np.diff(accuracy.truth.p, axis=0), axis=1)
    way = np.concatenate(([0.0], np.cumsum(steps)))
    found = (_drift(accuracy, way, length) for length in _lengths(float(way[-1])))
    return [drift for drift in found if drift is not None]


def _lengths(whole_m: float) -> Iterator[float]:
    if not np.isfinite(whole_m) or whole_m <= 0:
        return
    top = int(np.floor(np.log10(whole_m)))
    ladder = [n * 10.0**k for k in range(top - 3, top + 1) for n in (1, 2, 5)]
    yield from [length for length in ladder if length <= SHARE * whole_m][-LENGTHS_MOST:]


def _drift(accuracy: Accuracy, way: Floats, length_m: float) -> Drift | None:
    ends = np.searchsorted(way, way + length_m)
    starts = np.nonzero(ends < len(way))[0]
    starts = starts[:: -(-len(starts) // STARTS_MOST) or 1]
    if len(starts) < STARTS_LEAST:
        return None
    mine, expected = (
        se3.compose(se3.inverse(poses.at(starts)), poses.at(ends[starts]))
        for poses in (accuracy.estimate, accuracy.truth)
    )
    error = se3.compose(se3.inverse(mine), expected)
    angles = se3.log(error)[:, 3:]
    return Drift(length_m, len(starts), rms(error.p), float(np.degrees(rms(angles))))
