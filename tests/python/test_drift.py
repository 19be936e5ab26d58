# SPDX-License-Identifier: MIT
"""An IMU's own noise in the scale of the way: against drives that differ in that noise alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pelorus.faults.agreement import Agreement, agreement
from pelorus.faults.amounts import of_scale_by_imu
from pelorus.faults.two_views import two_views
from pelorus.io.recording import Recording
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.simulate import Options, simulate

# so slow that gravity, by an attitude that drifts, is more than all the drive's own acceleration
SLOW = Options(
    duration_s=20.0,
    speed_mps=0.5,
    baseline_m=0.3,
    pixel_sigma_px=0.1,
    imu=SimulatedImu(imu_rate_hz=100.0),
)
FAST = replace(
    SLOW,
    duration_s=30.0,
    speed_mps=2.0,
    lap_s=10.0,
    baseline_m=0.2,
    pixel_sigma_px=0.5,
    imu=SimulatedImu(imu_rate_hz=200.0),
)
SEEDS = range(40, 45)


def agreed(recording: Recording) -> Agreement:
    return agreement(recording, two_views(recording.tracks, recording.header.camera, 1))


def test_noise_that_the_readings_integrate_is_in_the_sigma_of_the_scale() -> None:
    found = [agreed(simulate(replace(SLOW, seed=seed)).recording) for seed in SEEDS]
    z = np.array([(one.scale - 1) / one.scale_sigma for one in found])
    assert np.abs(z).max() < 3
    assert np.sqrt(np.mean(z**2)) < 1.6
    off = np.array([one.scale - 1 for one in found])
    assert np.sqrt(np.mean(off**2)) > 0.03, "or the drives show nothing of it"
    assert not [fault for one in found for fault in of_scale_by_imu(one)]


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_wrong_baseline_is_named_where_the_drive_shows_it(factor: float) -> None:
    recording = simulate(replace(FAST, seed=201)).recording
    camera = recording.header.camera
    wrong = recording.with_header(camera=replace(camera, baseline_m=factor * camera.baseline_m))
    assert not list(of_scale_by_imu(agreed(recording)))
    (fault,) = of_scale_by_imu(agreed(wrong))
    assert "scale" in fault.words


def test_noise_that_the_file_overstates_hides_no_wrong_baseline() -> None:
    recording = simulate(replace(FAST, seed=202)).recording
    noise = recording.header.noise
    told = recording.with_header(
        noise=replace(noise, gyro_noise=30 * noise.gyro_noise, accel_noise=30 * noise.accel_noise)
    )
    assert agreed(told).scale_sigma < 1.5 * agreed(recording).scale_sigma
