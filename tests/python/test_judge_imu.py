# SPDX-License-Identifier: MIT
"""The figures of a result that an IMU led to: what is aligned, from when, and each state's NEES."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run
from pelorus.evaluate import evaluation
from pelorus.evaluate.evaluation import judge
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.simulate.sensors import CAMERA
from pelorus.wire.frames import Config, Header, Message, Pose, Stereo, Truth, TruthKnows
from pelorus.wire.layout import Floats, pack_symmetric
from pelorus.wire.settings import IDS
from replay_drive import BIN, encode

BY_IMU = Config({IDS["process"]: 1.0}, build_fingerprint=1)
TURNED = se3.exp(np.array([5.0, -3.0, 1.0]), np.array([0.0, 0.0, 2.0]))  # about the vertical
SOME = np.array([0.04, 0.09, 0.01, 1e-4, 4e-4, 9e-4])
SET = np.array([1e-8, 1e-8, 1e-8, 1e-4, 4e-4, 1e-8])  # the position as it was set
ALL = TruthKnows.VELOCITY | TruthKnows.BIAS


def frame(k: int, T: Poses, truth: Poses, P: Floats, **more: Any) -> list[Message]:
    """A frame; `more` has the errors of velocity and bias, in sigmas."""
    chance = np.random.default_rng(k)
    v, bias = chance.normal(size=3), chance.normal(size=6)
    P_u = np.diag([0.01, 0.02, 0.03, 1.0, 1.0, 1.0])
    P_u[0, 1] = P_u[1, 0] = 0.012
    variance = np.array([0.04, 0.05, 0.06, 1e-4, 2e-4, 3e-4])
    L = np.linalg.cholesky(P_u[:3, :3])
    return [
        Stereo(k, np.zeros(0, np.uint32), np.zeros((0, 4), np.float32)),
        Pose(
            k,
            T.p,
            T.R,
            pack_symmetric(np.diag(P))[None][0],
            v_B_mps=v + L @ more.get("velocity", np.zeros(3)),
            bias=bias + np.sqrt(variance) * more.get("bias", np.zeros(6)),
            velocity_covariance=pack_symmetric(P_u),
            bias_variance=variance,
            after_stereo=True,
        ),
        Truth(k, truth.R, truth.p, more.get("knows", ALL), v, bias),
    ]


def drawn(count: int, first: Floats, begin: int = 0) -> list[Message]:
    """Errors as P says, in a world that is turned about the vertical."""
    chance = np.random.default_rng(1)
    messages: list[Message] = [BY_IMU]
    for k in range(count):
        T = se3.exp(20 * chance.normal(size=3), chance.normal(size=3))
        P = first if k == 0 else SOME
        xi = np.sqrt(P) * chance.normal(size=6)
        truth = se3.compose(T, se3.exp(xi[:3], xi[3:])) if k else T
        errors = {"velocity": chance.normal(size=3), "bias": chance.normal(size=6)}
        messages += frame(begin + k, T, se3.compose(se3.inverse(TURNED), truth), P, **errors)
    return messages


def test_the_NEES_of_every_state_is_one_where_its_errors_are_as_it_says() -> None:
    found = judge(drawn(4000, SET))
    for name in ("position", "rotation", "velocity", "bias_accel", "bias_gyro"):
        assert found[f"nees_{name}"] == pytest.approx(1.0, abs=0.04), name
    assert found["nees_per_dof"] == pytest.approx(1.0, abs=0.03)
    due = np.sqrt(np.trace(np.diag([0.01, 0.02, 0.03])))
    assert found["velocity_rms_mps"] == pytest.approx(due, rel=0.03)


@pytest.mark.parametrize("state", ["velocity", "bias_accel", "bias_gyro"])
def test_an_error_of_two_sigma_in_one_state_is_four_there_and_nowhere_else(state: str) -> None:
    messages: list[Message] = [BY_IMU]
    bias = np.repeat([2.0 * (state == "bias_accel"), 2.0 * (state == "bias_gyro")], 3)
    speed = np.full(3, 2.0 * (state == "velocity"))
    for k in range(9):
        T = se3.exp(np.full(3, float(k)), np.array([0.1 * k, 0.2, 0.3]))
        messages += frame(k, T, T, SET, velocity=speed, bias=bias)
    messages += frame(9, T, T, SOME, velocity=speed, bias=bias)
    messages += frame(10, T, T, SOME, velocity=speed, bias=bias)
    found = judge(messages)
    for name in ("velocity", "bias_accel", "bias_gyro"):
        assert found[f"nees_{name}"] == pytest.approx(4.0 * (name == state), abs=1e-9)


def test_a_tilt_is_an_error_and_a_heading_is_none() -> None:
    tilt, heading = se3.exp(np.zeros(3), np.array([0.1, 0, 0])), TURNED
    for by, due in ((heading, 0.0), (tilt, np.degrees(0.1))):
        messages: list[Message] = [BY_IMU]
        for k in range(20):
            T = se3.exp(np.array([0.3 * k, 0.1 * k * k, 0.0]), np.array([0.0, 0.0, 0.1 * k]))
            messages += frame(k, T, se3.compose(by, T), SOME)
        assert judge(messages)["rot_deg"] == pytest.approx(due, abs=1e-6)
        assert judge(messages[1:])["rot_deg"] == pytest.approx(0.0, abs=1e-6), "without an IMU"


def test_what_was_before_the_anchor_counts_for_nothing() -> None:
    """The filter stood with a wrong pose, found its motion, and then laid the world anew."""
    good = drawn(400, SET, 13)
    wild: list[Message] = [BY_IMU]
    T = se3.exp(np.full(3, 9.0), np.full(3, 0.7))
    for k in range(3):
        wild += frame(k, T, TURNED, SET)
    for k in range(3, 13):
        wild += frame(k, T, TURNED, SOME)
    whole, alone = judge(wild + good[1:]), judge(good)
    assert whole.pop("counted_from_s") == pytest.approx(13e-9)
    assert alone.pop("counted_from_s") == 0
    assert whole == alone
    assert whole["truth_frames"] == 400


def test_a_start_before_the_first_frame_counts_from_the_first_frame() -> None:
    found = judge(drawn(500, SOME))
    assert found["counted_from_s"] == 0
    assert found["truth_frames"] == 500


def test_a_filter_that_never_started_is_judged_by_the_pose_that_it_kept() -> None:
    """An accelerometer that reads in g: the pose stays where it was set."""
    messages: list[Message] = [BY_IMU]
    for k in range(11):
        truth = Poses(TURNED.R, TURNED.p + np.array([0.3 * k, 0.0, 0.0]))
        messages += frame(k, TURNED, truth, SET)
    found = judge(messages)
    assert found["truth_frames"] == 11
    assert found["err0_m"] == pytest.approx(0.3 * np.sqrt(35))


def test_what_truth_does_not_tell_is_left_open() -> None:
    messages: list[Message] = [BY_IMU]
    for k in range(5):
        messages += frame(k, TURNED, TURNED, SOME, knows=TruthKnows(0))
    found = judge(messages)
    assert found["nees_velocity"] is None
    assert found["nees_bias_gyro"] is None
    assert found["nees_position"] == pytest.approx(0.0, abs=1e-12)
    twists = judge(messages[1:])
    assert not set(evaluation.INERTIAL_MEANING) & set(twists), "of an IMU alone"
    assert set(found) <= set(evaluation.MEANING)


def test_evaluate_looks_at_the_first_seconds_alone(tmp_path: Path, pelorus: Run) -> None:
    header = Header(CAMERA)
    late = [m for k in range(8) for m in frame(k * 10**9, TURNED, TURNED, SOME)]
    off = se3.compose(TURNED, se3.exp(np.array([0, 4.0, 0]), np.zeros(3)))
    late += [m for k in range(8, 16) for m in frame(k * 10**9, off, TURNED, SOME)]
    path = tmp_path / "result.plr"
    path.write_bytes(encode([header, BY_IMU, *late]))
    whole = pelorus("evaluate", path, "--bin", BIN, "--json")
    early = pelorus("evaluate", path, "--bin", BIN, "--json", "--first", 7)
    assert '"err0_m": 2.8' in whole.out
    assert '"truth_frames": 16' in whole.out
    assert '"truth_frames": 8' in early.out
    assert '"err0_m": 0.0' in early.out
