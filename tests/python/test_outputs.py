# SPDX-License-Identifier: MIT
"""Files that are there are kept, unless --force is given; - is the standard output."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from converted import Run
from pelorus.wire.framing import read_file
from replay_drive import Record, drive, run


@pytest.mark.parametrize(
    "call",
    [
        ("simulate", "OUT", "--duration", "3"),
        ("convert", "late-turns", "IN", "OUT", "--late", "0.1"),
        ("convert", "late-turns", "IN", "IN", "--late", "0.1"),
        ("export", "IN", "--frames", "OUT"),
        ("check", "IN", "--out", "OUT"),
        ("check", "IN", "--page", "OUT"),
        ("explain", "IN", "--page", "OUT"),
    ],
    ids=" ".join,
)
def test_a_file_that_is_there_is_kept(
    call: tuple[str, ...], record: Record, tmp_path: Path, pelorus: Run
) -> None:
    source, target = record(drive(30)), tmp_path / "mine"
    target.write_text("years of work")
    before = source.read_bytes()
    words = [{"IN": source, "OUT": target}.get(word, word) for word in call]
    assert "is there already" in pelorus(*words, status=1).err
    assert target.read_text() == "years of work"
    assert source.read_bytes() == before


def test_force_overwrites_it(tmp_path: Path, pelorus: Run) -> None:
    target = tmp_path / "drive.plr"
    target.write_text("of no worth")
    pelorus("simulate", target, "--duration", "3", "--force")
    assert sum(read_file(target)[1].frames.values()) > 30
    page = tmp_path / "report" / "report.html"
    page.parent.mkdir()
    page.write_text("of last week")
    call = ("report", target, "--out", page.parent)
    assert "is there already" in pelorus(*call, status=1).err
    assert page.read_text() == "of last week"


def test_the_standard_output_holds_the_recording_and_nothing_else(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pelorus", "simulate", "-", "--duration", "3"]
    done = subprocess.run(command, capture_output=True, check=True, cwd=tmp_path, timeout=600)
    assert b"observations" in done.stderr
    assert not list(tmp_path.iterdir())
    assert run("-", "--json", stdin=done.stdout).summary["frames"] == 30


def test_a_command_that_is_ended_removes_what_it_has_begun(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pelorus", "simulate", "out.plr", "--duration", "300"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as running:
        while running.poll() is None and not (tmp_path / "out.plr.part").exists():
            time.sleep(0.01)
        running.send_signal(signal.SIGTERM)
        assert running.wait(timeout=600) == 128 + signal.SIGTERM
    assert not list(tmp_path.iterdir())
