# SPDX-License-Identifier: MIT
"""What twists and a gyro tell eyes: the camera's motion from one picture to the next."""

from __future__ import annotations

import numpy as np
import pytest
from pelorus.converters.expected import MOST_M, Expected
from pelorus.math import se3
from pelorus.math.inertial import Inertial
from pelorus.math.se3 import Poses
from pelorus.wire.frames import TwistTiming
from scipy.spatial.transform import Rotation

TIMES = np.arange(0, 2_000_000_000, 100_000_000)
PICTURES = np.array([-50_000_000, 500_000_000, 700_000_000, 2_500_000_000])
V, W = np.array([2.0, -0.5, 0.1]), np.array([0.1, 0.2, -0.3])
T_CB = Poses(Rotation.from_rotvec([0.4, -1.1, 0.9]).as_matrix(), np.array([0.3, -0.2, 0.1]))
ALL = frozenset(("vx", "vy", "vz", "wx", "wy", "wz"))


def by_twists(measured: frozenset[str], times: float = 1.0) -> Expected:
    twists = TIMES, np.tile(V * times, (len(TIMES), 1)), np.tile(W, (len(TIMES), 1))
    return Expected.by_twists(PICTURES, T_CB, twists, measured, TwistTiming.MID)


def in_camera(times: float) -> Poses:
    """Returns x_later = R x + p after 0.2 s, from the constant twist by itself."""
    moved = se3.exp(0.2 * V * times, 0.2 * W)
    return se3.compose(se3.compose(T_CB, se3.inverse(moved)), se3.inverse(T_CB))


def test_a_twist_tells_where_a_point_of_the_camera_goes() -> None:
    told = by_twists(ALL).between(1, 2)
    assert told is not None
    due = in_camera(1.0)
    assert told[0] == pytest.approx(due.R, abs=1e-9)
    assert told[1] == pytest.approx(due.p, abs=1e-9)


def test_without_velocities_the_turn_alone_is_told() -> None:
    for found in (
        by_twists(frozenset(("wx", "wy", "wz"))),
        Expected.by_gyro(
            PICTURES, T_CB, Inertial(TIMES, np.zeros((len(TIMES), 3)), np.tile(W, (len(TIMES), 1)))
        ),
    ):
        told = found.between(1, 2)
        assert told is not None
        assert told[0] == pytest.approx(in_camera(0.0).R, abs=1e-9)
        assert told[1] == pytest.approx(np.zeros(3))


def test_nothing_is_told_beside_the_readings_nor_of_another_unit() -> None:
    found = by_twists(ALL)
    assert found.between(0, 1) is None
    assert found.between(2, 3) is None
    assert by_twists(frozenset()).between(1, 2) is None
    assert by_twists(ALL, 10 * MOST_M).between(1, 2) is None
