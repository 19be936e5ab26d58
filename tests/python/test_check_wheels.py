# SPDX-License-Identifier: MIT
"""Wheels beside an IMU: `pelorus check` tells a wrong radius and a wrong distance, `explain` that
they slip.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from pelorus.check import wheels
from pelorus.check.verdict import Grade, Remark
from pelorus.explain import explain
from pelorus.explain.incident import Cause
from pelorus.io.recording import Recording
from pelorus.native.replay import replayed
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.readings import Sensing
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Reading
from replay_drive import BIN

HALF_M = 0.25  # of the track


@pytest.fixture(scope="module")
def drive() -> Recording:
    """A minute at 1 m/s, round and round."""
    imu = SimulatedImu(imu_rate_hz=200.0, rest_s=2.0)
    sensing = {"wheel": Sensing(rate_hz=50.0, sigma=(0.03,))}
    options = Options(duration_s=60.0, speed_mps=1.0, lap_s=20.0, imu=imu, readings=sensing)
    return simulate(options).recording


def said(drive: Recording, readings: Sequence[Reading]) -> list[Remark]:
    program = BIN / "pelorus-replay"
    if not program.exists():
        pytest.skip(f"{program} is not built")
    messages = list(replace(drive, readings=list(readings)).messages())
    return wheels.remarks(program, messages, {})


def scaled(readings: Sequence[Reading], by: float) -> list[Reading]:
    return [replace(reading, value=by * reading.value) for reading in readings]


def test_a_true_scale_is_no_reason_for_care(drive: Recording) -> None:
    (remark,) = said(drive, drive.readings)
    assert remark.grade is Grade.GOOD
    assert remark.text.startswith("the wheels: against pictures and IMU the speed is ")
    assert said(drive, []) == []


def test_a_wrong_radius_is_told_to_a_third_of_a_percent_though_the_wheels_slip(
    drive: Recording,
) -> None:
    readings = scaled(drive.readings, 1.03)
    readings[500:700] = scaled(readings[500:700], 0.5)
    (remark,) = said(drive, readings)
    assert remark.grade is Grade.CARE
    divisor = float(remark.text.rpartition("by ")[2].rstrip(")"))
    assert divisor == pytest.approx(1.03, abs=0.003)


def test_wheels_that_stand_elsewhere_than_was_told_are_named(drive: Recording) -> None:
    truth, t_ns = drive.truth, drive.truth_t_ns
    heading = np.unwrap(np.arctan2(truth.R[:, 1, 0], truth.R[:, 0, 0]))
    turning = np.gradient(heading, t_ns * 1e-9)

    def wheel(told_m: float, true_m: float) -> list[Reading]:
        at = np.array([0.0, told_m, 0.0])
        return [
            replace(m, value=m.value - [np.interp(m.t_ns, t_ns, turning) * true_m, 0, 0], at_B_m=at)
            for m in drive.readings
        ]

    remarks = said(drive, [*wheel(HALF_M, 1.6 * HALF_M), *wheel(-HALF_M, -HALF_M)])
    far = [one.text for one in remarks if "distance of the wheels" in one.text]
    assert len(far) == 1
    assert far[0].startswith("the wheel at y = 0.25 m: by its readings it sits at y = 0.")
    assert float(far[0].partition("sits at y = ")[2].split()[0]) == pytest.approx(0.4, abs=0.06)


def test_a_sigma_that_is_too_small_is_told(drive: Recording) -> None:
    sure = [replace(m, sigma=0.2 * m.sigma) for m in drive.readings]
    assert any("times their sigma: tell a larger one" in one.text for one in said(drive, sure))


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
