# SPDX-License-Identifier: MIT
"""Where eyes expect points: by the body's velocity since the last pair."""

from __future__ import annotations

import numpy as np
import pytest
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.online.pipeline import ExpectedMotion, Velocity, known_velocity

MS = 1_000_000
W, V = np.array([0.3, -0.5, 0.2]), np.array([1.0, -0.4, 0.3])
T_CB = se3.exp([0.1, -0.2, 0.05], [0.4, 1.1, -0.3])


def motion_of(v: np.ndarray | None, until_ms: int = 50) -> tuple[np.ndarray, np.ndarray]:
    expected = ExpectedMotion(T_CB)
    assert expected.until(0) is None  # the first pair
    for t_ms in range(0, until_ms, 5):
        expected.add(Velocity(t_ms * MS, W, v))
    found = expected.until(50 * MS)
    assert found is not None
    return found


def test_points_move_as_the_body_with_its_camera_does() -> None:
    R, p = motion_of(V)
    moved = se3.exp(V * 0.05, W * 0.05)  # T_then_now of the body
    point_B = np.array([2.0, 0.5, 4.0])
    then = se3.apply(T_CB, point_B)
    now = se3.apply(T_CB, se3.apply(se3.inverse(moved), point_B))
    np.testing.assert_allclose(R @ then + p, now, atol=1e-12)


def test_a_gyro_alone_turns_points_and_does_not_move_them() -> None:
    R, p = motion_of(None)
    np.testing.assert_array_equal(p, 0)
    np.testing.assert_allclose(R, motion_of(V)[0], atol=1e-12)


def test_readings_that_come_late_are_bridged_by_the_last_rate() -> None:
    np.testing.assert_allclose(motion_of(None, until_ms=30)[0], motion_of(None)[0], atol=1e-12)


def test_nothing_is_expected_without_velocities_or_after_a_pause() -> None:
    expected = ExpectedMotion(Poses(np.eye(3), np.zeros(3)))
    expected.until(0)
    assert expected.until(50 * MS) is None
    expected.add(Velocity(60 * MS, W, None))
    assert expected.until(100 * MS) is not None
    assert expected.until(9_000 * MS) is None
    assert expected.until(8_000 * MS) is None  # stamps that go back


@pytest.mark.parametrize(("sigma", "known"), [(0.05, True), (0.2, False), (np.nan, False)])
def test_a_velocity_says_where_points_are_only_if_it_is_known_well(
    sigma: float, known: bool
) -> None:
    found = known_velocity(np.concatenate((V, W)), np.eye(6) * sigma**2)
    assert (found is not None) == known
