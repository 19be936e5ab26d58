# SPDX-License-Identifier: MIT
"""Wheels beside a live camera: of a table, as datagrams, and what of them reaches the log."""

from __future__ import annotations

import json
import socket
from pathlib import Path

import numpy as np
import pytest
from live_cameras import Scripted, single
from pelorus.commands.cli import main
from pelorus.errors import PelorusError
from pelorus.io.recording import Recording
from pelorus.live.session import HERE, How, Session
from pelorus.live.wheels import Beside, Datagrams, WheelsAsked
from pelorus.rig.read import Calibrated
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Imu, Reading
from pelorus.wire.framing import messages_of
from test_convert_csv import write_csv

pytestmark = pytest.mark.usefixtures("built")


@pytest.fixture(scope="module")
def recording() -> Recording:
    return simulate(Options(seed=4, duration_s=5.0, imu=SimulatedImu(imu_rate_hz=200.0))).recording


def camera(recording: Recording) -> Scripted:
    return Scripted(Calibrated(recording.header), single(list(recording.messages())))


def test_speeds_of_a_table_reach_the_log_along_the_cameras_way(
    recording: Recording, tmp_path: Path
) -> None:
    t_ns = np.arange(recording.frame_t_ns[0], recording.frame_t_ns[-1], 50_000_000)
    columns = {
        "t_ns": t_ns,
        "left_mps": [2.9] * len(t_ns),
        "right_mps": [3.1] * len(t_ns),
    }
    asked = WheelsAsked(str(write_csv(tmp_path / "wheels.csv", columns)), 0.05, (0.1, 0, 0), 0.4)
    beside = Beside(camera(recording), asked, HERE)
    log = tmp_path / "log.plr"
    session = Session(beside, How(HERE, log=log))
    for one in beside.measured():
        session.take(one)
    session.finish()
    found = [m for m in messages_of(log) if isinstance(m, Reading)]
    assert len(found) == 2 * len(t_ns)
    ahead = recording.header.R_CB.T @ (0, 0, 1)  # the camera looks along it
    axis = int(np.abs(ahead).argmax())
    assert {m.axes for m in found} == {1 << axis}
    assert found[0].value[axis] == pytest.approx(2.9 * ahead[axis], abs=1e-6)
    apart = found[0].at_B_m - found[1].at_B_m
    assert np.linalg.norm(apart) == pytest.approx(0.4, abs=1e-6)
    assert main(["compare", str(log)]) == 0


def test_datagrams_are_of_now_and_bad_ones_are_counted(recording: Recording) -> None:
    beside = Beside(camera(recording), WheelsAsked("udp:0"), HERE)
    source = beside.source
    assert isinstance(source, Datagrams)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for words in (json.dumps({"v_mps": 1.5}), "fast", "[1]", '{"v_mps": NaN}'):
            sender.sendto(words.encode(), ("127.0.0.1", source.port))
    measured = beside.measured()
    first, second = next(measured), next(measured)
    beside.close()
    assert isinstance(first, Reading)
    assert isinstance(second, Imu)
    assert first.t_ns == second.t_ns
    assert source.bad == 3


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ({"t_s": [0.0], "speed": [1.0]}, "v_mps, or left_mps and right_mps"),
        ({"v_mps": [1.0]}, "columns t_ns or t_s"),
        ({"t_s": [0.0], "v_mps": ["fast"]}, "could not convert"),
    ],
)
def test_a_table_that_tells_no_speeds_is_refused(
    rows: dict[str, list[object]], said: str, recording: Recording, tmp_path: Path
) -> None:
    asked = WheelsAsked(str(write_csv(tmp_path / "wheels.csv", rows)))
    with pytest.raises(PelorusError, match=said):
        Beside(camera(recording), asked, HERE)


def test_wheels_need_a_port_and_a_sigma(recording: Recording) -> None:
    for asked, said in (
        (WheelsAsked("udp:many"), "a free port"),
        (WheelsAsked("udp:0", sigma_mps=0), "--wheel-sigma is 0"),
        (WheelsAsked("nowhere.csv"), "nowhere.csv: cannot be read: No such file"),
    ):
        with pytest.raises(PelorusError, match=said):
            Beside(camera(recording), asked, HERE)
