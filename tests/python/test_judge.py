# SPDX-License-Identifier: MIT
"""The figures of a whole result, on errors that are known."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pelorus.evaluate.evaluation import judge, rigid_fit
from pelorus.math import se3
from pelorus.math.consistency import rms
from pelorus.math.se3 import Poses
from pelorus.wire.frames import UNKNOWN_VARIANCE, Header, Message, Pose, Stereo, Truth
from pelorus.wire.layout import pack_symmetric

ONES = np.ones(6)
IDENTITY = Poses(np.eye(3), np.zeros(3))


def some_pose(chance: np.random.Generator, metres: float = 20.0, radians: float = 1.0) -> Poses:
    return se3.exp(metres * chance.normal(size=3), radians * chance.normal(size=3))


def frame(t_ns: int, estimate: Poses, truth: Poses | None, variances: Any = ONES) -> list[Message]:
    """A stereo frame, what the filter made of it, and the truth."""
    seen = Stereo(t_ns, np.zeros(0, np.uint32), np.zeros((0, 4), np.float32))
    packed = pack_symmetric(np.diag(variances)[None])[0]
    pose = Pose(t_ns, estimate.p, estimate.R, packed, after_stereo=True)
    return [seen, pose, *([] if truth is None else [Truth(t_ns, truth.R, truth.p)])]


def test_a_perfect_estimate_in_another_world_has_no_error() -> None:
    chance = np.random.default_rng(6)
    A, messages = some_pose(chance, 50, 2), list[Message]()
    for t in range(50):
        truth = some_pose(chance)
        messages += frame(t, se3.compose(A, truth), truth)
    found = judge(messages)
    assert found["truth_frames"] == 50
    assert found["err0_m"] == pytest.approx(0, abs=1e-11)
    assert found["ate_m"] == pytest.approx(0, abs=1e-11)
    assert found["rot_deg"] == pytest.approx(0, abs=1e-5)
    assert found["nees_per_dof"] == pytest.approx(0, abs=1e-20)


def test_a_known_error_gives_known_figures() -> None:
    """Behind the first frame it is off by 3 m and 0.1 rad in the body: over n frames RMS
    3 sqrt((n-1)/n), and e^T P^-1 e / 6 = (9/4 + 0.01/0.04) / 6.
    """
    chance, n, messages = np.random.default_rng(7), 25, list[Message]()
    off = se3.exp([3.0, 0, 0], [0.1, 0, 0])  # the way along the axis of the turn
    for t in range(n):
        estimate = some_pose(chance)
        truth = se3.compose(estimate, off) if t else estimate
        messages += frame(t, estimate, truth, [4, 1, 1, 0.04, 1, 1])
    found = judge(messages)
    share = math.sqrt((n - 1) / n)
    assert found["err0_m"] == pytest.approx(3 * share, abs=1e-9)
    assert found["rot_deg"] == pytest.approx(math.degrees(0.1 * share), abs=1e-9)
    assert found["nees_per_dof"] == pytest.approx(2.5 / 6, abs=1e-9)
    assert 0.1 < (found["ate_m"] or 0) < (found["err0_m"] or 0)


def test_NEES_of_errors_drawn_from_P_is_one() -> None:
    chance, messages = np.random.default_rng(8), list[Message]()
    variances = np.array([0.04, 0.09, 0.01, 1e-4, 4e-4, 9e-4])
    for t in range(4001):
        estimate = some_pose(chance)
        xi = np.sqrt(variances) * chance.normal(size=6) * (t > 0)
        truth = se3.compose(estimate, se3.exp(xi[:3], xi[3:]))
        messages += frame(t, estimate, truth, variances)
    assert judge(messages)["nees_per_dof"] == pytest.approx(1, abs=0.03)  # sigma 0.009


def test_truth_in_any_order_and_between_frames_is_matched_by_time() -> None:
    chance = np.random.default_rng(9)
    poses = [some_pose(chance, 5) for _ in range(10)]
    messages = [m for t, pose in enumerate(poses) for m in frame(10 * t, pose, None)]
    for t in reversed(range(10)):
        messages.append(Truth(10 * t + 5, *some_pose(chance, 5)))
        if t % 2:
            messages.append(Truth(10 * t, *poses[t]))
    found = judge(messages)
    assert found["truth_frames"] == 5
    assert found["err0_m"] == pytest.approx(0, abs=1e-12)


def test_of_two_truths_at_one_time_the_later_counts() -> None:
    away = Poses(np.eye(3), np.array([1.0, 0, 0]))
    messages = [*frame(1, IDENTITY, IDENTITY), *frame(2, IDENTITY, away)]
    assert judge(messages)["err0_m"] == pytest.approx(math.sqrt(0.5))
    assert judge([*messages, Truth(2, *IDENTITY)])["err0_m"] == pytest.approx(0, abs=1e-15)


def test_what_cannot_be_had_is_none() -> None:
    broken = Poses(np.eye(3), np.array([0, np.nan, 0]))
    found = judge(frame(1, IDENTITY, broken))
    assert found["truth_frames"] == 0
    for key in ("err0_m", "ate_m", "rot_deg", "nees_per_dof", "map_rms_m"):
        assert found[key] is None
    assert judge([m for m in frame(1, IDENTITY, IDENTITY) if not isinstance(m, Pose)])[
        "err0_m"
    ] is None  # fmt: skip
    single = judge([*frame(1, IDENTITY, broken), *frame(2, IDENTITY, IDENTITY)])
    assert single["err0_m"] == 0  # a single frame has errors, and no NEES
    assert single["nees_per_dof"] is None
    assert all(not isinstance(m, Header) for m in frame(1, IDENTITY, None))


def test_frames_without_a_positive_covariance_are_left_out_of_NEES_and_counted() -> None:
    broken, zeros = [1, 1, -1e-9, 1, 1, 1], np.zeros(6)
    found = judge(
        [m for t, P in enumerate((ONES, broken, ONES, zeros))
         for m in frame(t, IDENTITY, IDENTITY, P)]
    )  # fmt: skip
    assert found["nees_left_out"] == 2
    assert found["nees_per_dof"] == 0


def test_frames_of_a_diverged_filter_count_for_the_error_and_not_for_NEES() -> None:
    """1 m off everywhere. A covariance of 2^40 would bring the mean down to nothing."""
    away = Poses(np.eye(3), np.array([1.0, 0, 0]))
    messages = [*frame(1, IDENTITY, IDENTITY), *frame(2, away, IDENTITY)]
    for t in range(3, 11):
        messages += frame(t, away, IDENTITY, UNKNOWN_VARIANCE * ONES)
    found = judge(messages)
    assert found["truth_frames"] == 10
    assert found["nees_left_out"] == 8
    assert found["nees_per_dof"] == pytest.approx(1 / 6, abs=1e-15)
    assert found["err0_m"] == pytest.approx(math.sqrt(0.9), abs=1e-15)


@pytest.mark.parametrize("count", [3, 4, 7, 39])
def test_a_rigid_motion_of_points_is_found_exactly(count: int) -> None:
    chance = np.random.default_rng(4)
    A, b = some_pose(chance, 100, 2), 5 * chance.normal(size=(count, 3))
    found = rigid_fit(b, se3.apply(A, b))
    assert np.abs(found.R - A.R).max() < 1e-9
    assert np.abs(found.p - A.p).max() < 1e-9


def test_points_on_a_line_and_a_single_point_are_fitted() -> None:
    along_y = np.array([[0.0, 1, 0], [0, 2, 0], [0, 3, 0]])
    along_x = along_y[:, [1, 0, 2]]
    for n in (3, 1):
        found = rigid_fit(along_x[:n], along_y[:n])
        assert rms(se3.apply(found, along_x[:n]) - along_y[:n]) == pytest.approx(0, abs=1e-10)
        assert np.linalg.det(found.R) == pytest.approx(1)
