# SPDX-License-Identifier: MIT
"""`pelorus convert late-turns`: a gyro that lags is named, and what is named mends it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from converted import Run, messages_of
from pelorus.faults.named import faults_in
from pelorus.io.recording import Recording
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Stereo, Text, Twist

READINGS = 6  # by which the gyro is late, 0.12 s
DRIVE = Options(
    duration_s=30.0, twist_rate_hz=50.0, bias_velocity_sigma_mps=0.0, loss=0.03, baseline_m=0.4,
    seed=11, pixel_sigma_px=0.2, velocity_sigma_mps=0.01,
)  # fmt: skip


def late(recording: Recording) -> Recording:
    w = np.roll(recording.w_B_radps, READINGS, axis=0)
    w[:READINGS] = recording.w_B_radps[0]
    return replace(recording, w_B_radps=w)


def test_a_late_gyro_is_moved_to_where_it_belongs(tmp_path: Path, pelorus: Run) -> None:
    right = simulate(DRIVE).recording
    words = next(fault.words for fault in faults_in(late(right)) if fault.name == "clock-turns")
    found = re.search(r"convert late-turns --late (\S+)", words)
    assert found is not None, words
    assert abs(float(found[1]) - 0.12) < 0.02
    source, target = tmp_path / "late.plr", tmp_path / "moved.plr"
    late(right).write(source)
    pelorus("convert", "late-turns", source, target, "--late", "0.12")
    moved = messages_of(target, Twist)
    w = np.array([m.w_B_radps for m in moved])
    inner = slice(READINGS, -READINGS)
    assert np.allclose(w[inner], right.w_B_radps[inner], atol=1e-6)
    assert np.array_equal(
        [m.v_B_mps for m in moved], [m.v_B_mps for m in messages_of(source, Twist)]
    )
    assert [m.t_ns for m in messages_of(target, Stereo)] == right.frame_t_ns.tolist()
    assert any("0.12 s earlier" in m.text for m in messages_of(target, Text))
    again = replace(right, w_B_radps=w)
    assert not [fault for fault in faults_in(again) if fault.name == "clock-turns"]


def test_what_cannot_be_moved_is_refused(tmp_path: Path, pelorus: Run) -> None:
    source, target = tmp_path / "drive.plr", tmp_path / "moved.plr"
    drive = simulate(replace(DRIVE, duration_s=3.0)).recording
    drive.write(source)
    for by in ("0", "nan", "3"):
        said = pelorus("convert", "late-turns", source, target, "--late", by, status=1)
        assert "seconds are expected, up to 2" in said.err
    none = np.empty((0, 3))
    replace(drive, twist_t_ns=drive.twist_t_ns[:0], v_B_mps=none, w_B_radps=none).write(source)
    said = pelorus("convert", "late-turns", source, target, "--late", "0.1", status=1)
    assert "holds no twists" in said.err
    assert not target.exists()
