# SPDX-License-Identifier: MIT
"""Everyday faults of a drive by an IMU are named; a clean one is not called faulty."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from imu_drives import NOISY, npz_arrays, options, written
from pelorus import se3
from pelorus.faults.mend import held_to_fit
from pelorus.faults.named import faults_in
from pelorus.recording import Recording
from pelorus.simulation.simulate import Simulation, simulate

MIRROR = np.diag([1.0, -1.0, 1.0])
SWAP = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])


def driven() -> Simulation:
    """A quiet camera, so that some seconds tell what takes a minute with a noisy one."""
    return simulate(
        options(
            replace(NOISY, imu_rate_hz=100.0),
            seed=3,
            duration_s=20.0,
            pixel_sigma_px=0.3,
            bias_gyro_sigma_radps=0.005,
            loss=0.03,
            baseline_m=0.4,
        )
    )


@pytest.fixture(scope="module")
def drive() -> Recording:
    return driven().recording


def read_as(recording: Recording, of_gyro: np.ndarray, of_force: np.ndarray) -> Recording:
    """An IMU in other axes or units."""
    own = recording.inertial
    turned = own._replace(w_B_radps=own.w_B_radps @ of_gyro.T, a_B_mps2=own.a_B_mps2 @ of_force.T)
    return replace(recording, inertial=turned)


def longer(recording: Recording, baseline: float, focal: float) -> Recording:
    """Another calibration than the camera's own."""
    camera = recording.header.camera
    return recording.with_header(
        camera=replace(
            camera,
            baseline_m=baseline * camera.baseline_m,
            fx_px=focal * camera.fx_px,
            fy_px=focal * camera.fy_px,
        )
    )


def later(recording: Recording, by_ns: int) -> Recording:
    return replace(recording, frame_t_ns=recording.frame_t_ns + by_ns)


def in_microseconds(recording: Recording) -> Recording:
    own = recording.inertial
    return replace(recording, inertial=own._replace(t_ns=own.t_ns // 1000))


NONE = np.eye(3)
FAULTS: dict[str, tuple[Callable[[Recording], Recording], str]] = {
    "extrinsic inverted": (lambda r: r.with_extrinsic(se3.inverse(r.T_CB)), "inverted"),
    "position in place of the translation": (
        lambda r: r.with_extrinsic(r.T_CB._replace(p=-r.T_CB.R.T @ r.T_CB.p)),
        "lever",
    ),
    "left-handed axes": (lambda r: read_as(r, -MIRROR, MIRROR), "axes"),
    "x and y of the force swapped, on level ground": (lambda r: read_as(r, NONE, SWAP), "axes"),
    "degrees": (lambda r: read_as(r, NONE * 180 / np.pi, NONE), "unit-degrees"),
    "g": (lambda r: read_as(r, NONE, NONE / 9.81), "unit-force"),
    "force of the wrong sign": (lambda r: read_as(r, NONE, -NONE), "gravity-sign"),
    "focal length": (lambda r: longer(r, 1.0, 1.05), "scale"),
    "baseline": (lambda r: longer(r, 1.12, 1.0), "scale"),
    "clock": (lambda r: later(r, 30_000_000), "clock"),
    "microseconds": (in_microseconds, "time-unit"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_an_imu_is_named(drive: Recording, name: str) -> None:
    change, due = FAULTS[name]
    said = faults_in(change(drive))
    assert said, "nothing was named"
    assert said[0].name == due, said


def test_forces_that_are_no_motions_fit_nothing(drive: Recording) -> None:
    chance = np.random.default_rng(1)
    noise = chance.normal(0, 1, (2, len(drive.inertial.t_ns), 3))
    own = drive.inertial._replace(w_B_radps=noise[0], a_B_mps2=5 * noise[1])
    assert [fault.name for fault in faults_in(replace(drive, inertial=own))] == ["no-fit"]


def test_the_converter_says_how_well_it_knows_that_a_clean_drive_has_no_faults(
    drive: Recording,
) -> None:
    [known] = held_to_fit(drive, drive, [])[1]
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
    assert said.status == 0, said.err
    assert "gravity-sign: FOUND" in said.out
    assert "wrong sign" in said.out
