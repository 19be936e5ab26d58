# SPDX-License-Identifier: MIT
"""Fixtures: the real recordings where they are, and the command line as a user meets it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import pytest
from flight_logs import Compare, robots_log
from pelorus.cli import main
from pelorus.frames import Message
from pelorus.robot import stream
from replay_drive import BIN, drive, encode

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("PELORUS_DATA", ROOT.parent / "shared" / "data"))


HANG_S = 1800.0  # nothing is awaited by the clock: only what hangs is ended


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine even the board that is none may take its time."""
    monkeypatch.setattr(stream, "ANSWER_S", HANG_S)


class Said(NamedTuple):
    status: int
    out: str
    err: str


@pytest.fixture
def real() -> Callable[[str], Path]:
    def find(name: str) -> Path:
        path = DATA / name
        if not path.is_file():
            pytest.skip(f"the real recording {name} is not in {DATA} (set PELORUS_DATA)")
        return path

    return find


@pytest.fixture
def pelorus(capsys: pytest.CaptureFixture[str]) -> Callable[..., Said]:
    def run(*arguments: object) -> Said:
        capsys.readouterr()
        status = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Said(status, captured.out, captured.err)

    return run


@pytest.fixture
def compare(pelorus: Callable[..., Said], tmp_path: Path) -> Compare:
    """`pelorus compare` on a log, given as messages or bytes."""

    def call(log: Iterable[Message] | bytes, *options: object) -> Said:
        path = tmp_path / "flight.plr"
        path.write_bytes(log if isinstance(log, bytes) else encode(log))
        return pelorus("compare", path, "--bin", BIN, *options)

    return call


@pytest.fixture
def log(tmp_path: Path) -> list[Message]:
    """Of a robot with settings of its own."""
    return robots_log(tmp_path, drive(), "--slots", "20", "--bias", "on")
