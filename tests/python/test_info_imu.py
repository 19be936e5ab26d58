# SPDX-License-Identifier: MIT
"""What `info` tells of an IMU: rates, gaps, ranges, faults, and its noise where the body stood."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Converted, Run
from imu_drives import EXACT, NOISY, options
from pelorus.evaluate import inertial_survey
from pelorus.evaluate.inertial_survey import Still
from pelorus.simulate.imu import ImuFaults
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import simulate


def written(path: Path, faults: ImuFaults | None = None, imu: Any = NOISY, **changes: Any) -> Path:
    simulate(options(imu, faults, **changes)).recording.write(path)
    return path


def test_rates_gaps_and_ranges_are_those_of_the_readings(tmp_path: Path, pelorus: Run) -> None:
    faults = ImuFaults(imu_missing=Span(2.0, 0.5), accel_range_mps2=10.0)
    path = written(tmp_path / "gap.plr", faults)
    said = pelorus("info", path)
    words = " ".join(said.out.split())
    assert "moved by an IMU" in words
    assert "IMU 0.000 6.000 200.00 1 0.505" in words
    assert "gap: IMU pauses for 0.505 s after 1.995 s" in words
    assert "1101 readings of an IMU: accelerometer" in words
    assert "to 10 m/s^2, gyro" in words, "saturated"
    found = json.loads(pelorus("info", "--json", path).out)
    assert found["streams"]["IMU"]["count"] == 1101
    assert found["imu"]["accel_range"][2][1] == pytest.approx(10.0)
    assert found["header"]["process"] == "imu"
    assert found["imu"]["still"] is None


def still_of(imu: Any, faults: ImuFaults | None = None, **changes: Any) -> Still | None:
    recording = simulate(options(imu, faults, landmarks=5, **changes)).recording
    return inertial_survey.survey(recording.inertial).still


@pytest.mark.parametrize(("gyro", "accel"), [(1e-3, 1e-2), (2e-4, 2e-3), (5e-3, 5e-2)])
def test_where_it_stands_its_noise_its_bias_and_gravity_are_measured(
    gyro: float, accel: float
) -> None:
    imu = replace(NOISY, gyro_noise=gyro, accel_noise=accel, gyro_walk=0.0, accel_walk=0.0)
    imu = replace(imu, rest_s=20.0, bias_accel_sigma_mps2=0.0, gravity_mps2=9.7)
    changes: dict[str, Any] = {"duration_s": 40.0, "bias_gyro_sigma_radps": 0.02}
    found = still_of(imu, **changes)
    assert found is not None
    assert found.from_ns == 0
    assert found.to_ns == pytest.approx(20e9, abs=1e9)
    assert found.gyro_noise == pytest.approx(gyro, rel=0.1)
    assert found.accel_noise == pytest.approx(accel, rel=0.1)
    assert found.force_mps2 == pytest.approx(9.7, abs=accel)
    truth = simulate(options(imu, landmarks=5, **changes)).imu
    assert truth is not None
    assert np.allclose(found.rate_radps, truth.bias_gyro[0], atol=gyro)


def test_the_longest_stand_is_found_in_the_middle_and_beside_a_motor() -> None:
    faults = ImuFaults(accel_vibration_mps2=0.4, gyro_vibration_radps=0.03)
    for spoilt in (None, faults):
        found = still_of(NOISY, spoilt, duration_s=30.0, stop=Span(10.0, 8.0))
        assert found is not None
        assert 9.0 < found.from_ns * 1e-9 < 10.6
        assert 17.4 < found.to_ns * 1e-9 < 18.6


@pytest.mark.parametrize("imu", [EXACT, NOISY])
def test_a_drive_without_a_stand_has_none(imu: Any) -> None:
    assert still_of(imu, duration_s=60.0) is None
    assert still_of(imu, duration_s=3.0, stop=Span(1.5, 1.2)) is None, "too short"


@pytest.mark.parametrize(
    ("faults", "said"),
    [
        (ImuFaults(imu_nan=0.05), "readings are not finite"),
        (ImuFaults(imu_frozen=Span(3.0, 1.0)), "201 successive readings have the same numbers"),
        (ImuFaults(accel_in_g=True), "at rest it feels"),
    ],
)
def test_what_cannot_be_right_is_remarked(
    tmp_path: Path, pelorus: Run, faults: ImuFaults, said: str
) -> None:
    imu = replace(NOISY, rest_s=2.5)
    assert said in pelorus("info", written(tmp_path / "bad.plr", faults, imu)).out
    assert "note:" not in pelorus("info", written(tmp_path / "good.plr", None, imu)).out


def test_readings_whose_time_goes_back_are_surveyed_too() -> None:
    readings = simulate(options(NOISY)).recording.inertial
    back = readings._replace(t_ns=readings.t_ns[::-1])
    found = inertial_survey.survey(back)
    assert found.readings == len(readings.t_ns)
    assert found.still is None
    one = inertial_survey.survey(readings.at(slice(0, 1)))
    assert one.still is None
    assert one.longest_same == 1


def test_real_readings_at_rest_are_noisier_than_their_data_sheet(
    of_imu: Callable[[str], Converted],
) -> None:
    """EuRoC's before the flight: by this, and not by a data sheet, its noises are set."""
    recording, _ = of_imu("euroc-V102-real-imu")
    found = inertial_survey.survey(recording.inertial).still
    assert found is not None
    noise = recording.header.noise
    assert 5 < found.gyro_noise / noise.gyro_noise < 8
    assert 5 < found.accel_noise / noise.accel_noise < 8
    assert found.force_mps2 == pytest.approx(9.81, abs=0.1)
