# SPDX-License-Identifier: MIT
"""Simulated drives by whose errors the covariance of /odom is judged, in the axes of REP-103."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.online.drive import Setup
from pelorus.online.odometry import Given, Odometry
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Stereo, Twist
from pelorus.wire.layout import Floats
from pelorus_ros import conventions
from scipy.spatial.transform import Rotation

# Of the base: half a metre off the body, and turned in all three axes.
T_IB = Poses(Rotation.from_rotvec([0.4, -0.9, 2.0]).as_matrix(), np.array([0.4, -0.3, 0.2]))
START_SIGMA = np.array([0.05, 0.03, 0.02, 0.01, 0.02, 0.03])


class Sample(NamedTuple):
    """Of the last frame's pose of the base in odom: the error (6,) and the covariance (6, 6), as
    ROS has them."""

    error: Floats
    covariance: Floats


class Nees(NamedTuple):
    """Means over samples, of a degree of freedom; 1 is expected."""

    whole: float
    position: float
    rotation: float


def sample(seed: int) -> Sample:
    """One drive. The robot is told where it begins, with an error of the covariance that it is
    told."""
    chance = np.random.default_rng(seed)
    recording = simulate(
        Options(seed=seed, duration_s=3.0, twist_rate_hz=20.0, observations=25, landmarks=400)
    ).recording
    data = [m for m in recording.messages() if isinstance(m, Twist | Stereo)]
    truth = se3.compose(recording.truth, T_IB)
    begin = truth.at(0)
    off = START_SIGMA * chance.standard_normal(6)  # of what is told: T = told Exp(off)
    told = se3.compose(begin, se3.inverse(se3.exp(off[:3], off[3:])))
    P = conventions.from_ros(told.R, conventions.to_ros(told.R, np.diag(START_SIGMA**2)))
    odometry = Odometry(Setup(recording.header, recording.settings), T_IB, given=Given(told, P))
    odom = [one for m in data for one in odometry.add(m)][-1]
    at = int(np.nonzero(recording.truth_t_ns == odom.t_ns)[0][0])
    error = conventions.error_in_ros(truth.at(at), odom.T_OB)
    return Sample(error, conventions.to_ros(odom.T_OB.R, odom.covariance))


def nees(samples: Sequence[Sample]) -> Nees:
    """Returns the means, of the whole and of each block by itself."""
    blocks = (slice(0, 6), slice(0, 3), slice(3, 6))
    return Nees(
        *(
            float(np.mean([e[b] @ np.linalg.solve(C[b, b], e[b]) for e, C in samples]))
            / (b.stop - b.start)
            for b in blocks
        )
    )
