# SPDX-License-Identifier: MIT
"""Everyday faults of a drive by an IMU are named; a clean one is not called faulty."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from imu_drives import NOISY, npz_arrays, options, written
from injected import OF_IMU
from pelorus.faults.imu_axes import Matrix
from pelorus.faults.mend import findings_of
from pelorus.faults.named import faults_in
from pelorus.io.recording import Recording
from pelorus.simulate import drive as way
from pelorus.simulate.simulate import Simulation, simulate
from pelorus.wire.layout import Floats


def driven(lap_s: float = 40.0) -> Simulation:
    """A quiet camera, so that some seconds tell what takes a minute with a noisy one."""
    return simulate(
        options(
            replace(NOISY, imu_rate_hz=100.0),
            seed=3,
            duration_s=20.0,
            lap_s=lap_s,
            pixel_sigma_px=0.3,
            bias_gyro_sigma_radps=0.005,
            loss=0.03,
            baseline_m=0.4,
        )
    )


@pytest.fixture(scope="module")
def drive() -> Recording:
    return driven().recording


NAMED = {  # and how strong
    "inverted": 0,
    "lever": 0,
    "mirrored": 1,
    "x-y": 1,
    "degrees": 0,
    "g": 0,
    "gravity": 0,
    "focal": 1,
    "baseline": 2,
    "clock": 1,
    "time-unit": 0,
}


@pytest.mark.parametrize(("name", "strength"), [*NAMED.items()])
def test_a_fault_of_an_imu_is_named(drive: Recording, name: str, strength: int) -> None:
    change, due = OF_IMU[name]
    if name == "baseline":  # told by forces: those of half the lap are twice as large
        drive = driven(20.0).recording
    said = faults_in(change(drive, strength))
    assert said, "nothing was named"
    assert said[0].name in due, said


def test_degrees_are_named_though_they_go_round_between_two_frames() -> None:
    """Two seconds of a walker's turn are 60 degrees; taken for radians, the gyro goes round once
    from frame to frame, and what is left of a turn fitted nothing.
    """
    turning = simulate(options(NOISY, seed=3, duration_s=12.0, lap_s=8.0, pixel_sigma_px=1.0))
    change, due = OF_IMU["degrees"]
    assert faults_in(turning.recording) == []
    assert faults_in(change(turning.recording, 0))[0].name in due


def test_a_level_floor_is_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    """The gyro's noise is all there is about two axes, and gravity all there is along one. Least
    squares took the noise for turns that the images do not show, and nothing fitted.
    """

    rolling, uneven = way.profile_at, way.profile_slope

    def level(t: Floats, speed_mps: float, lap_s: float) -> tuple[Floats, Floats]:
        v, w = rolling(t, speed_mps, lap_s)
        return v * [1, 0, 0], w * [0, 0, 1]

    def slope(t: Floats, speed_mps: float) -> Floats:
        return uneven(t, speed_mps) * [1, 0, 0]

    monkeypatch.setattr(way, "profile_at", level)
    monkeypatch.setattr(way, "profile_slope", slope)
    drive = simulate(options(NOISY, seed=3, duration_s=20.0, pixel_sigma_px=0.1)).recording
    assert not any(fault.stops for fault in faults_in(drive))
    change, due = OF_IMU["axes"]
    assert faults_in(change(drive, 0))[0].name in due


def test_forces_that_are_no_motions_fit_nothing(drive: Recording) -> None:
    chance = np.random.default_rng(1)
    noise = chance.normal(0, 1, (2, len(drive.inertial.t_ns), 3))
    own = drive.inertial._replace(w_B_radps=noise[0], a_B_mps2=5 * noise[1])
    assert [fault.name for fault in faults_in(replace(drive, inertial=own))] == ["no-fit"]


def test_the_converter_says_how_well_it_knows_that_a_clean_drive_has_no_faults(
    drive: Recording,
) -> None:
    [known] = findings_of(drive)
    assert not known.found
    assert re.search(
        r"scale of the way [\d.]+ \+- 0\.0\d+, clock [-+]\d+ \+- \d ms", known.evidence
    )
    assert "cannot be seen" in known.action


def test_the_converter_says_what_is_wrong(tmp_path: Path, pelorus: Run) -> None:
    simulated = driven()
    arrays = npz_arrays(simulated)
    arrays["imu"] = arrays["imu"] * np.array([1, 1, 1, -1, -1, -1])
    said = pelorus("convert", "imu-npz", written(tmp_path / "x.npz", arrays), tmp_path / "x.plr")
    assert "gravity-sign: FOUND" in said.out
    assert "wrong sign" in said.out


@pytest.mark.filterwarnings("error")
def test_axes_that_tell_nothing_are_held_against_without_a_scale() -> None:
    """With a gyro of zeros the likelihood ratio was NaN."""
    measured = Matrix(np.zeros((3, 3)), np.eye(9) * 1e-4, np.eye(9) * 1e-6)
    assert measured.held_against(np.zeros((3, 3))) == 0.0
    assert measured.held_against(np.eye(3)) > 0.0
