# SPDX-License-Identifier: MIT
"""A camera that looks beside where T_CB says is told, and the covariances contain it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from draws import draws, long_run
from everyday import drawn
from everyday import drive as everyday_drive
from pelorus.check import verdict
from pelorus.check.calibration import Turned
from pelorus.io.recording import Recording
from pelorus.math import se3
from replay_drive import BIN

WALK = replace(
    drawn(3000), speed_mps=1.0, speed_varies=0.3, turns_radps=0.3, pixel_px=0.7, velocity_mps=0.05,
    gyro_radps=0.005, bias_mps=0.0, bias_radps=0.0, pitch_deg=0.0, twist_hz=50, timing="start",
    points=60, duration_s=30.0, told=1,
)  # fmt: skip


def turned(recording: Recording, degrees: float) -> Recording:
    """Its HEADER's camera turned about its own middle, about an axis that is none of its own."""
    turn = np.radians(degrees) * np.array([0.6, 0.64, -0.48])
    T_CB = se3.compose(se3.exp(np.zeros(3), turn), recording.T_CB)
    return recording.with_extrinsic(T_CB)


@long_run
@pytest.mark.parametrize(("degrees", "told"), draws([(2.0, True), (0.0, False)]))
def test_a_camera_that_is_turned_is_told(
    degrees: float, told: bool, tmp_path: Path, pelorus: Run
) -> None:
    path = tmp_path / "drive.plr"
    turned(everyday_drive(WALK, 7), degrees).write(path)
    said = pelorus("check", path, "--out", tmp_path / "t.conf", "--bin", BIN, "--json")
    found = json.loads(said.out)
    lines = [r["text"] for r in found["remarks"] if "beside where T_CB says" in r["text"]]
    assert len(lines) == told, found["remarks"]
    setting = found["settings"].get("camera-turn-sigma")
    assert (setting is not None) == told
    if told:
        assert float(lines[0].split()[3]) == pytest.approx(degrees, abs=0.4), lines[0]
        assert float(setting) == pytest.approx(np.radians(degrees) / np.sqrt(3), rel=0.2)
        assert f"camera-turn-sigma = {setting}" in (tmp_path / "t.conf").read_text()
    assert float(found["figures"]["NEES/6"]["after"]) < 3


def test_only_what_is_sure_and_matters_is_told() -> None:
    covariance = np.radians(0.2) ** 2 * np.eye(3)
    turn = np.radians(np.array([1.0, 0.0, 0.0]))
    off = Turned(turn, covariance, adds=2.0, given=0.003)
    assert off.setting == {"camera-turn-sigma": "0.01"}
    (remark,) = verdict.of_turn(off)
    assert "looks 1.0 +- 0.2 degrees beside where T_CB says" in remark.text
    assert "for which camera-turn-sigma stands" in remark.text
    for silent in (replace(off, covariance=2 * covariance), replace(off, adds=0.4)):
        assert not silent.setting
        assert silent.beyond == 0
        assert not list(verdict.of_turn(silent))
    known = replace(off, given=0.02)
    assert not known.setting
    assert "stands" not in next(verdict.of_turn(known)).text
