# SPDX-License-Identifier: MIT
"""The simulated IMU: noise and biases as told, honest starts, and every fault by itself."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run, messages_of
from imu_drives import EXACT, NOISY, options
from pelorus.errors import PelorusError
from pelorus.simulate.imu import ImuFaults, StartGiven
from pelorus.simulate.mishaps import Mishaps
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import Simulation, simulate
from pelorus.wire import framing
from pelorus.wire.frames import Header, Imu, Process, Start, Stereo, Twist
from pelorus.wire.layout import Floats, unpack_symmetric
from replay_drive import BIN


def drive(faults: ImuFaults | None = None, imu: Any = EXACT, **changes: Any) -> Simulation:
    return simulate(options(imu, faults, **changes))


def told(simulation: Simulation) -> Floats:
    """(n, 6): a, then w."""
    return np.hstack(simulation.recording.inertial[1:])


def test_the_recording_says_what_it_is_of(tmp_path: Path, pelorus: Run) -> None:
    target = tmp_path / "imu.plr"
    said = pelorus("simulate", target, "--imu-rate", 400, "--duration", 3, "--pixel-sigma", 0.5)
    assert "1201 IMU readings" in said.out
    assert not messages_of(target, Twist)
    assert sum(len(m.a_B_mps2) for m in messages_of(target, Imu)) == 1201
    header = messages_of(target, Header)[0]
    assert header.process is Process.IMU
    noise = header.noise
    assert (noise.gyro_noise, noise.accel_noise, noise.gravity) == (1e-3, 1e-2, 9.81)
    assert (noise.gyro_walk, noise.accel_walk) == (1e-4, 1e-3)
    assert (noise.bias_accel_sigma, noise.bias_gyro_sigma_radps) == (0.05, 0.005)
    assert noise.pixel_sigma_px == 0.5
    assert noise.velocity_sigma_mps < 0, "there are no twists"


def test_the_same_seed_gives_the_same_landmarks_with_and_without_an_imu() -> None:
    one, two = drive(), drive(imu=replace(EXACT, imu_rate_hz=1000.0))
    assert np.array_equal(one.points_W, two.points_W)
    assert np.array_equal(one.recording.tracks.id, two.recording.tracks.id)
    assert np.abs(one.recording.tracks.pixels - two.recording.tracks.pixels).max() < 1e-6
    assert np.allclose(one.recording.truth.p, two.recording.truth.p, atol=1e-9)


def test_white_noise_has_the_density_asked_for_at_every_rate() -> None:
    for rate in (100.0, 500.0):
        imu = replace(EXACT, imu_rate_hz=rate, gyro_noise=2e-3, accel_noise=3e-2)
        found = drive(imu=imu, duration_s=40.0)
        assert found.imu is not None
        noise = told(found) - np.hstack(found.imu.true[1:])
        assert noise[:, :3].std() == pytest.approx(3e-2 * np.sqrt(rate), rel=0.03)
        assert noise[:, 3:].std() == pytest.approx(2e-3 * np.sqrt(rate), rel=0.03)
        assert abs(np.corrcoef(noise[1:].ravel(), noise[:-1].ravel())[0, 1]) < 0.03


def test_biases_are_drawn_and_walk_as_asked_for() -> None:
    imu = replace(EXACT, gyro_walk=1e-3, accel_walk=2e-2)
    found = drive(imu=imu, duration_s=200.0, landmarks=10)
    assert found.imu is not None
    for bias, walk in ((found.imu.bias_accel, 2e-2), (found.imu.bias_gyro, 1e-3)):
        assert (bias[0] == 0).all()
        seconds = np.diff(bias[::200], axis=0)
        assert seconds.std() == pytest.approx(walk, rel=0.1)
    assert found.recording.truth_bias is not None
    at_frames = found.imu.bias_accel[::20]
    assert np.allclose(found.recording.truth_bias[:, :3], at_frames, atol=1e-12)
    imu = replace(EXACT, bias_accel_sigma_mps2=0.2)
    drawn = [
        drive(imu=imu, seed=seed, duration_s=0.1, landmarks=1, bias_gyro_sigma_radps=0.03).imu
        for seed in range(100)
    ]
    assert np.std([s.bias_accel[0] for s in drawn if s]) == pytest.approx(0.2, rel=0.15)
    assert np.std([s.bias_gyro[0] for s in drawn if s]) == pytest.approx(0.03, rel=0.15)


def test_at_rest_it_feels_gravity_alone_and_then_sets_off_smoothly() -> None:
    found = drive(imu=replace(EXACT, rest_s=2.0, gravity_mps2=9.7), duration_s=10.0)
    readings = found.recording.inertial
    rests = readings.t_ns < 2_000_000_000
    up = found.recording.truth.R[0].T @ [0, 0, 9.7]
    assert np.allclose(readings.a_B_mps2[rests], up, atol=1e-12)
    assert (readings.w_B_radps[rests] == 0).all()
    assert np.abs(np.diff(readings.a_B_mps2, axis=0)).max() < 0.03, "no jerk"
    assert found.recording.truth_velocity is not None
    assert np.linalg.norm(found.recording.truth_velocity[-1]) > 2


def test_a_stop_is_a_stand_between_two_ramps() -> None:
    found = drive(stop=Span(3.0, 2.0), duration_s=10.0)
    assert found.recording.truth_velocity is not None
    speed = np.linalg.norm(found.recording.truth_velocity, axis=1)
    t_s = found.recording.truth_t_ns * 1e-9
    assert (speed[(t_s >= 3) & (t_s <= 5)] == 0).all()
    assert speed[0] > 2
    assert speed[-1] > 2
    assert np.abs(np.diff(told(found)[:, :3], axis=0)).max() < 0.05


def test_a_parked_body_feels_gravity_for_ever() -> None:
    found = drive(parked=True)
    assert np.allclose(told(found), [0, 0, 9.81, 0, 0, 0], atol=1e-12)
    assert len(found.recording.tracks) > 1000


def test_velocity_of_truth_is_the_derivative_of_its_positions() -> None:
    recording = drive(frame_rate_hz=50.0, twist_rate_hz=100.0).recording
    R, p = recording.truth
    assert recording.truth_velocity is not None
    v_W = np.einsum("nij,nj->ni", R, recording.truth_velocity)
    assert np.abs((p[2:] - p[:-2]) / 0.04 - v_W[1:-1]).max() < 1e-3


def starts(given: StartGiven, count: int) -> tuple[Floats, Floats]:
    """Whitened errors of velocity (3) and tilt (2) that START gives, of many seeds."""
    speed, tilt = [], []
    for seed in range(count):
        imu = replace(EXACT, start=given, rest_s=0.0)
        recording = drive(imu=imu, seed=seed, duration_s=0.1, landmarks=1).recording
        start = recording.start
        assert start is not None
        assert recording.truth_velocity is not None
        speed.append((start.velocity - recording.truth_velocity[0]) / start.velocity_variance**0.5)
        up = np.asarray(start.R_WB)[2] - recording.truth.R[0][2]
        P = unpack_symmetric(start.covariance[None], 6)[0][3:, 3:]
        tilt.append(np.sort(np.abs(np.linalg.eigvalsh(P)))[1:] ** 0.5)
        tilt[-1] = np.array([np.linalg.norm(up)]) / tilt[-1].mean()
    return np.array(speed), np.array(tilt)


def test_what_start_gives_is_wrong_by_what_it_says() -> None:
    speed, tilt = starts(StartGiven.VELOCITY, 150)
    assert (speed**2).mean() == pytest.approx(1.0, abs=0.2)
    assert (tilt**2).mean() == pytest.approx(2.0, abs=0.5)


def test_start_gives_what_is_asked_for(tmp_path: Path, pelorus: Run) -> None:
    for words, count, known in (("velocity", 1, True), ("pose", 1, False), ("none", 0, False)):
        target = tmp_path / f"{words}.plr"
        common = ("--imu-rate", 100, "--duration", 1, "--start", words)
        pelorus("simulate", target, *common)
        found = messages_of(target, Start)
        assert len(found) == count
        assert all((m.velocity_variance > 0).all() == known for m in found)


SIDE = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])  # the accelerometer's numbers
FAULTS: list[tuple[ImuFaults, Callable[[Floats, Floats], Floats]]] = [
    # the fault, and what it makes of readings (n, 6) at times in s (n)
    (ImuFaults(accel_in_g=True), lambda x, _: np.where(SIDE, x / 9.81, x)),
    (ImuFaults(gyro_in_degrees=True), lambda x, _: np.where(SIDE, x, np.degrees(x))),
    (ImuFaults(gravity_flipped=True), lambda x, _: np.where(SIDE, -x, x)),
    (
        ImuFaults(imu_axes="y,-x,z"),
        lambda x, _: x[:, [1, 0, 2, 4, 3, 5]] * [1, -1, 1, 1, -1, 1],
    ),
    (ImuFaults(accel_range_mps2=9.8), lambda x, _: np.where(SIDE, np.clip(x, -9.8, 9.8), x)),
    (ImuFaults(gyro_range_radps=0.1), lambda x, _: np.where(SIDE, x, np.clip(x, -0.1, 0.1))),
    (
        ImuFaults(imu_frozen=Span(2.0, 1.0)),
        lambda x, t: np.where(((t >= 2) & (t < 3))[:, None], x[399], x),
    ),
    (ImuFaults(imu_missing=Span(2.0, 1.0)), lambda x, t: x[(t < 2) | (t >= 3)]),
]


@pytest.mark.parametrize(
    ("faults", "makes"), FAULTS, ids=[repr(faults)[10:40] for faults, _ in FAULTS]
)
def test_a_fault_makes_of_the_readings_what_it_says(
    faults: ImuFaults, makes: Callable[[Floats, Floats], Floats]
) -> None:
    plain, faulty = drive(imu=NOISY), drive(faults, imu=NOISY)
    due = makes(told(plain), np.asarray(plain.recording.inertial.t_ns * 1e-9))
    assert np.allclose(told(faulty), due, rtol=1e-12)
    assert not np.array_equal(due, told(plain))
    assert np.array_equal(faulty.recording.tracks.pixels, plain.recording.tracks.pixels)


def test_vibration_shakes_by_its_amplitude_and_leaves_the_mean() -> None:
    faults = ImuFaults(accel_vibration_mps2=5.0, gyro_vibration_radps=0.2)
    shaken = told(drive(faults, duration_s=20.0)) - told(drive(duration_s=20.0))
    assert np.abs(shaken[:, :3]).max() == pytest.approx(5.0, rel=0.01)
    assert np.abs(shaken[:, 3:]).max() == pytest.approx(0.2, rel=0.01)
    assert np.abs(shaken.mean(axis=0)).max() < 0.02
    assert abs(np.corrcoef(shaken[:, :3].T) - np.eye(3)).max() < 0.9, "not all axes at one time"


def test_a_clock_that_goes_too_slow_stamps_too_early() -> None:
    plain, slow = drive().recording, drive(ImuFaults(imu_clock_percent=-0.5)).recording
    assert np.allclose(slow.inertial.t_ns, plain.inertial.t_ns * 0.995, atol=1)
    assert np.array_equal(slow.inertial.a_B_mps2, plain.inertial.a_B_mps2)


def test_shares_of_the_readings_are_lost_or_spoilt() -> None:
    plain = drive(imu=NOISY, duration_s=40.0)
    lost = drive(ImuFaults(imu_drop=0.1), imu=NOISY, duration_s=40.0).recording.inertial
    assert len(lost.t_ns) == pytest.approx(0.9 * 8001, abs=120)
    kept = np.isin(plain.recording.inertial.t_ns, lost.t_ns)
    assert np.array_equal(told(plain)[kept, :3], lost.a_B_mps2)
    spikes = told(drive(ImuFaults(imu_spikes=0.1), imu=NOISY, duration_s=40.0)) != told(plain)
    assert spikes.any(axis=1).mean() == pytest.approx(0.1, abs=0.015)
    assert spikes.sum(axis=1).max() == 1, "of one number"
    assert spikes.any(axis=0).all(), "of any"
    nan = np.isnan(told(drive(ImuFaults(imu_nan=0.01), imu=NOISY, duration_s=40.0)))
    assert nan.any(axis=1).mean() == pytest.approx(0.01, abs=0.004)


def test_late_readings_stand_behind_newer_frames(tmp_path: Path, pelorus: Run) -> None:
    target = tmp_path / "late.plr"
    options = ("--imu-rate", 100, "--duration", 3, "--imu-delay", 0.055, "--imu-batch", 1)
    pelorus("simulate", target, *options)
    received, _ = framing.read_file(target)
    latest, late = 0, set()
    for frame in received:
        if isinstance(frame.message, Stereo):
            latest = frame.message.t_ns
        elif isinstance(frame.message, Imu):
            late.add(latest - frame.message.t_ns)
    assert max(late) == 50_000_000


def test_frames_of_another_clock_are_stamped_too_early() -> None:
    plain = drive().recording
    for offset_s in (0.03, -0.02):
        other = drive(ImuFaults(camera_offset_s=offset_s)).recording
        ahead = (other.inertial.t_ns[0] - plain.inertial.t_ns[0]) - (
            other.frame_t_ns[0] - plain.frame_t_ns[0]
        )
        assert ahead == round(offset_s * 1e9)
        assert other.start is not None
        assert other.start.t_ns == other.truth_t_ns[0] == other.inertial.t_ns[0]
        assert np.array_equal(plain.tracks.pixels, other.tracks.pixels)


def test_a_filter_that_is_told_of_the_other_clock_finds_its_truth(
    tmp_path: Path, pelorus: Run
) -> None:
    target = tmp_path / "offset.plr"
    options = ("--imu-rate", 200, "--duration", 8, "--camera-offset", 0.04)
    pelorus("simulate", target, *options)
    evaluate = ("evaluate", target, "--bin", BIN, "--json", "--set")
    found = json.loads(pelorus(*evaluate, "camera-offset=0.04").out)
    assert found["truth_frames"] > 70
    assert found["err0_m"] < 0.1
    # not nees_per_dof: over the first seconds of an exact start it is 4 without any offset
    assert found["nees_position"] < 3
    assert found["nees_rotation"] < 3
    assert "0 of its" in pelorus(*evaluate, "camera-offset=0", status=1).err, "poses of other times"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"imu": {"imu_rate_hz": 50.0}}, "--imu-rate is 50.0: 100 to 1000 Hz"),
        ({"imu": {"imu_rate_hz": 1001.0}}, "--imu-rate is 1001.0"),
        ({"imu": {"gyro_noise": -1.0}}, "--gyro-noise is -1.0"),
        ({"imu": {"accel_walk": float("nan")}}, "--accel-walk is nan"),
        ({"imu": {"gravity_mps2": 0.0}}, "--gravity is 0.0"),
        ({"imu": {"imu_batch": 21}}, "--imu-batch is 21"),
        ({"imu": {"start_tilt_sigma_rad": 0.0}}, "--start-tilt-sigma is 0.0"),
        ({"imu": {"imu_rate_hz": 0.0, "rest_s": 1.0}}, "--rest is 1.0: --imu-rate beside it is"),
        ({"imu_faults": ImuFaults(imu_axes="x,y,y")}, "--imu-axes is x,y,y"),
        ({"imu_faults": ImuFaults(imu_axes="--x,y,z")}, "--imu-axes"),
        ({"imu_faults": ImuFaults(imu_drop=1.0)}, "--imu-drop is 1.0"),
        ({"imu_faults": ImuFaults(imu_clock_percent=80.0)}, "--imu-clock is 80.0"),
        (
            {"imu": {"imu_rate_hz": 0.0}, "imu_faults": ImuFaults(accel_in_g=True)},
            "--accel-in-g is True: --imu-rate beside it is expected",
        ),
        ({"mishaps": Mishaps(slip=0.5)}, "--slip is 0.5: twists, so no --imu-rate"),
        ({"mishaps": Mishaps(dead_encoder=Span(1.0))}, "--dead-encoder"),
    ],
)
def test_options_that_make_no_sense_are_refused_by_name(changes: dict[str, Any], said: str) -> None:
    imu = replace(EXACT, **changes.pop("imu", {}))
    if not imu.is_there:  # nothing else is told of it
        imu = replace(type(imu)(), rest_s=imu.rest_s)
    with pytest.raises(PelorusError, match=said):
        simulate(replace(options(imu), **changes))
