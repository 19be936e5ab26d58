# SPDX-License-Identifier: MIT
"""Recordings without a camera: an IMU, or wheels, and the position that another sensor tells."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run, messages_of
from drives import clean
from imu_drives import NOISY, options
from pelorus.io.recording import Recording
from pelorus.simulate.simulate import simulate
from pelorus.wire.frames import Header, Process, Reading, Stereo
from replay_drive import BIN
from rigs import IMU_NOISE, write_yaml
from scipy.spatial.transform import Rotation
from test_convert_csv import write_csv

SIGMA_M = 0.05


def positions(folder: Path, drive: Recording, every: int) -> Path:
    """Writes positions of the body's origin, with noise."""
    t_ns, p = drive.truth_t_ns[every::every], drive.truth.p[every::every]
    p = p + np.random.default_rng(6).normal(0, SIGMA_M, p.shape)
    columns = dict(zip(("px_m", "py_m", "pz_m"), p.T.tolist(), strict=True))
    rows = {"t_ns": t_ns.tolist(), **columns, "sigma_m": [SIGMA_M] * len(t_ns)}
    return write_csv(folder / "position.csv", rows)


def truth(folder: Path, drive: Recording) -> Path:
    q = Rotation.from_matrix(drive.truth.R).as_quat()
    names = ("px_m", "py_m", "pz_m", "qx", "qy", "qz", "qw")
    numbers = np.hstack((drive.truth.p, q)).T.tolist()
    rows = {"t_ns": drive.truth_t_ns.tolist(), **dict(zip(names, numbers, strict=True))}
    return write_csv(folder / "truth.csv", rows)


def imu(folder: Path, drive: Recording) -> Path:
    readings = drive.inertial
    names = ("ax", "ay", "az", "wx", "wy", "wz")
    numbers = np.hstack((readings.a_B_mps2, readings.w_B_radps)).T.tolist()
    rows = {"t_ns": readings.t_ns.tolist(), **dict(zip(names, numbers, strict=True))}
    return write_csv(folder / "imu.csv", rows)


def test_an_imu_and_positions_alone_are_filtered_and_evaluated(
    tmp_path: Path, pelorus: Run
) -> None:
    if not (BIN / "pelorus-replay").exists():
        pytest.skip("pelorus-replay is not built")
    drive = simulate(options(replace(NOISY, rest_s=3.0), duration_s=20.0)).recording
    target = tmp_path / "blind.plr"
    noise = write_yaml(tmp_path / "imu.yaml", IMU_NOISE)
    files: list[Any] = ["--imu", imu(tmp_path, drive), "--position", positions(tmp_path, drive, 2)]
    files += ["--truth", truth(tmp_path, drive), "--calibration", noise]
    said = pelorus("convert", "csv", *files, target).out
    assert "no --stereo: " in said
    assert "frames without a point, at the times of the other sensors' readings" in said
    header = messages_of(target, Header)[0]
    assert header.process is Process.IMU
    assert header.noise.gyro_noise == IMU_NOISE["gyroscope_noise_density"]
    frames, readings = messages_of(target, Stereo), messages_of(target, Reading)
    assert [m.t_ns for m in frames] == [m.t_ns for m in readings]
    assert not any(len(m.ids) for m in frames)
    found = json.loads(pelorus("evaluate", target, "--bin", BIN, "--json").out)
    assert found["ate_m"] < 2 * SIGMA_M
    refused = pelorus("check", target, "--bin", BIN, "--out", tmp_path / "t.conf", status=1).err
    assert "no frame of the recording shows a point: there is nothing to check" in refused


def test_wheels_and_positions_need_no_camera_either(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(duration_s=6.0)
    numbers = np.hstack((drive.v_B_mps, drive.w_B_radps)).T.tolist()
    names = ("vx", "vy", "vz", "wx", "wy", "wz")
    rows = {"t_ns": drive.twist_t_ns.tolist(), **dict(zip(names, numbers, strict=True))}
    twists, target = write_csv(tmp_path / "twists.csv", rows), tmp_path / "out.plr"
    files = ("--twists", twists, "--position", positions(tmp_path, drive, 5))
    said = pelorus("convert", "csv", *files, target).out
    assert "taken vx, vy, vz in mps; wx, wy, wz in radps. In another unit" in said
    assert len(messages_of(target, Reading)) == len(messages_of(target, Stereo)) == 12
    assert "12 frames" in pelorus("info", target).out


def test_what_lacks_is_told(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(duration_s=6.0)
    target, twists = tmp_path / "out.plr", tmp_path / "twists.csv"
    rows = {"t_ns": drive.twist_t_ns.tolist(), "vx": drive.v_B_mps[:, 0].tolist()}
    motion = ("--twists", write_csv(twists, rows), "--measured", "vx")
    assert (
        "--stereo FILE or --position FILE is expected"
        in pelorus("convert", "csv", *motion, target, status=1).err
    )
    stereo = write_csv(tmp_path / "stereo.csv", {"t_ns": [1], "id": [1]})
    said = pelorus("convert", "csv", *motion, "--stereo", stereo, target, status=1).err
    assert "stereo.csv: of which cameras? --calibration FILE is expected" in said
    odd = write_yaml(tmp_path / "odd.yaml", {"rate_hz": 3})
    where = ("--position", positions(tmp_path, drive, 5), "--calibration", odd)
    said = pelorus("convert", "csv", *motion, *where, target, status=1).err
    assert "odd.yaml: is no IMU's file, or a second one; one is expected" in said
    assert not target.exists()
