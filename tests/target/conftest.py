# SPDX-License-Identifier: MIT
"""What the tests on emulated boards share. tests/target/run.sh builds what they need and calls them
with --board, --robot (the firmware's build folder) and --desktops (folders with the desktop's
replay, built in the ways whose bits must agree).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from pelorus.frames import Message
from pelorus.robot import emulator as emulators
from pelorus.robot import link as links
from pelorus.robot import stream
from pelorus.robot.emulator import Emulator
from pelorus.robot.link import Link
from pelorus.wire import read_file

HANG_S = 1800.0  # nothing is awaited by the clock: only what hangs is ended


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A board that is emulated on a busy machine may take its time."""
    monkeypatch.setattr(stream, "ANSWER_S", HANG_S)
    monkeypatch.setattr(stream, "STATE_S", HANG_S)
    monkeypatch.setattr(links, "CONNECT_S", HANG_S)
    monkeypatch.setattr(emulators, "STOP_S", HANG_S)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--board", required=True)
    parser.addoption("--robot", type=Path, required=True)
    parser.addoption("--desktops", type=Path, nargs="*", default=[])


@pytest.fixture(scope="session")
def board(request: pytest.FixtureRequest) -> str:
    return str(request.config.getoption("--board"))


@pytest.fixture(scope="session")
def robot(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.getoption("--robot"))


@pytest.fixture(scope="session")
def firmware(robot: Path, board: str) -> Path:
    return robot / "images" / f"pelorus-{board}-n32.elf"


@pytest.fixture
def emulator(board: str, firmware: Path) -> Iterator[Emulator]:
    with Emulator(board, firmware) as running:
        yield running


@pytest.fixture
def link(emulator: Emulator) -> Iterator[Link]:
    connected = emulator.connect()
    yield connected
    connected.close()


@pytest.fixture(scope="session")
def drive(robot: Path) -> list[Message]:
    """The simulated drive, without its END."""
    frames, counts = read_file(robot / "recordings" / "simulated.plr")
    assert counts.clean
    return [frame.message for frame in frames[:-1]]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test for each recording that recordings.py could make."""
    if "recording" in metafunc.fixturenames:
        folder = Path(metafunc.config.getoption("--robot")) / "recordings"
        paths = sorted(folder.glob("*.plr"))
        metafunc.parametrize("recording", paths, ids=[path.stem for path in paths])
