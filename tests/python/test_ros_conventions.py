# SPDX-License-Identifier: MIT
"""The covariance of /odom by sampling: what REP-103 says it is, is how far the poses are off."""

from __future__ import annotations

import numpy as np
import pytest
from odom_samples import T_IB, Sample, nees, sample
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.online.odometry import adjoint, level, turned
from pelorus_ros import conventions
from pelorus_ros.mounting import Mounting, NoChain
from replay_drive import BIN
from robot_messages import transform
from scipy.spatial.transform import Rotation

DRIVES = 200
pytestmark = pytest.mark.usefixtures("built")


@pytest.fixture(scope="module")
def samples() -> list[Sample]:
    with pytest.MonkeyPatch.context() as there:
        there.setenv("PELORUS_BIN", str(BIN))
        return [sample(seed) for seed in range(1, DRIVES + 1)]


def test_covariance_of_odom_is_that_of_its_errors_about_the_fixed_axes(
    samples: list[Sample],
) -> None:
    """NEES/6 of 200 drives, and NEES/3 of each block; `pytest -s` shows them."""
    found = nees(samples)
    print(found)
    assert 0.9 < found.whole < 1.1
    assert 0.9 < found.position < 1.1
    assert 0.9 < found.rotation < 1.1


def test_a_covariance_in_other_axes_would_not_pass(samples: list[Sample]) -> None:
    """The test above can fail: turned by 90 degrees the sigmas belong to other errors."""
    R = Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix()
    wrong = nees([Sample(error, turned(R, C)) for error, C in samples])
    assert wrong.whole > 1.35


def test_errors_and_covariances_follow_the_same_first_order_way() -> None:
    """dp = R rho and dr = R theta, and with the adjoint for another point of the body."""
    chance = np.random.default_rng(7)
    T = Poses(Rotation.random(random_state=3).as_matrix(), np.array([3.0, -2.0, 1.0]))
    xi = 1e-5 * chance.standard_normal(6)
    error = conventions.error_in_ros(se3.compose(T, se3.exp(xi[:3], xi[3:])), T)
    np.testing.assert_allclose(error, np.kron(np.eye(2), T.R) @ xi, atol=1e-9)
    moved = se3.compose(se3.compose(T, se3.exp(xi[:3], xi[3:])), T_IB)
    at_base = adjoint(se3.inverse(T_IB)) @ xi
    same = se3.compose(se3.compose(T, T_IB), se3.exp(at_base[:3], at_base[3:]))
    np.testing.assert_allclose(moved.p, same.p, atol=1e-12)
    np.testing.assert_allclose(moved.R, same.R, atol=1e-12)


def test_a_covariance_goes_to_ros_and_back() -> None:
    A = np.random.default_rng(1).standard_normal((6, 6))
    P, R = A @ A.T, Rotation.random(random_state=1).as_matrix()
    np.testing.assert_allclose(conventions.from_ros(R, conventions.to_ros(R, P)), P)


def test_odom_begins_at_the_base_with_the_vertical_of_the_world() -> None:
    T = Poses(Rotation.from_euler("zyx", [2.0, 0.3, -0.2]).as_matrix(), np.array([4.0, 5.0, 6.0]))
    begun = se3.compose(level(T), T)
    np.testing.assert_allclose(begun.p, 0, atol=1e-12)
    assert abs(np.arctan2(begun.R[1, 0], begun.R[0, 0])) < 1e-12
    np.testing.assert_allclose(level(T).R[2], [0, 0, 1], atol=1e-15)


def test_mounting_joins_frames_by_their_common_parent_and_names_those_it_knows() -> None:
    mounting = Mounting()
    turn = Rotation.from_euler("z", np.pi / 2).as_matrix()
    assert mounting.add(transform("base_link", "imu", np.eye(3), (0.1, 0, 0)))
    assert mounting.add(transform("/base_link", "camera", turn, (0, 0.2, 0)))
    T = mounting.between("imu", "camera")
    np.testing.assert_allclose(T.R, turn.T, atol=1e-12)
    np.testing.assert_allclose(T.p, turn.T @ [0.1, -0.2, 0], atol=1e-12)
    with pytest.raises(
        NoChain, match=r"where 'lidar' stands.*known frames: base_link, camera, imu"
    ):
        mounting.between("lidar", "camera")
