# SPDX-License-Identifier: MIT
"""A simulated robot's messages: tracks and an IMU, its camera_info and /tf_static."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from pelorus.commands.cli import main
from pelorus.wire.frames import Header, Imu, Stereo
from pelorus.wire.framing import messages_of
from robot import Played, Robot, imu_message, info_message, tracks_message, transform_message
from tf2_msgs.msg import TFMessage

DELAY_NS = 20_000_000  # tracks come so much after their exposure
TOPICS = ("tracks", "imu")


@dataclass(frozen=True)
class Recorded:
    """A drive as messages in the order of their arrival."""

    header: Header
    played: tuple[Played, ...]

    @property
    def frames(self) -> int:
        return sum(one.topic == "tracks" for one in self.played)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """Six seconds."""
    file = tmp_path_factory.mktemp("drive") / "drive.plr"
    assert main(["simulate", "--seed", "3", "--duration", "6", "--imu-rate", "200", str(file)]) == 0
    messages = messages_of(file)
    header = next(m for m in messages if isinstance(m, Header))
    infos = {
        side: info_message(header.camera, (640, 480), side == "right", "left_optical")
        for side in ("left", "right")
    }
    played: list[Played] = []
    for m in messages:
        if isinstance(m, Imu):
            for t, a, w in zip(m.times_ns, m.a_B_mps2, m.w_B_radps, strict=True):
                played.append(Played(t, len(played), "imu", imu_message(t, a, w)))
        elif isinstance(m, Stereo):
            message = tracks_message(m.t_ns, m.ids, m.pixels)
            for side, info in infos.items():  # as a driver does, with every picture
                played.append(Played(m.t_ns, len(played), f"{side}/camera_info", info))
            played.append(Played(m.t_ns + DELAY_NS, len(played), "tracks", message))
    return Recorded(header, tuple(sorted(played)))


def mounted(robot: Robot, header: Header) -> None:
    """Sends /tf_static."""
    R = np.asarray(header.R_CB).T
    links = [transform_message("imu", "left_optical", R, -R @ header.t_CB_m)]
    links.append(transform_message("base_link", "imu", np.eye(3), (0.2, 0, 0.1)))
    robot.publisher("/tf_static", TFMessage, latched=True).publish(TFMessage(transforms=links))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path
