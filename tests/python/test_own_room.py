# SPDX-License-Identifier: MIT
"""From raw pictures and an IMU to a trajectory, in two commands and with nobody's settings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from converted import Run, messages_of
from draws import draws
from pelorus.wire.frames import Header, Process
from rendered import SMALL
from replay_drive import BIN, judged
from rigs import FISHEYE, Cameras
from room import Room

WIDE = Cameras("equidistant", (190.0, 190.5, 187.0, 119.0), (190.5, 190.0, 188.0, 121.0), FISHEYE)


@pytest.mark.parametrize("cameras", draws([WIDE, SMALL]), ids=draws(["fisheye", "radtan"]))
def test_a_folder_and_a_kalibr_file_find_the_way_to_centimetres(
    cameras: Cameras, tmp_path: Path, pelorus: Run, once: Callable[..., Path]
) -> None:
    if not (BIN / "pelorus-replay").exists():
        pytest.skip(f"{BIN / 'pelorus-replay'} is not built")
    folder = once(f"room-{cameras.model}", Room(cameras).write)
    target = tmp_path / "out.plr"
    words = ("--calibration", folder / "camchain.yaml", "--calibration", folder / "imu.yaml")
    pelorus("convert", "euroc", folder, target, *words)
    assert messages_of(target, Header)[0].process is Process.IMU
    found = judged(target)
    assert found["err0_m"] < 0.03
    assert found["err0_m"] < 0.1 * judged(target, "--mode", "dead_reckoning")["err0_m"]
    assert found["nees_per_dof"] < 5
