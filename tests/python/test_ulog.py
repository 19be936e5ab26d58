# SPDX-License-Identifier: MIT
"""Logs of PX4: the IMU in a .ulg, written here byte by byte as its format says."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from converted import Run, messages_of
from drives import clean
from numpy.typing import NDArray
from pelorus.converters.columns import Columns
from pelorus.evaluate.inertial_survey import readings_of
from pelorus.io.foreign import ForeignFileError
from pelorus.wire.frames import Imu
from test_convert_columns import options_of

pytest.importorskip("pyulog")
Floats = NDArray[np.float64]
COMBINED = "sensor_combined:uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;"
SUMMED = (
    "vehicle_imu:uint64_t timestamp;float[3] delta_angle;float[3] delta_velocity;"
    "uint32_t delta_angle_dt;uint32_t delta_velocity_dt;"
)


def message(kind: bytes, payload: bytes) -> bytes:
    return struct.pack("<H", len(payload)) + kind + payload


def written(path: Path, form: str, rows: list[bytes]) -> Path:
    name = form.partition(":")[0].encode()
    whole = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    whole += message(b"B", bytes(40)) + message(b"F", form.encode())
    whole += message(b"A", struct.pack("<BH", 0, 7) + name)
    whole += b"".join(message(b"D", struct.pack("<H", 7) + row) for row in rows)
    path.write_bytes(whole)
    return path


def combined(path: Path, t_us: NDArray[np.int64], w: Floats, a: Floats) -> Path:
    rows = [
        struct.pack("<Q6f", t, *one, *other)
        for t, one, other in zip(t_us.tolist(), w, a, strict=True)
    ]
    return written(path, COMBINED, rows)


def test_the_imu_of_a_px4_log_becomes_a_recording(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(duration_s=3.0)
    t_us = np.arange(0, 3_100_000, 4000) + int(drive.frame_t_ns[0]) // 1000
    chance = np.random.default_rng(1)
    w, a = chance.normal(0, 0.1, (2, len(t_us), 3)).astype(np.float32).astype(np.float64)
    a[:, 2] -= 9.8125
    log = combined(tmp_path / "flight.ulg", t_us, w, a)
    options = options_of(tmp_path, drive, "--twists")
    target = tmp_path / "out.plr"
    said = pelorus("convert", "csv", *options, "--imu", log, target, "--fix", "none").out
    assert "sensor_combined 0 is taken: axes forward, right, down" in " ".join(said.split())
    found = readings_of(messages_of(target, Imu))
    assert np.array_equal(found.t_ns, t_us * 1000)
    assert np.allclose(found.w_B_radps, w, atol=1e-6)
    assert np.allclose(found.a_B_mps2, a, atol=1e-5)


def test_sums_over_an_interval_become_mean_rates(tmp_path: Path) -> None:
    rows = [
        struct.pack("<Q6f2I", 5000 * k, 0.005, 0, 0, 0, 0, -0.04905, 5000, 5000) for k in range(9)
    ]
    table = Columns.of([]).read(written(tmp_path / "x.ulg", SUMMED, rows), "imu")
    assert table.numbers("wx_radps", "az_mps2")[3] == pytest.approx([1.0, -9.81], rel=1e-6)


def test_a_log_that_is_cut_or_of_no_imu_is_told(tmp_path: Path) -> None:
    path = written(tmp_path / "x.ulg", COMBINED, [])
    with pytest.raises(ForeignFileError, match="has no messages of sensor_combined or vehicle_imu"):
        Columns.of([]).read(path, "imu")
    with pytest.raises(ForeignFileError, match="is read as --imu or --gyro alone"):
        Columns.of([]).read(path, "stereo")
    path.write_bytes(path.read_bytes()[:20])
    with pytest.raises(ForeignFileError, match=r"ULog|no messages"):
        Columns.of([]).read(path, "imu")
