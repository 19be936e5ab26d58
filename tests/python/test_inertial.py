# SPDX-License-Identifier: MIT
"""Readings of an IMU: integrated, interpolated, packed into messages."""

from __future__ import annotations

import numpy as np
import pytest
from imu_drives import options
from pelorus.math import inertial, se3
from pelorus.math.inertial import Inertial, MotionState
from pelorus.math.motion import Times
from pelorus.simulate.imu import SimulatedImu as Sensor
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import simulate
from pelorus.wire.frames import IMU_READINGS_MAX, Imu
from scipy.linalg import expm

G = np.array([0.0, 0.0, -9.81])


def exact(rate: float) -> Sensor:
    return Sensor(rate, *(0.0,) * 5)


@pytest.mark.parametrize("size", [1e-9, 1e-3, 0.3])
def test_a_step_is_exact_for_a_constant_reading(size: float) -> None:
    """The state (R, v_W, p) of a constant reading is a matrix exponential of 5 x 5."""
    chance = np.random.default_rng(1)
    w, a, v_W, p = chance.normal(size=(4, 3))
    w *= size / np.linalg.norm(w)
    R = se3.exp(np.zeros(3), chance.normal(size=3)).R
    generator = np.zeros((5, 5))  # of [R, v_W, p; 0, 1, tau; 0, 0, 1] in a falling frame
    generator[:3, :3], generator[:3, 3], generator[3, 4] = se3.skew(w), a, 1.0
    moved = expm(generator)
    found = inertial.step(MotionState(R, p, R.T @ v_W), np.array(1.0), a, w, G)
    assert np.allclose(found.R, R @ moved[:3, :3], atol=1e-13)
    assert np.allclose(found.R @ found.v_B, v_W + R @ moved[:3, 3] + G, atol=1e-12)
    assert np.allclose(found.p, p + v_W + 0.5 * G + R @ moved[:3, 4], atol=1e-12)


@pytest.mark.parametrize("stop", [None, Span(3.0, 1.0)])
@pytest.mark.parametrize("rest", [0.0, 1.0])
def test_perfect_readings_lead_along_the_truth_better_by_the_square_of_the_rate(
    rest: float, stop: Span | None
) -> None:
    """Frames, axes and gravity are those of the equations, and the drive has its accelerations."""
    errors = []
    for rate in (100.0, 200.0, 400.0):
        imu = Sensor(rate, *(0.0,) * 5, rest_s=rest)
        drive = simulate(options(imu, stop=stop)).recording
        assert drive.truth_velocity is not None
        first = MotionState(drive.truth.R[0], drive.truth.p[0], drive.truth_velocity[0])
        path = inertial.path(drive.inertial, first, 9.81)
        at = np.searchsorted(drive.inertial.t_ns, drive.truth_t_ns)
        assert np.abs(path.R[at] - drive.truth.R).max() < 3e-6
        assert np.abs(path.v_B[at] - drive.truth_velocity).max() < 2e-3
        errors.append(np.abs(path.p[at] - drive.truth.p).max())
    assert errors[0] < 3e-3
    assert np.divide(errors[:2], errors[1:]) == pytest.approx(4.0, rel=0.05)


def test_stretches_that_cut_intervals_are_interpolated() -> None:
    """Frames between readings: coasting from frame to frame is as good as reading by reading."""
    drive = simulate(options(exact(333.0))).recording
    assert drive.truth_velocity is not None
    starts = MotionState(drive.truth.R[:-1], drive.truth.p[:-1], drive.truth_velocity[:-1])
    t_ns = drive.truth_t_ns
    found = inertial.coasted(drive.inertial, t_ns[:-1], t_ns[1:], starts, 9.81)
    assert np.abs(found.p - drive.truth.p[1:]).max() < 1e-6
    assert np.abs(found.R - drive.truth.R[1:]).max() < 1e-7


def test_times_of_today_are_interpolated_to_the_nanosecond() -> None:
    t_ns = 1_700_000_000_000_000_000 + np.arange(3) * 1000
    readings = Inertial(t_ns, np.arange(9.0).reshape(3, 3), np.zeros((3, 3)))
    found = readings.between(t_ns[:1] + np.array([1, 1500, -5, 9999]))
    assert np.allclose(found.a_B_mps2[:, 0], [0.003, 4.5, 0.0, 6.0])


def batches(t_ns: Times, cuts: Times, most: int = IMU_READINGS_MAX) -> list[list[int]]:
    """The times of each message; and what they hold is what was given."""
    rows = np.arange(3.0 * len(t_ns)).reshape(-1, 3)
    readings = Inertial(t_ns, rows, -rows)
    found = list(inertial.messages(readings, cuts, most))
    assert np.array_equal(np.concatenate([m.a_B_mps2 for _, m in found]), rows)
    assert np.array_equal(np.concatenate([m.w_B_radps for _, m in found]), -rows)
    assert all(t == end for (t, _), end in zip(found, ends(t_ns, found), strict=True))
    assert all(message.pack() for _, message in found)
    return [m.times_ns for _, m in found]


def ends(t_ns: Times, found: list[tuple[int, Imu]]) -> list[int]:
    last = np.cumsum([len(m.a_B_mps2) for _, m in found]) - 1
    return [int(t) for t in t_ns[last]]


def test_a_batch_ends_at_a_frame_and_the_reading_of_its_time_comes_before_it() -> None:
    t_ns = np.arange(12) * 10
    found = batches(t_ns, np.array([30, 75]))
    assert found == [[0, 10, 20, 30], [40, 50, 60, 70], [80, 90, 100, 110]]
    assert [len(times) for times in batches(t_ns, np.array([1000]), 5)] == [5, 5, 2]
    assert all(len(times) == 1 for times in batches(t_ns, np.array([0]), 1))


def test_a_batch_keeps_every_stamp_to_a_ten_millionth_of_a_second() -> None:
    chance = np.random.default_rng(1)
    t_ns = np.cumsum(chance.integers(2_499_000, 2_501_000, 400))
    t_ns[200:] += 90_000_000  # readings that are lost
    told = [t for times in batches(t_ns, np.empty(0, np.int64)) for t in times]
    assert np.abs(np.array(told) - t_ns).max() <= 100
    assert len(told) == 400
    even = 9 + np.arange(400) * 2_500_057 + chance.integers(-1, 2, 400)
    assert len(batches(even, np.empty(0, np.int64))) == 20, "stamps that are rounded do no harm"


@pytest.mark.parametrize("pause_s", [4.28, 4.31, 9.0, 86_400.0])
def test_readings_beyond_a_pause_of_any_length_can_be_written(pause_s: float) -> None:
    """The period of a batch is an u32 of ns, 4.29 s at most."""
    for before in range(1, 20):
        t_ns = np.arange(30) * 10_000_000
        t_ns[before:] += round(pause_s * 1e9)
        told = [t for times in batches(t_ns, np.array([105_000_000])) for t in times]
        assert told == t_ns.tolist()
