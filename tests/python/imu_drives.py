# SPDX-License-Identifier: MIT
"""Simulated drives with an IMU, and a .npz that holds one as imu-npz reads it."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from drives import PERFECT
from pelorus.math import se3
from pelorus.simulate.imu import ImuFaults, SimulatedImu
from pelorus.simulate.simulate import Options, Simulation, simulate
from scipy.spatial.transform import Rotation

EXACT = SimulatedImu(
    imu_rate_hz=200.0,
    gyro_noise=0.0,
    accel_noise=0.0,
    gyro_walk=0.0,
    accel_walk=0.0,
    bias_accel_sigma_mps2=0.0,
)
NOISY = SimulatedImu(imu_rate_hz=200.0)
BIAS_GYRO = 0.01


def options(imu: SimulatedImu = EXACT, faults: ImuFaults | None = None, **changes: Any) -> Options:
    """Without noise of the pixels, unless asked for."""
    return replace(
        PERFECT, **({"duration_s": 6.0} | changes), imu=imu, imu_faults=faults or ImuFaults()
    )


@cache
def noisy(seed: int = 1) -> Simulation:
    """A drive as an IMU's maker would hope, whose landmarks keep their ids."""
    return simulate(
        options(
            NOISY,
            seed=seed,
            keep_ids=True,
            pixel_sigma_px=1.0,
            bias_gyro_sigma_radps=BIAS_GYRO,
            loss=0.05,
        )
    )


def calib(drive: Simulation, **changes: Any) -> dict[str, Any]:
    """What stands there as JSON."""
    header = drive.recording.header
    camera = header.camera
    T_BC = np.eye(4)
    T_BC[:3, :3], T_BC[:3, 3] = se3.inverse(drive.recording.T_CB)
    right = T_BC.copy()
    right[:3, 3] += T_BC[:3, 0] * camera.baseline_m
    return {
        "fx": camera.fx_px,
        "fy": camera.fy_px,
        "cx": camera.cx_px,
        "cy": camera.cy_px,
        "width": header.image_width_px,
        "height": header.image_height_px,
        "baseline_m": camera.baseline_m,
        "T_imu_cam0": T_BC.tolist(),
        "T_imu_cam1": right.tolist(),
        "gravity_world": [0, 0, -9.81],
        "pixel_sigma": 1,
        "gyro_noise_density": 1e-3,
        "accel_noise_density": 1e-2,
        "gyro_random_walk": 1e-4,
        "accel_random_walk": 1e-3,
    } | changes


def npz_arrays(drive: Simulation) -> dict[str, Any]:
    """What the file holds."""
    recording, sensed = drive.recording, drive.imu
    assert sensed is not None
    assert recording.truth_velocity is not None
    assert recording.truth_bias is not None
    truth_s = recording.truth_t_ns * 1e-9
    v_W = np.einsum("nij,nj->ni", recording.truth.R, recording.truth_velocity)
    quaternions = Rotation.from_matrix(recording.truth.R).as_quat()
    truth = np.hstack((quaternions, recording.truth.p, v_W))
    bias = np.roll(recording.truth_bias, 3, axis=1)  # gyro first
    readings = recording.inertial
    return {
        "imu_t": readings.t_ns * 1e-9,
        "imu": np.hstack((readings.w_B_radps, readings.a_B_mps2)),
        "stereo_t": recording.frame_t_ns[recording.tracks.frame] * 1e-9,
        "stereo_id": recording.tracks.id.astype(np.uint32),
        "stereo_px": recording.tracks.pixels.astype(np.float32),
        "truth_t": truth_s,
        "truth": truth,
        "bias_t": truth_s,
        "bias": bias,
        "init": np.concatenate((truth_s[:1], truth[0], bias[0])),
        "calib": np.array(json.dumps(calib(drive))),
    }


def written(path: Path, arrays: dict[str, Any]) -> Path:
    """The file."""
    np.savez(path, **arrays)
    return path
