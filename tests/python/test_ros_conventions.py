# SPDX-License-Identifier: MIT
"""The covariance of /odom by sampling: what REP-103 says it is, is how far the poses are off."""

from __future__ import annotations

import numpy as np
import pytest
from pelorus import se3
from pelorus.frames import Stereo, Twist
from pelorus.layout import Floats
from pelorus.online.drive import Setup
from pelorus.online.odometry import Given, Odometry, adjoint, level
from pelorus.se3 import Poses
from pelorus.simulation.simulate import Options, simulate
from pelorus_ros import conventions
from pelorus_ros.mounting import Mounting, NoChain
from replay_drive import BIN
from robot_messages import transform
from scipy.spatial.transform import Rotation

DRIVES = 200
# Of the base: half a metre off the body, and turned in all three axes.
T_IB = Poses(Rotation.from_rotvec([0.4, -0.9, 2.0]).as_matrix(), np.array([0.4, -0.3, 0.2]))
START_SIGMA = np.array([0.05, 0.03, 0.02, 0.01, 0.02, 0.03])


@pytest.fixture(autouse=True)
def built(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PELORUS_BIN", str(BIN))


def error_and_covariances(seed: int) -> tuple[Floats, Floats]:
    """Returns error (6,) and covariance of the last frame's pose of the base in odom, as in ROS.

    The robot is told where it begins, with an error drawn from the covariance that it is told.
    """
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
    return error, conventions.to_ros(odom.T_OB.R, odom.covariance)


def test_covariance_of_odom_is_that_of_its_errors_about_the_fixed_axes() -> None:
    """NEES/6 of 200 drives, and NEES/3 of each block; each axis' own errors against its sigma."""
    samples = [error_and_covariances(seed) for seed in range(1, DRIVES + 1)]
    whole = np.mean([e @ np.linalg.solve(C, e) for e, C in samples]) / 6
    place = np.mean([e[:3] @ np.linalg.solve(C[:3, :3], e[:3]) for e, C in samples]) / 3
    turn = np.mean([e[3:] @ np.linalg.solve(C[3:, 3:], e[3:]) for e, C in samples]) / 3
    print(f"NEES/6 {whole:.3f}, position {place:.3f}, rotation {turn:.3f}")
    assert 0.9 < whole < 1.1
    assert 0.9 < place < 1.1
    assert 0.9 < turn < 1.1


def test_a_covariance_in_other_axes_would_not_pass() -> None:
    """The test above can fail: in the body's axes the sigmas belong to other errors."""
    samples = [error_and_covariances(seed) for seed in range(1, 41)]
    R = Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix()
    wrong = [e @ np.linalg.solve(conventions.turned(R, C), e) / 6 for e, C in samples]
    assert np.mean(wrong) > 1.3


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
