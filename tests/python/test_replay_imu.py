# SPDX-License-Identifier: MIT
"""`pelorus-replay` and `pelorus compare` with an IMU, and with a camera that has its own clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_logs import SAME, Compare, robots_log
from pelorus.robot.stream import start_from
from pelorus.wire.frames import (
    Imu,
    Kind,
    Message,
    Pose,
    Process,
    Report,
    Start,
    StartFlag,
    Stereo,
    Text,
)
from replay_drive import (
    FRAMES,
    RATE,
    RECORDING,
    SPEED,
    Record,
    header,
    judged,
    log_of,
    run,
    stereo,
    t_ns,
    true_pose,
    truth,
    twist,
)

BATCH, PERIOD_NS = 10, 10_000_000
BIAS_RADPS = np.array([0.006, -0.004, 0.009])  # 0.7 degrees a second, more than any part in radians
OFFSET_NS = 30_000_000


def readings(k: int) -> Imu:
    """Those of the tenth of a second before step k."""
    first = t_ns(k) - (BATCH - 1) * PERIOD_NS
    noise = 1e-3 * np.random.default_rng(k + 1).normal(size=(BATCH, 6))
    a, w = np.array([0, SPEED * RATE, 9.81]), np.array([0, 0, RATE])
    return Imu(first, a + noise[:, :3], w + noise[:, 3:], PERIOD_NS)


def drive(camera_ahead_ns: int = 0) -> list[Message]:
    """Round the circle by an IMU, from its true pose and velocity."""
    start = Start(
        readings(0).t_ns,
        *true_pose(-1),
        velocity=np.array([SPEED, 0, 0]),
        velocity_variance=np.full(3, 1e-4),
    )
    messages: list[Message] = [header(process=Process.IMU), start]
    for k in range(FRAMES):
        frame = stereo(k, sigma_px=0.5)
        messages += [readings(k), truth(k), replace(frame, t_ns=frame.t_ns + camera_ahead_ns)]
    return messages


def test_a_drive_by_imu_ends_near_the_truth(record: Record) -> None:
    summary = judged(record(drive()))
    assert summary["frames"] == FRAMES
    assert summary["imu_readings"] == BATCH * FRAMES
    assert summary["imu_refused"] == 0
    assert "other_process" not in summary
    assert summary["err0_m"] < 0.1


def test_the_summary_in_words_tells_of_readings(record: Record) -> None:
    said = run(record(drive()))
    assert f"{FRAMES} used, 0 refused; {BATCH * FRAMES} IMU readings, 0 refused\n" in said.stdout
    assert "twists" not in said.stdout.split("twist-timing")[1]


def test_what_does_not_move_the_body_is_told_once(record: Record) -> None:
    both = [m for k in range(FRAMES) for m in (twist(k), readings(k), stereo(k))]
    for process, due in (("twist", "Set process = imu"), ("imu", "set process = twist")):
        path = record([header(), *both])
        said = run(path, "--process", process, "--json")
        assert said.stderr.count(due) == 1
        assert said.stderr.count("refused") == 1
        assert said.summary["other_process"] == FRAMES


def test_a_recording_of_which_nothing_moves_the_body_has_failed(record: Record) -> None:
    path = record([header(), *(m for k in range(FRAMES) for m in (twist(k), stereo(k)))])
    said = run(path, "--process", "imu", status=RECORDING)
    assert f"none of {FRAMES} messages is of the setting process" in said.stderr


@pytest.mark.parametrize("program", ["pelorus-replay", "pelorus-replay-f64"])
def test_a_log_of_an_imu_has_the_bits_of_its_replay(
    compare: Compare, tmp_path: Path, program: str
) -> None:
    log = robots_log(tmp_path, drive(), program=program)
    assert sum(isinstance(m, Imu) for m in log) == FRAMES
    said = compare(log)
    assert said.status == SAME, said.out + said.err
    assert f"the same bits: {FRAMES} of {FRAMES} frames" in said.out


@pytest.mark.parametrize("ahead_ns", [OFFSET_NS, -OFFSET_NS])
def test_a_camera_with_its_own_clock_gives_the_same_drive(
    record: Record, compare: Compare, tmp_path: Path, ahead_ns: int
) -> None:
    log = tmp_path / "log.plr"
    poses = {}
    for ahead in (0, ahead_ns):
        offset = f"--camera-offset={-ahead / 1e9}"
        path = record(drive(ahead))
        run(path, offset, "--quiet", "--out", log)
        poses[ahead] = [m for m in log_of(log) if isinstance(m, Pose)]
    assert [p.pack() for p in poses[0]] == [p.pack() for p in poses[ahead_ns]]
    sent = [m.t_ns for m in log_of(log) if isinstance(m, Stereo)]
    answered = [m.t_ns for m in log_of(log) if isinstance(m, Report)]
    assert sent == answered
    assert [pose.t_ns for pose in poses[ahead_ns]] == [t - ahead_ns for t in sent]
    said = compare([m for m in log_of(log) if m.kind != Kind.END])
    assert said.status == SAME, said.out + said.err
    assert f"the same bits: {FRAMES} of {FRAMES} frames" in said.out


Break = Callable[[Imu], Imu]


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (lambda m: replace(m, a_B_mps2=np.full((BATCH, 3), np.nan)), "NaN or infinite"),
        (lambda m: replace(m, a_B_mps2=m.a_B_mps2 / 9.81), "it comes in g"),
        (lambda m: replace(m, a_B_mps2=-m.a_B_mps2), "a wrong sign?"),
        (lambda m: replace(m, w_B_radps=m.w_B_radps * 180 / np.pi), "rates in degrees"),
        (
            lambda m: replace(
                m, a_B_mps2=np.full((BATCH, 3), 9.81), w_B_radps=np.zeros((BATCH, 3))
            ),
            "the same numbers come again and again",
        ),
    ],
)
def test_what_is_wrong_with_an_imu_is_told_in_words(
    record: Record, tmp_path: Path, broken: Break, words: str
) -> None:
    """At rest, without a velocity that is given: then the readings say where up is."""
    messages: list[Message] = [header(process=Process.IMU), Start(readings(0).t_ns)]
    for k in range(FRAMES):
        imu = readings(k)
        still = replace(imu, w_B_radps=imu.w_B_radps - [0, 0, RATE] + BIAS_RADPS)
        messages += [broken(still), replace(stereo(0), t_ns=t_ns(k))]
    path = record(messages)
    log = tmp_path / "log.plr"
    run(path, "--quiet", "--out", log)
    told = [m.text for m in log_of(log) if isinstance(m, Text)]
    assert sum(words in text for text in told) == 1, told
    assert all(text.startswith("the IMU: ") for text in told)


def test_a_board_that_lost_its_state_is_given_its_velocity_too() -> None:
    covariance = np.zeros(21)
    covariance[[0, 2, 5]] = 1, 2, 3
    pose = Pose(
        5,
        v_B_mps=np.array([4.0, 5, 6]),
        bias=np.arange(6.0),
        velocity_covariance=covariance,
        bias_variance=np.arange(1.0, 7),
    )
    assert start_from(pose) == Start(5, flags=StartFlag.COVARIANCE)
    inertial = start_from(pose, inertial=True)
    assert inertial.flags == StartFlag.COVARIANCE | StartFlag.BIAS_PRIOR
    assert inertial.velocity.tolist() == [4, 5, 6]
    assert inertial.velocity_variance.tolist() == [1, 2, 3]
    assert inertial.bias_mean.tolist() == list(range(6))
    assert inertial.bias_variance.tolist() == list(range(1, 7))
    unknown = replace(pose, bias_variance=np.full(6, -1.0))
    assert start_from(unknown, inertial=True) == start_from(pose)
