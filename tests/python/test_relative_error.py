# SPDX-License-Identifier: MIT
"""The relative pose error by length, of ways whose drift is known."""

from __future__ import annotations

import numpy as np
import pytest
from pelorus.evaluate.evaluation import Accuracy, assess, drifts
from pelorus.io.trajectory import Trajectory
from pelorus.math.se3 import Poses
from scipy.spatial.transform import Rotation

COUNT = 401


def way(step_m: float, turn_deg: float = 0.0) -> Trajectory:
    """Straight along x, but for what it turns a frame."""
    heading = np.radians(turn_deg) * np.arange(COUNT)
    R = Rotation.from_euler("z", heading[:, None]).as_matrix()
    steps = np.einsum("nij,j->ni", R[:-1], [step_m, 0.0, 0.0])
    p = np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0)))
    return Trajectory(np.arange(COUNT, dtype=np.int64) * 100_000_000, Poses(R, p))


def judged(estimate: Trajectory, truth: Trajectory) -> Accuracy:
    found = assess(estimate, truth)
    assert found is not None
    return found


def test_a_scale_that_is_off_is_the_same_share_of_every_length() -> None:
    found = drifts(judged(way(0.101), way(0.1)))
    assert [d.length_m for d in found] == [0.2, 0.5, 1, 2, 5, 10, 20]
    for d in found:  # a piece is up to a step longer than its length
        assert 0.9999 <= d.percent <= 1.0 * (1 + 0.1001 / d.length_m)
        assert d.rotation_deg == pytest.approx(0.0, abs=1e-5)


def test_a_gyro_that_drifts_turns_in_proportion_to_the_length() -> None:
    for d in drifts(judged(way(0.1, 0.01), way(0.1))):
        assert d.rotation_deg == pytest.approx(
            0.1 * d.length_m, rel=0.25 if d.length_m < 1 else 0.1
        )


def test_where_a_drive_stands_or_is_too_short_nothing_is_told() -> None:
    assert drifts(judged(way(0.0), way(0.0))) == []
    both = (Trajectory(t.t_ns[:8], t.poses.at(slice(8))) for t in (way(0.1), way(0.1)))
    assert drifts(judged(*both)) == []
