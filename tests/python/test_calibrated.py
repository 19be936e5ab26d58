# SPDX-License-Identifier: MIT
"""The setting calibrate, and what the tools tell of a calibration that was estimated on the way."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Once, Run
from pelorus.commands.cli import main
from pelorus.wire.calibrated import PARTS, Calibrated, last_calibrated
from pelorus.wire.frames import End, Header
from pelorus.wire.framing import messages_of, write_file
from pelorus.wire.settings import IDS, describe
from replay_drive import BIN

REPLAY = BIN / "pelorus-replay"
TOLD_LONGER = 1.006  # the focal length in the HEADER
TURNED_RAD = 0.004
SIGMAS = ("--focal-sigma", "0.006", "--camera-turn-sigma", "0.005")


@pytest.fixture(scope="session")
def spoiled(once: Once, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight, whose HEADER has another focal length and a camera turned about its x."""
    return once("calibrated.plr", lambda out: _spoil(out, tmp_path_factory.mktemp("simulated")))


def _spoil(out: Path, folder: Path) -> None:
    drive = folder / "drive.plr"
    options = (
        "--imu-rate",
        "200",
        "--duration",
        "40",
        "--seed",
        "12",
        "--speed",
        "2",
        "--lap",
        "25",
    )
    assert main(["simulate", str(drive), *options]) == 0
    messages = [m for m in messages_of(drive) if not isinstance(m, End)]
    for k, message in enumerate(messages):
        if isinstance(message, Header):
            camera = message.camera
            told = replace(
                camera, fx_px=camera.fx_px * TOLD_LONGER, fy_px=camera.fy_px * TOLD_LONGER
            )
            c, s = np.cos(TURNED_RAD), np.sin(TURNED_RAD)
            turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
            R, t = turn @ np.asarray(message.R_CB), turn @ np.asarray(message.t_CB_m)
            messages[k] = replace(message, camera=told, R_CB=R, t_CB_m=t)
    write_file(out, messages, len(messages))


def replayed(recording: Path, log: Path, *options: str) -> str:
    command = [str(REPLAY), str(recording), *SIGMAS, *options, "--force"]
    command += ["--out", str(log)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_a_wrong_focal_length_and_a_turned_camera_are_found(spoiled: Path, tmp_path: Path) -> None:
    log = tmp_path / "log.plr"
    said = replayed(spoiled, log, "--calibrate", "focal,turn")
    told = last_calibrated(messages_of(log))
    assert told is not None
    due = {"focal": 100 * (1 / TOLD_LONGER - 1), "turn_x": -np.degrees(TURNED_RAD)}
    found = {part.key: (value, sigma) for part, value, sigma in told.parts()}
    assert set(found) == {"focal", "turn_x", "turn_y", "turn_z"}
    for key, (value, sigma) in found.items():
        assert value == pytest.approx(due.get(key, 0), abs=4 * sigma), key
    assert found["focal"][1] < 0.5 * 0.6
    assert found["turn_x"][1] < 0.5 * np.degrees(0.005)
    true = next(m for m in messages_of(spoiled) if isinstance(m, Header)).camera.fx_px / TOLD_LONGER
    assert told.camera.fx_px == pytest.approx(true, rel=4e-2 * found["focal"][1])
    assert "calibration   corrected by focal length" in said


def test_what_was_estimated_is_told_once_a_second_and_at_the_end(
    spoiled: Path, tmp_path: Path
) -> None:
    log = tmp_path / "log.plr"
    replayed(spoiled, log, "--calibrate", "focal")
    told = [m for m in messages_of(log) if isinstance(m, Calibrated)]
    assert 38 <= len(told) <= 43
    sigmas = [m.sigma[1] for m in told]
    assert sigmas == sorted(sigmas, reverse=True)
    assert told[-1].sigma[2] == pytest.approx(0.005)  # considered: the setting's
    replayed(spoiled, log)
    assert not [m for m in messages_of(log) if isinstance(m, Calibrated)]


def test_info_and_evaluate_show_it(spoiled: Path, tmp_path: Path, pelorus: Run) -> None:
    log = tmp_path / "log.plr"
    clock = ("--camera-clock-sigma", "0.002", "--camera-offset", "0.0015", "--twist-delay", "0.05")
    replayed(spoiled, log, "--calibrate", "focal,clock", *clock)
    shown = pelorus("info", log).out
    assert "focal length" in shown
    assert "camera's clock" in shown
    assert "-> fx" in shown
    told = last_calibrated(messages_of(log))
    assert told is not None
    assert f"camera-offset = {0.0015 + told.corrected[-1]:.5f}" in shown
    assert told.corrected[-1] == pytest.approx(-0.0015, abs=4 * told.sigma[-1])
    judged = json.loads(pelorus("evaluate", log, "--json").out)
    assert judged["calibrated_focal"] == pytest.approx(100 * told.corrected[1])
    assert judged["calibrated_clock_sigma"] == pytest.approx(1000 * told.sigma[-1])


def test_a_list_is_described_by_its_words() -> None:
    assert describe(IDS["calibrate"], 5.0) == ("calibrate", "focal,turn")
    assert describe(IDS["calibrate"], 0.0) == ("calibrate", "off")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--calibrate", "focus"), "several with commas, or off"),
        (("--calibrate", "focal,"), "several with commas, or off"),
        (("--calibrate", "clock"), "camera-clock-sigma"),  # which is 0
        (("--calibrate", "focal", "--focal-sigma", "0"), "focal-sigma"),
    ],
)
def test_what_cannot_be_estimated_is_refused(
    spoiled: Path, options: tuple[str, ...], said: str
) -> None:
    command = [str(REPLAY), str(spoiled), *options]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode != 0
    assert said in run.stderr


def test_every_number_has_a_name() -> None:
    assert len(PARTS) == len({part.key for part in PARTS}) == 13
