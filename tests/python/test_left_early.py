# SPDX-License-Identifier: MIT
"""A user who presses Ctrl-C, a disk that is full behind standard output, a reader who leaves."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from converted import Run
from pelorus.commands import report as report_command
from pelorus.report import answers
from replay_drive import Record, drive
from report_runs import built_programs, recorded

COMMAND = [sys.executable, "-m", "pelorus"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full is not here")
@pytest.mark.parametrize(
    "words", [["info", "{}"], ["info", "--json", "{}"], ["evaluate", "--help"]], ids=" ".join
)
def test_an_output_that_takes_nothing_is_told_in_one_line(record: Record, words: list[str]) -> None:
    path = str(record(drive()))
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [*COMMAND, *(word.format(path) for word in words)],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.stderr == ("pelorus: cannot write to standard output: No space left on device\n")
    assert done.returncode == 1


def test_a_reader_who_leaves_early_is_told_nothing(record: Record) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    command = [*COMMAND, "info", str(record(drive()))]
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, b"")


INTERRUPTED = """
import sys
class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == "typer":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt())
from pelorus.commands.cli import main
sys.exit(main(["info", "x.plr"]))
"""


def test_ctrl_c_while_the_commands_are_loaded_ends_quietly() -> None:
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (130, b"")


def interrupted(*_: Any) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("step", ["replaying", "the page"])
def test_a_report_that_is_interrupted_leaves_nothing(
    tmp_path: Path, pelorus: Run, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    built_programs()
    source, folder = recorded(tmp_path, drive()), tmp_path / "a" / "report"
    with monkeypatch.context() as patch:
        if step == "replaying":
            patch.setattr(report_command, "carry_out", interrupted)
        else:
            patch.setattr(answers, "write", interrupted)
        assert pelorus("report", source, "--out", folder, status=None).status != 0
    assert [path.name for path in tmp_path.iterdir()] == [source.name]


def test_a_report_that_is_interrupted_leaves_the_earlier_one(
    tmp_path: Path, pelorus: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    built_programs()
    source, folder = recorded(tmp_path, drive()), tmp_path / "report"
    pelorus("report", source, "--out", folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert folder / "runs" / "yours.plr" in before
    with monkeypatch.context() as patch:
        patch.setattr(answers, "write", interrupted)
        assert (
            pelorus("report", source, "--out", folder, "--set", "bias=off", status=None).status != 0
        )
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
