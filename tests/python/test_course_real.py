# SPDX-License-Identifier: MIT
"""The course report's filter, by its preset, on the course's own recordings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from pelorus.evaluate import road
from pelorus.io.trajectory import read_stamped
from replay_drive import Result, judged, run

SLOTS_MOST = ("100", "256")  # what is lost by eviction is centimetres here


def replay(recording: Path, slots: str, *arguments: str | Path) -> Result:
    """In float64: `world` is not meant for less."""
    options = ("--preset", "course", "--slots", slots, *arguments)
    return run(recording, *options, program="pelorus-replay-f64", status=None)


def test_on_03_the_preset_stays_within_5_m_of_the_road(
    real: Callable[[str], Path], plr_03: Path, tmp_path: Path
) -> None:
    trajectory = tmp_path / "03.tum"
    replay(plr_03, "100", "--trajectory", trajectory)
    way = road.read_road(real("truth/kitti360-0003-path.csv"))
    found = road.compare(read_stamped(trajectory).poses.p, way, skip_m=45.0)
    assert 4.0 < found.road_m <= 5.0  # numpy, without a gate that opens: 4.5


@pytest.mark.parametrize("slots", SLOTS_MOST)
def test_on_0027_the_preset_has_an_ate_below_8_m(plr_0027: Path, slots: str) -> None:
    options = ("--preset", "course", "--slots", slots)
    found = judged(plr_0027, *options, program="pelorus-replay-f64")
    assert 7.0 < found["ate_m"] <= 8.0  # numpy: 7.4
