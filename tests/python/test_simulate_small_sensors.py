# SPDX-License-Identifier: MIT
"""The simulator's wheel, standstill and position: what they read, and what becomes of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from drives import PERFECT
from pelorus import se3
from pelorus.errors import PelorusError
from pelorus.frames import Reading, Sensor
from pelorus.simulation.mishaps import Mishaps
from pelorus.simulation.simulate import Options, simulate
from pelorus.simulation.small_sensors import ANTENNA_AT_B_M, WHEEL_AT_B_M
from pelorus.survey import survey
from replay_drive import judged

EXACT = replace(
    PERFECT, wheel_hz=10.0, position_hz=10.0, wheel_sigma_mps=1e-9, position_sigma_m=1e-9
)


def readings(options: Options, sensor: Sensor) -> list[Reading]:
    return [m for m in simulate(options).recording.readings if m.sensor == sensor]


def test_a_wheel_reads_the_velocity_of_its_own_point() -> None:
    recording = simulate(EXACT).recording
    every = len(recording.twist_t_ns) // (len(recording.truth_t_ns) - 1)
    v, w = recording.v_B_mps[::every], recording.w_B_radps[::every]  # no noise, no bias
    found = readings(EXACT, Sensor.WHEEL)
    assert [m.t_ns for m in found] == recording.truth_t_ns.tolist()
    for m, v_k, w_k in zip(found, v, w, strict=True):
        assert m.value[:2] == pytest.approx((v_k + np.cross(w_k, m.at_B_m))[:2], abs=1e-7)
        assert (m.axes, m.value[2]) == (3, 0)
        assert np.array_equal(m.at_B_m, WHEEL_AT_B_M)
    assert np.abs(np.cross(w, WHEEL_AT_B_M)[:, :2]).max() > 0.01  # the arm is seen


def test_a_position_is_that_of_its_own_point_and_sees_a_jump() -> None:
    jumps = replace(EXACT, mishaps=Mishaps(jump_m=2.0, jump_at_s=5.0))
    for options in (EXACT, jumps):
        recording = simulate(options).recording
        where = se3.apply(recording.truth, np.broadcast_to(ANTENNA_AT_B_M, recording.truth.p.shape))
        found = readings(options, Sensor.POSITION)
        assert np.abs([m.value for m in found] - where).max() < 1e-7
        assert all(m.axes == 7 for m in found)


def test_noise_has_the_size_that_is_told() -> None:
    quiet = replace(EXACT, duration_s=200.0, observations=5)
    noisy = replace(quiet, wheel_sigma_mps=0.3, position_sigma_m=2.0)
    for sensor, axes, sigma in ((Sensor.WHEEL, 2, 0.3), (Sensor.POSITION, 3, 2.0)):
        exact = np.array([m.value for m in readings(quiet, sensor)])
        off = np.array([m.value for m in readings(noisy, sensor)]) - exact
        assert off[:, :axes].std() == pytest.approx(sigma, rel=0.05)
        assert all(m.sigma.tolist() == [sigma] * 3 for m in readings(noisy, sensor))


def test_small_sensors_leave_the_rest_of_the_drive_as_it_was() -> None:
    plain, aided = simulate(PERFECT).recording, simulate(EXACT).recording
    assert np.array_equal(plain.tracks.pixels, aided.tracks.pixels)
    assert np.array_equal(plain.v_B_mps, aided.v_B_mps)
    assert plain.readings == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"wheel_hz": 30.0}, "--wheel is 30.0"),
        ({"position_hz": 1000.0}, "--position is 1000.0"),
        ({"standstill_hz": 10.0}, "--standstill is 10.0: --parked"),
        ({"wheel_hz": -1.0}, "--wheel is -1.0"),
        ({"wheel_sigma_mps": 0.0}, "--wheel-sigma is 0.0"),
    ],
)
def test_what_makes_no_sense_is_refused(changes: dict[str, float], words: str) -> None:
    with pytest.raises(PelorusError, match=words):
        simulate(replace(Options(), **changes))  # type: ignore[arg-type]


def test_the_filter_is_better_with_them_than_without(tmp_path: Path, pelorus: Run) -> None:
    """A velocity with a bias that no picture tells. The wheel does not know z, the gyro is good."""
    common = ("--duration", 20, "--velocity-sigma", 0.5, "--bias-velocity-sigma", 0.2,
              "--gyro-sigma", 0.001, "--bias-gyro-sigma", 0)  # fmt: skip
    error = {}
    for name, options in {
        "plain": (),
        "wheel": ("--wheel", 100, "--wheel-sigma", 0.01),
        "position": ("--position", 5),
    }.items():
        path = tmp_path / f"{name}.plr"
        said = pelorus("simulate", path, *common, *options)
        assert said.status == 0, said.err
        assert ("readings" in said.out) is (name != "plain")
        told = judged(path, "--mode", "dead_reckoning")
        assert told["messages_refused"] == 0
        error[name] = told["err0_m"]
        assert survey(path).remarks == []
    assert error["position"] < 0.2 < error["plain"]
    assert error["wheel"] < 0.6 * error["plain"]


def test_a_robot_that_says_that_it_stands_stays_where_it_is(tmp_path: Path, pelorus: Run) -> None:
    path = tmp_path / "parked.plr"
    said = pelorus("simulate", path, "--parked", "--standstill", 10, "--duration", 20)
    assert said.status == 0, said.err
    told = judged(path, "--mode", "dead_reckoning")
    assert told["messages_refused"] == 0
    assert told["err0_m"] < 0.01


def test_sensors_that_measure_at_one_time_are_no_fault(tmp_path: Path, pelorus: Run) -> None:
    path = tmp_path / "both.plr"
    assert pelorus("simulate", path, "--duration", 5, "--wheel", 10, "--position", 5).status == 0
    said = pelorus("info", path)
    assert "READING" in said.out
    assert "does not ascend" not in said.out
