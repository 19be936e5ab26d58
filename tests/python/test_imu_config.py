# SPDX-License-Identifier: MIT
"""Settings for IMUs by name: what the files say is what they set, and more than a data sheet."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from converted import Run
from draws import draws, long_run
from imu_drives import noisy
from pelorus.native.replay import run_program
from replay_drive import BIN

CONFIG = ROOT / "tools" / "config"
NAMES = ["imu", *sorted(path.stem for path in CONFIG.glob("imu-*.conf"))]
OF_A_DATA_SHEET = re.compile(
    r"(\d+) times: gyro (\S+) dps/sqrt\(Hz\),\n# accelerometer (\S+) ug/sqrt\(Hz\)"
)
OFFSETS = re.compile(r"its offsets, (\S+) dps and (\S+) mg")


def settings(name: str, recording: Path) -> dict[str, str]:
    """What is in force with a config file."""
    options = ["--config", str(CONFIG / f"{name}.conf"), "--print-config"]
    said, _ = run_program(BIN / "pelorus-replay", recording, options)
    lines = (line.partition("#")[0].partition("=") for line in said.splitlines())
    return {name.strip(): value.strip() for name, _, value in lines}


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "imu.plr"
    noisy().recording.write(path)
    return path


@pytest.mark.parametrize("name", NAMES)
def test_every_file_is_taken_and_asks_for_an_IMU(name: str, recording: Path) -> None:
    assert settings(name, recording)["process"] == "imu"


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("imu", "imu-adis16448")])
def test_noises_are_those_of_the_data_sheet_so_many_times(name: str, recording: Path) -> None:
    words = (CONFIG / f"{name}.conf").read_text(encoding="utf-8")
    sheet, offsets = OF_A_DATA_SHEET.search(words), OFFSETS.search(words)
    assert sheet is not None
    assert offsets is not None
    found = settings(name, recording)
    times = float(sheet[1])
    degrees, ug = times * float(sheet[2]), times * float(sheet[3])
    assert float(found["gyro-noise"]) == pytest.approx(np.radians(degrees), rel=0.05)
    assert float(found["accel-noise"]) == pytest.approx(ug * 9.81e-6, rel=0.05)
    assert float(found["bias-gyro-sigma"]) == pytest.approx(np.radians(float(offsets[1])), rel=0.05)
    assert float(found["bias-accel-sigma"]) == pytest.approx(float(offsets[2]) * 9.81e-3, rel=0.05)
    assert times > 1


def test_imu_conf_leaves_pixels_and_gravity_to_the_recording_and_says_the_least_noise(
    recording: Path,
) -> None:
    found, told = settings("imu", recording), noisy().recording.header.noise
    assert float(found["pixel-sigma"]) == told.pixel_sigma_px
    assert float(found["gravity"]) == told.gravity
    assert float(found["gyro-noise"]) == 1.7e-4 < told.gyro_noise


# --- the real recordings, in the first part of each, so that it takes seconds ---------------------


def figures(pelorus: Run, recording: Path, *options: object) -> dict[str, float]:
    said = pelorus("evaluate", recording, "--bin", BIN, "--json", *options)
    found: dict[str, float] = json.loads(said.out)
    return found


NEES = ("position", "rotation", "velocity", "bias_accel", "bias_gyro")


@long_run
@pytest.mark.parametrize(("slots", "metres", "degrees"), draws([(16, 0.12, 0.4), (60, 0.06, 0.15)]))
def test_a_walk_through_a_corridor_drifts_by_centimetres(
    plr_imu: Callable[..., Path],
    pelorus: Run,
    slots: int,
    metres: float,
    degrees: float,
) -> None:
    """The median is half of these limits. The NEES of one drive is little more than one sample."""
    options = ("--config", CONFIG / "imu.conf", "--set", f"slots={slots}", "--first", 120)
    drives = [plr_imu("tum_corridor1-60-seed0", seed) for seed in (1, 2, 3)]
    found = [figures(pelorus, drive, *options) for drive in drives]
    for drive in found:
        assert drive["err0_m"] < metres
        assert drive["rot_deg"] < degrees
        assert drive["truth_frames"] == 1201
    for name in NEES:
        assert 0.3 < np.mean([drive[f"nees_{name}"] for drive in found]) < 2, name


def test_real_readings_are_as_good_with_the_noises_of_a_data_sheet(
    plr_imu: Callable[[str], Path], pelorus: Run
) -> None:
    """By which the filter was overconfident by ten sigmas before it saw how they scatter."""
    recording, options = plr_imu("euroc-V102-real-imu"), ("--set", "slots=60", "--config")
    honest = figures(pelorus, recording, *options, CONFIG / "imu-adis16448.conf")
    told = figures(pelorus, recording, *options, CONFIG / "imu.conf")
    assert honest["err0_m"] < 0.005 * honest["path_m"]
    assert told["err0_m"] < 1.5 * honest["err0_m"]
    for found in (honest, told):
        assert 0.3 < found["nees_per_dof"] < 2
        assert found["nees_velocity"] < 2
