# SPDX-License-Identifier: MIT
"""Fixtures: the real recordings where they are, and the command line as a user meets it."""

from __future__ import annotations

import fcntl
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import own_tree
import pytest
from converted import Converted, Once
from flight_logs import Compare, robots_log
from pelorus.commands.cli import main
from pelorus.converters import imu_npz
from pelorus.converters.imu_npz import Choices
from pelorus.robot import stream
from pelorus.wire.frames import Message
from pelorus_course import ece276a
from replay_drive import BIN, Record, drive, encode, recorder

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "port" / "ros2" / "pelorus_ros"))  # what of the node needs no ROS
DATA = Path(os.environ.get("PELORUS_DATA", ROOT.parent / "shared" / "data"))


def pytest_configure(config: pytest.Config) -> None:
    own_tree.require(config)


HANG_S = 1800.0  # nothing is awaited by the clock: only what hangs is ended


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine even the board that is none may take its time."""
    monkeypatch.setattr(stream, "ANSWER_S", HANG_S)


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets `pelorus` find the programs and libraries of the build under test."""
    monkeypatch.setenv("PELORUS_BIN", str(BIN))


class Said(NamedTuple):
    status: int
    out: str
    err: str


@pytest.fixture
def record(tmp_path: Path) -> Record:
    return recorder(tmp_path)


@pytest.fixture
def real() -> Callable[[str], Path]:
    def find(name: str) -> Path:
        path = DATA / name
        if not path.is_file():
            pytest.skip(f"the real recording {name} is not in {DATA} (set PELORUS_DATA)")
        return path

    return find


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Once:
    """A file that several tests read is made once, by whichever process of pytest-xdist needs it
    first. Nobody else writes into its folder.
    """
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "once"
    folder.mkdir(exist_ok=True)

    def get(name: str, make: Callable[[Path], object]) -> Path:
        path, part = folder / name, folder / f"part-{name}"
        with (folder / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                make(part)
                part.rename(path)
        return path

    return get


@pytest.fixture
def kept(once: Once) -> Callable[[str, Callable[[], Any]], Any]:
    """The same for what a function gives."""

    def get(name: str, make: Callable[[], Any]) -> Any:
        path = once(f"{name}.pickle", lambda path: path.write_bytes(pickle.dumps(make())))
        return pickle.loads(path.read_bytes())

    return get


@pytest.fixture(scope="session")
def own_wheel(once: Once) -> Path:
    """The package's wheel for this machine, from its source distribution, compiled quickly."""
    pytest.importorskip("scikit_build_core")

    def make(folder: Path) -> None:
        source = f"from scikit_build_core.build import build_sdist; build_sdist({str(folder)!r})"
        build = ("-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation")
        options = (
            "--config-settings=cmake.define.CMAKE_C_FLAGS_RELEASE=-O1",
            "--wheel-dir",
            folder,
        )
        for words in (("-c", source), (*build, *options)):
            command = [sys.executable, *words, *folder.glob("pelorus_slam-*.tar.gz")]
            done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
            assert done.returncode == 0, done.stderr

    (wheel,) = once("own-wheel", make).glob("pelorus_slam-*.whl")
    return wheel


@pytest.fixture
def of_0027(real: Callable[[str], Path], kept: Callable[..., Any]) -> Converted:
    """The course's 0027 with its truth, mended, and what was found."""
    source, truth = real("ece276a/0027.npz"), real("truth/kitti-odometry-07.txt")
    return Converted(*kept("0027", lambda: ece276a.convert(source, truth)))


@pytest.fixture
def of_03(real: Callable[[str], Path], kept: Callable[..., Any]) -> Converted:
    """The course's 03, mended, and what was found."""
    source = real("ece276a/03.npz")
    return Converted(*kept("03", lambda: ece276a.convert(source)))


@pytest.fixture
def of_imu(real: Callable[[str], Path], kept: Callable[..., Any]) -> Callable[..., Converted]:
    """A recording of imu/ by its name, and what was found: a simulated one with a seed's noise."""

    def get(name: str, seed: int = 1) -> Converted:
        choices = Choices(seed=None if name.startswith("euroc") else seed)
        source = real(f"imu/{name}.npz")
        return Converted(*kept(f"{name}-{seed}", lambda: imu_npz.convert(source, choices)))

    return get


@pytest.fixture
def plr_imu(of_imu: Callable[..., Converted], once: Once) -> Callable[..., Path]:
    def get(name: str, seed: int = 1) -> Path:
        return once(f"{name}-{seed}.plr", of_imu(name, seed).recording.write)

    return get


@pytest.fixture
def plr_0027(of_0027: Converted, once: Once) -> Path:
    return once("0027.plr", of_0027.recording.write)


@pytest.fixture
def plr_03(of_03: Converted, once: Once) -> Path:
    return once("03.plr", of_03.recording.write)


@pytest.fixture
def pelorus(capsys: pytest.CaptureFixture[str]) -> Callable[..., Said]:
    def run(*arguments: object, status: int | None = 0) -> Said:
        """`status` is expected; None: any."""
        capsys.readouterr()
        got = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        assert status is None or got == status, captured.out + captured.err
        return Said(got, captured.out, captured.err)

    return run


@pytest.fixture
def zst_0027(real: Callable[[str], Path], once: Once, pelorus: Callable[..., Said]) -> Path:
    """The course's 0027 as its own file has it, without truth, converted by its name's ending."""
    source = real("ece276a/0027.npz")

    def make(path: Path) -> None:
        pelorus("convert", "ece276a", source, path)

    return once("0027.plr.zst", make)


@pytest.fixture
def compare(pelorus: Callable[..., Said], tmp_path: Path) -> Compare:
    """`pelorus compare` on a log, given as messages or bytes."""

    def call(log: Iterable[Message] | bytes, *options: object) -> Said:
        path = tmp_path / "flight.plr"
        path.write_bytes(log if isinstance(log, bytes) else encode(log))
        return pelorus("compare", path, "--bin", BIN, *options, status=None)

    return call


@pytest.fixture
def log(tmp_path: Path) -> list[Message]:
    """Returns the log of a robot with settings of its own."""
    return robots_log(tmp_path, drive(), "--slots", "20", "--bias", "on")
