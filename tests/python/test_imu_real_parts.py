# SPDX-License-Identifier: MIT
"""What real IMUs do and data sheets do not say, with default settings: motors that idle while the
body stands, a gyro whose bias is large, vibration in flight, a hard landing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imu_drives import NOISY, options
from pelorus.evaluate.health import NOT_STARTED, time_line
from pelorus.io.recording import Recording
from pelorus.simulate.imu import ImuFaults, StartGiven
from pelorus.simulate.simulate import simulate
from pelorus.wire.frames import Kind, Message, Report
from pelorus.wire.layout import Floats
from pelorus.wire.schema import number
from replay_drive import BIN, judged, log_of, run

IMU_FAULT, OFF = number("reason", "IMU_FAULT"), number("reason", "BIAS_OFF_PRIOR")
REST = replace(NOISY, rest_s=2.5, start=StartGiven.NONE)

pytestmark = pytest.mark.skipif(
    not (BIN / "pelorus-replay").exists(), reason=f"{BIN / 'pelorus-replay'} is not built"
)


def untold(recording: Recording) -> Recording:
    """As of a part of which nobody said how far its biases may be off."""
    noise = replace(recording.header.noise, bias_gyro_sigma_radps=-1.0, bias_accel_sigma=-1.0)
    return recording.with_header(noise=noise)


def drive(imu: Any = REST, faults: ImuFaults | None = None, **changes: Any) -> Recording:
    given = {"duration_s": 12.0, "pixel_sigma_px": 1.0, "frame_rate_hz": 20.0} | changes
    return untold(simulate(options(imu, faults, **given)).recording)


def reports(recording: Recording, tmp_path: Path, *settings: str) -> list[Report]:
    path, log = tmp_path / "drive.plr", tmp_path / "log.plr"
    recording.write(path)
    run(path, *settings, "--out", log)
    answers: list[Message] = log_of(log)
    return [m for m in answers if isinstance(m, Report) and m.subject == Kind.STEREO]


def demand_a_start(found: list[Report], seconds: float) -> None:
    """At rest, in so much time, without a fault, and good from there on."""
    waits = [m for m in found if m.reasons & NOT_STARTED]
    line = time_line(found)
    assert line is not None
    assert waits
    assert (waits[-1].t_ns - found[0].t_ns) * 1e-9 < seconds
    assert not any(m.reasons & (IMU_FAULT | OFF) for m in found)
    assert line.summary().startswith(f"good in {line.frames - 1} of {line.frames} frames"), (
        line.lines(0)
    )


@pytest.mark.parametrize(("force", "rate"), [(0.12, 0.2), (0.9, 0.25), (1.4, 0.45)])
def test_motors_that_idle_before_the_start(force: float, rate: float, tmp_path: Path) -> None:
    recording = drive(faults=ImuFaults(accel_vibration_mps2=force, gyro_vibration_radps=rate))
    demand_a_start(reports(recording, tmp_path), 1.2)
    assert judged(tmp_path / "drive.plr")["err0_m"] < 0.1


@pytest.mark.parametrize("bias", [(0.06, -0.02, 0.01), (-0.03, 0.11, -0.21)])
@pytest.mark.parametrize("settings", [(), ("--bias-gyro-sigma", "0.01")])
def test_a_gyro_with_a_large_bias(
    bias: tuple[float, ...], settings: tuple[str, ...], tmp_path: Path
) -> None:
    recording = drive()
    readings = recording.inertial._replace(w_B_radps=recording.inertial.w_B_radps + bias)
    recording = replace(recording, inertial=readings)
    demand_a_start(reports(recording, tmp_path, *settings), 1.2)
    assert judged(tmp_path / "drive.plr", *settings)["err0_m"] < 0.1


def hit(recording: Recording, from_s: float, seconds: float, force: Floats) -> Recording:
    """Meanwhile the accelerometer reads so much more, whatever the body does."""
    readings = recording.inertial
    at_s = (readings.t_ns - readings.t_ns[0]) * 1e-9
    struck = (at_s >= from_s) & (at_s < from_s + seconds)
    forces = readings.a_B_mps2 + struck[:, None] * force
    return replace(recording, inertial=readings._replace(a_B_mps2=forces))


@pytest.mark.parametrize(
    ("force", "seconds"),
    [((0.0, 0.0, 41.0), 0.12), ((-22.0, 6.0, 25.0), 0.5), ((18.0, -24.0, 0.0), 1.0)],
)
def test_a_hard_landing(force: tuple[float, ...], seconds: float, tmp_path: Path) -> None:
    recording = hit(drive(replace(NOISY, rest_s=0.0)), 5.0, seconds, np.array(force))
    found = reports(recording, tmp_path)
    late = [m.health for m in found if (m.t_ns - found[0].t_ns) * 1e-9 > 5 + seconds + 1]
    assert late
    assert not any(late)
    assert judged(tmp_path / "drive.plr")["err0_m"] < 0.1


@pytest.mark.parametrize("times", [12.0, 40.0])
def test_readings_that_scatter_more_than_their_data_sheet_says(
    times: float, tmp_path: Path
) -> None:
    """The noise in the HEADER is that of a sensor on a table."""
    noise = {"gyro_noise": 1.7e-4, "accel_noise": 2e-3}
    flown: dict[str, Any] = {name: times * density for name, density in noise.items()}
    recording = drive(replace(NOISY, rest_s=0.0, **flown), duration_s=30.0)
    told = replace(recording.header.noise, **noise)
    found = reports(recording.with_header(noise=told), tmp_path)
    assert np.mean([m.health == 0 for m in found]) > 0.98
    assert judged(tmp_path / "drive.plr")["nees_per_dof"] < 2
