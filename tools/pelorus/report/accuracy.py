# SPDX-License-Identifier: MIT
"""A run's errors against the truth, and how well its covariance foretells them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pelorus import figures, se3
from pelorus.motion import Times
from pelorus.se3 import Floats, Poses
from pelorus.trajectory import Trajectory


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
    mine, theirs = figures.match(estimate, truth, 0)
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
