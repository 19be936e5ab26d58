# SPDX-License-Identifier: MIT
"""What the tests on emulated boards share. tests/target/run.sh builds what they need and calls them
with --boards (every test is asked of each), --robot (the firmware's build folder) and --desktop
(the build folder of the desktop's replay, which is given the boards' slots).
"""

from __future__ import annotations

import signal
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from pelorus.robot import emulator as emulators
from pelorus.robot import link as links
from pelorus.robot import stream
from pelorus.robot.emulator import Emulator
from pelorus.robot.link import Link
from pelorus.wire.frames import Kind, Message
from pelorus.wire.framing import read_file

ROOT = Path(__file__).resolve().parents[2]
# For firmware.stack, which is no part of the package, and own_tree.
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "tests/python")]

LONGEST = ("test_bits", "test_new_board")
HANG_S = 1800.0  # nothing is awaited by the clock: only what hangs is ended


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A board that is emulated on a busy machine may take its time."""
    monkeypatch.setattr(stream, "ANSWER_S", HANG_S)
    monkeypatch.setattr(stream, "STATE_S", HANG_S)
    monkeypatch.setattr(links, "CONNECT_S", HANG_S)
    monkeypatch.setattr(emulators, "STOP_S", HANG_S)


def pytest_configure(config: pytest.Config) -> None:
    import own_tree  # noqa: PLC0415

    own_tree.require(config)
    config.addinivalue_line("markers", "once: about the host; one board is enough")
    config.addinivalue_line("markers", "boards(*names): for these boards alone")
    config.addinivalue_line(
        "markers", "spread: the same source on each board; one of them, and with --long all"
    )
    # What a shell starts in the background ignores Ctrl-C, and so would what the tests start.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--boards", nargs="+", required=True)
    parser.addoption("--robot", type=Path, required=True)
    parser.addoption("--desktop", type=Path, required=True)
    parser.addoption("--long", action="store_true")


@pytest.fixture(scope="session")
def board(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="session")
def desktop(request: pytest.FixtureRequest) -> Path:
    """The folder of the desktop's programs."""
    return Path(request.config.getoption("--desktop")).resolve() / "bin"


@pytest.fixture(scope="session")
def program(desktop: Path) -> Path:
    """The desktop's replay, in the boards' precision."""
    return desktop / "pelorus-replay"


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
    """A drive that costs a board little: for where not the filter is asked about.

    Without END, and without TRUTH, which is longer than all else.
    """
    frames, counts = read_file(robot / "recordings" / "light" / "drive.plr")
    assert counts.clean
    return [frame.message for frame in frames[:-1] if frame.message.kind != Kind.TRUTH]


def boards_of(test: pytest.Item) -> list[str]:
    """Those that a test is for."""
    boards: list[str] = test.config.getoption("--boards")
    only = test.get_closest_marker("boards")
    return boards if only is None else [board for board in boards if board in only.args]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Each test for each board, and one for each recording that recordings.py could make."""
    if "board" in metafunc.fixturenames:
        boards = boards_of(metafunc.definition)
        if boards and metafunc.definition.get_closest_marker("once"):
            which = zlib.crc32(metafunc.definition.name.encode())  # so that each is taken for some
            boards = [boards[which % len(boards)]]
        metafunc.parametrize("board", boards, indirect=True, scope="session")
    if "recording" in metafunc.fixturenames:
        folder = Path(metafunc.config.getoption("--robot")) / "recordings"
        paths = sorted(folder.glob("*.plr"))
        metafunc.parametrize("recording", paths, ids=[path.stem for path in paths])


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What is spread, on one board each. Whole drives first: at the end every processor has
    something to do.
    """
    if not config.getoption("--long"):
        left_out = [item for item in items if not is_asked(item)]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if is_asked(item)]
    items.sort(key=lambda item: item.path.stem not in LONGEST)


def is_asked(item: pytest.Item) -> bool:
    """By its name and parameters a spread test is for one of its boards, another for each."""
    if item.get_closest_marker("spread") is None:
        return True
    assert isinstance(item, pytest.Function)
    boards = boards_of(item)
    board = str(item.callspec.params["board"])
    return board == boards[zlib.crc32(item.name.replace(board, "").encode()) % len(boards)]
