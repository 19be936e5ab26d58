# SPDX-License-Identifier: MIT
"""Wheels beside a cheap IMU: a minute in the dark, a slip in it, scale and distance on the way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import messages_of
from draws import draws
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.readings import Sensing
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.calibrated import Calibrated
from pelorus.wire.frames import Pose, Report
from pelorus.wire.layout import unpack_symmetric
from pelorus.wire.reason import Reason
from replay_drive import run
from scipy.spatial.transform import Rotation

DARK_FROM_S, DARK_S = 10.0, 60.0
WHEEL = Sensing(rate_hz=50.0, axes="x", sigma=(0.03,))
SLIPS = replace(WHEEL, slip_percent=50.0, slip_from_s=30.0, slip_for_s=5.0)
SLIDE: tuple[Any, ...] = ("--wheel-slide-sigma", 0.05)
SEEDS = draws([2, 1, *range(3, 17)])
ONE_IN_A_THOUSAND = 22.46 / 6  # of chi-square of 6, a degree of freedom


def driven(seed: int, wheel: Sensing, lap_s: float = 40.0, duration_s: float = 70.0) -> Recording:
    imu = SimulatedImu(imu_rate_hz=200.0, rest_s=2.0)
    options = Options(seed=seed, duration_s=duration_s, speed_mps=1.0, lap_s=lap_s, imu=imu)
    return simulate(replace(options, readings={"wheel": wheel})).recording


def darkened(drive: Recording) -> Recording:
    t_s = (drive.frame_t_ns - drive.frame_t_ns[0]) * 1e-9
    lit = (t_s < DARK_FROM_S)[drive.tracks.frame]
    columns = (drive.tracks.frame[lit], drive.tracks.id[lit], drive.tracks.pixels[lit])
    return replace(drive, tracks=Tracks(drive.tracks.frame_count, *columns))


def replayed(drive: Recording, folder: Path, *words: Any) -> Path:
    path, log = folder / "drive.plr", folder / "log.plr"
    drive.write(path)
    run(path, "--out", log, "--quiet", *words)
    return log


def end_of(drive: Recording, log: Path) -> tuple[float, float]:
    """Returns by how much the last pose is off, m, and NEES/6."""
    last = [m for m in messages_of(log, Pose) if m.after_stereo][-1]
    k = np.searchsorted(drive.truth_t_ns, last.t_ns)
    off = last.R_WB.T @ (drive.truth.p[k] - last.p_WB_m)
    turned = Rotation.from_matrix(last.R_WB.T @ drive.truth.R[k]).as_rotvec()
    error = np.concatenate((off, turned))
    P = unpack_symmetric(last.covariance[None], 6)[0]
    return float(np.linalg.norm(off)), float(error @ np.linalg.solve(P, error)) / 6


@pytest.mark.parametrize("seed", SEEDS)
def test_a_minute_in_the_dark_costs_a_percent_of_the_way(seed: int, tmp_path: Path) -> None:
    drive = darkened(driven(seed, WHEEL))
    off_m, _ = end_of(drive, replayed(drive, tmp_path, *SLIDE))
    assert off_m <= 0.01 * DARK_S


@pytest.mark.parametrize("seed", SEEDS)
def test_a_slip_in_the_dark_is_told_and_costs_nothing(seed: int, tmp_path: Path) -> None:
    drive = darkened(driven(seed, SLIPS))
    log = replayed(drive, tmp_path, *SLIDE)
    off_m, nees = end_of(drive, log)
    assert off_m <= 0.02 * DARK_S
    assert nees <= ONE_IN_A_THOUSAND
    t_s = {
        round((m.t_ns - drive.frame_t_ns[0]) * 1e-9)
        for m in messages_of(log, Report)
        if m.reasons & Reason.READINGS_REJECTED
    }
    assert {31, 32, 33, 34} <= t_s


@pytest.mark.parametrize("seed", SEEDS)
def test_scale_and_distance_of_wheels_are_found_in_a_minute(seed: int, tmp_path: Path) -> None:
    two = Sensing(50.0, (0.01,), "x", track_m=0.5, scale_percent=3.0, track_off_percent=5.0)
    drive = driven(seed, two, lap_s=12.0, duration_s=62.0)
    sigmas = ("--wheel-scale-sigma", 0.03, "--wheel-track-sigma", 0.05)
    listed = ("--calibrate", "wheel-scale,wheel-track")
    told = messages_of(replayed(drive, tmp_path, *SLIDE, *sigmas, *listed), Calibrated)[-1]
    off = told.wheels - np.array([0.03, 0.05])
    assert np.abs(off).max() <= 0.003
    assert (np.abs(off) <= 3 * told.wheels_sigma).all()
    assert (told.wheels_sigma < 0.002).all()
    assert [part.key for part, _, _ in told.parts()] == ["wheel_scale", "wheel_track"]


def test_wheels_at_rest_are_a_standstill(tmp_path: Path) -> None:
    """Wheels of one axis leave the others open; a standstill closes them."""
    sigma = {}
    drive = driven(4, replace(WHEEL, rate_hz=20.0), duration_s=12.0)
    small = [replace(m, value=np.zeros(3)) for m in drive.readings]
    parked = simulate(
        Options(
            duration_s=12.0,
            parked=True,
            imu=SimulatedImu(imu_rate_hz=200.0, rest_s=1.0),
        )
    ).recording
    parked = darkened(replace(parked, readings=small))
    for name in ("0", "0.002"):
        log = replayed(parked, tmp_path, "--standstill-sigma", name)
        P = unpack_symmetric(messages_of(log, Pose)[-1].velocity_covariance[None], 6)[0]
        sigma[name] = float(np.sqrt(P[:3, :3].diagonal().max()))
    assert sigma["0.002"] < 0.2 * sigma["0"]
