# SPDX-License-Identifier: MIT
"""A map beside the landmarks that the recording knows: its error, and what it claims."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pelorus.evaluate.evaluation import judge, made_in
from pelorus.wire.frames import Landmark, Message
from replay_drive import (
    BIN,
    EXACT_CAMERA,
    Record,
    drive,
    header,
    judged,
    known,
    log_of,
    points,
    run,
)

SLOTS = ("--slots", "256", "--bias", "off", "--pixel-sigma", "0.5", "--gate", "off")
MAPPING = (*SLOTS, "--mode", "mapping")


def with_known(frames: int, change: Callable[[Landmark], Landmark] = lambda m: m) -> list[Message]:
    """A drive of 0.5 px noise that knows its landmarks."""
    knows = [change(m) for m in known() if isinstance(m, Landmark)]
    return [header(), *knows, *drive(frames)[1:]]


@pytest.mark.parametrize("program", ["pelorus-replay", "pelorus-replay-f64"])
def test_white_noise_is_mapped_as_well_as_the_map_claims(
    record: Record, tmp_path: Path, program: str
) -> None:
    path = record(with_known(300))
    log = tmp_path / "log.plr"
    options: tuple[str | Path, ...] = (*MAPPING, *EXACT_CAMERA, "--quiet", "--out", log)
    run(path, *options, program=program)
    told: dict[str, Any] = dict(judge(log_of(log)))
    made = made_in(log_of(log))
    errors = [float(np.linalg.norm(m.p_W_m - points()[m.id])) for m in made]
    assert told["map_landmarks"] == len(made) > 100
    assert told["map_rms_m"] == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-6)
    assert told["map_median_m"] == pytest.approx(np.median(errors), rel=1e-6)
    assert 0.8 < told["map_nees_per_dof"] < 1.25
    assert told["map_sigma_least_m"] < told["map_median_m"] < told["map_sigma_largest_m"]


def test_in_mapping_the_given_poses_are_no_accuracy(
    record: Record, pelorus: Callable[..., Any]
) -> None:
    path = record(with_known(40))
    told = judged(path, *MAPPING)
    assert told["err0_m"] is None
    assert told["ate_m"] is None
    assert told["truth_frames"] == 40
    said = pelorus("evaluate", path, "--bin", BIN, "--set", "mode=mapping", "--set", "slots=256")
    assert "err0" not in said.out
    assert "map_nees_per_dof" in said.out


def test_a_map_of_landmarks_that_nobody_knows_is_not_judged(
    record: Record, pelorus: Callable[..., Any]
) -> None:
    path = record(drive())
    said = pelorus("evaluate", path, "--bin", BIN, "--set", "mode=mapping", status=1)
    assert "there is nothing to compare" in said.err
    told = judged(path, *MAPPING)
    assert told["map_landmarks"] == 0
    assert told["map_rms_m"] is None
    assert "map_rms_m" not in pelorus("evaluate", path, "--bin", BIN).out


def test_a_shift_of_what_is_known_is_the_maps_error(record: Record) -> None:
    def shifted(landmark: Landmark) -> Landmark:
        return replace(landmark, p_W_m=landmark.p_W_m + np.array([3.0, 0, 4.0]))

    told = judged(record(with_known(300, shifted)), *MAPPING)
    assert told["map_median_m"] == pytest.approx(5, abs=0.3)
    assert told["map_nees_per_dof"] > 1000


def test_slam_is_judged_from_its_own_start(record: Record) -> None:
    path = record(with_known(100))
    moved = judged(path, *SLOTS, "--start", "identity")
    told = judged(path, *SLOTS)
    assert told["map_rms_m"] == pytest.approx(moved["map_rms_m"], rel=1e-3)
    assert told["map_rms_m"] < 1
    located = judged(path, *SLOTS, "--mode", "localization")
    assert located["map_landmarks"] == 0  # its landmarks are the recording's own


def test_starry_night_is_mapped_to_7_millimetres_in_the_middle(
    real: Callable[[str], Path], pelorus: Callable[..., object], tmp_path: Path
) -> None:
    path = tmp_path / "starry-night.plr"
    pelorus("convert", "starry-night", real("starry-night/dataset3.mat"), path)
    config = Path(__file__).parents[2] / "tools/config/starry-night.conf"
    exact = ("--camera-turn-sigma", "0")  # else it contains much of what the noise is asked for
    options = ("--config", config, "--pixel-sigma", "5", "--mode", "mapping", *exact)
    told = judged(path, *options)
    assert told["map_landmarks"] == 20
    assert told["map_median_m"] < 0.008
    assert told["map_rms_m"] < 0.02
    # the pixels are twice as noisy in v as the config says: told so, the map claims less
    honest = judged(path, *options, "--pixel-sigma", "11", "--gate", "off")
    assert honest["map_rms_m"] < 0.025
    assert honest["map_nees_per_dof"] < 0.5 * told["map_nees_per_dof"]


def test_known_landmarks_that_slam_used_are_not_judged(record: Record) -> None:
    told = judged(record(with_known(100)), *SLOTS, "--known-map", "on")
    assert told["map_landmarks"] == 0
