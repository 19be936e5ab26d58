# SPDX-License-Identifier: MIT
"""Wheels beside an IMU: a wrong radius and a wrong distance are faults with one verdict, a slip is
an event of `explain`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from pelorus.check.contents import recording_of
from pelorus.explain import explain
from pelorus.explain.log import Cause
from pelorus.faults.fault import Fault
from pelorus.faults.named import judged_of
from pelorus.io.recording import Recording
from pelorus.native.replay import replayed
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.readings import Sensing
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Reading
from replay_drive import BIN

HALF_M = 0.25  # of the track
OPTIONS = Options(
    duration_s=40.0,
    speed_mps=1.0,
    lap_s=20.0,
    imu=SimulatedImu(imu_rate_hz=200.0, rest_s=2.0),
    readings={"wheel": Sensing(rate_hz=50.0, sigma=(0.03,))},
)


@pytest.fixture(scope="module")
def drive() -> Recording:
    """Forty seconds at 1 m/s, round and round."""
    return simulate(OPTIONS).recording


def found(drive: Recording, readings: Sequence[Reading]) -> dict[str, Fault]:
    """Returns the faults of the wheels, by name."""
    messages = list(replace(drive, readings=list(readings)).messages())
    faults = judged_of(messages, recording_of(messages)).faults
    assert all(fault.name.startswith("wheel-") for fault in faults)
    assert not any(fault.stops or fault.grave for fault in faults)
    return {fault.name: fault for fault in faults}


def scaled(readings: Sequence[Reading], by: float) -> list[Reading]:
    return [replace(reading, value=by * reading.value) for reading in readings]


def pair(drive: Recording, apart: float) -> list[Reading]:
    """Returns readings of two wheels that are `apart` times as far apart as is told."""
    truth, t_ns = drive.truth, drive.truth_t_ns
    heading = np.unwrap(np.arctan2(truth.R[:, 1, 0], truth.R[:, 0, 0]))
    turning = np.gradient(heading, t_ns * 1e-9)
    return [
        replace(m, value=m.value - [np.interp(m.t_ns, t_ns, turning) * y * apart, 0, 0],
                at_B_m=np.array([0.0, y, 0.0]))
        for m in drive.readings for y in (HALF_M, -HALF_M)
    ]  # fmt: skip


def test_true_wheels_are_no_fault(drive: Recording) -> None:
    assert found(drive, []) == {}
    assert found(drive, drive.readings) == {}
    assert found(drive, pair(drive, 1.0)) == {}


@pytest.mark.parametrize("by", [0.94, 1.03])
def test_a_wrong_radius_is_told_to_half_a_percent_though_the_wheels_slip(
    by: float, drive: Recording
) -> None:
    readings = scaled(drive.readings, by)
    readings[500:700] = scaled(readings[500:700], 0.5)
    (fault,) = found(drive, readings).values()
    assert fault.name == "wheel-scale"
    assert ("smaller" if by > 1 else "larger") in fault.words
    factor = float(fault.words.rpartition("multiply the speed by ")[2].partition(")")[0])
    assert factor == pytest.approx(1 / by, abs=0.005)


@pytest.mark.parametrize("apart", [0.8, 1.15])
def test_wheels_that_are_farther_apart_than_was_told_are_named(
    apart: float, drive: Recording
) -> None:
    (fault,) = found(drive, pair(drive, apart)).values()
    assert fault.name == "wheel-track"
    told = float(fault.words.partition("the wheels are ")[2].split()[0])
    assert told == pytest.approx(apart, abs=0.03)


def test_a_sigma_that_is_too_small_is_told(drive: Recording) -> None:
    (fault,) = found(drive, [replace(m, sigma=0.2 * m.sigma) for m in drive.readings]).values()
    assert "times their sigma: tell a larger one" in fault.words


def test_a_wrong_radius_has_one_verdict_in_every_command_until_the_filter_estimates_it(
    tmp_path: Path, pelorus: Run
) -> None:
    short = simulate(replace(OPTIONS, duration_s=16.0, seed=3)).recording
    path, conf = tmp_path / "drive.plr", tmp_path / "tuned.conf"
    replace(short, readings=scaled(short.readings, 1.06)).write(path)
    before = json.loads(pelorus("explain", path, "--json").out)
    assert any("times the wheels' speed" in words for words in before["why"])
    assert before["what_to_set"]["calibrate"] == "wheel-scale"
    said = pelorus("check", path, "--out", conf).out
    assert f"with the settings as they are: {before['verdict']}" in said
    assert "calibrate = wheel-scale" in conf.read_text()
    after = json.loads(pelorus("explain", path, "--json", "--config", conf).out)
    assert after["grade"] == "good"
    assert said.startswith(after["verdict"])


def test_wheels_that_slip_are_an_event_with_both_speeds(drive: Recording) -> None:
    program = BIN / "pelorus-replay"
    if not program.exists():
        pytest.skip(f"{program} is not built")

    def told(readings: list[Reading]) -> list[tuple[Cause, str, float, float]]:
        messages = list(replace(drive, readings=readings).messages())
        found = explain(replayed(program, messages, ()))
        seconds = (found.seconds(e.to_ns) for e in found.episodes)
        return [
            (e.first.cause, e.first.words, found.seconds(e.from_ns), to_s)
            for e, to_s in zip(found.episodes, seconds, strict=True)
        ]

    assert told(list(drive.readings)) == []
    readings = list(drive.readings)
    readings[1000:1250] = scaled(readings[1000:1250], 0.5)  # from 20 to 25 s
    ((cause, words, from_s, to_s),) = told(readings)
    assert cause is Cause.READINGS_OFF
    assert from_s == pytest.approx(20.0, abs=0.2)
    assert 24.9 < to_s < 26.5
    wheels_mps, body_mps = (float(word) for word in words.split() if word[0].isdigit())
    assert wheels_mps == pytest.approx(0.5 * body_mps, abs=0.03)
