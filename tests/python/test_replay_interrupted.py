# SPDX-License-Identifier: MIT
"""pelorus-replay is ended by a signal: nothing unfinished stays, what stood there does."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path

import pytest
from replay_drive import BIN, drive, encode

WAIT_S = 60.0  # of a loaded machine; in fact milliseconds
LEAVING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGXCPU)


def begun(folder: Path, *before: str) -> subprocess.Popen[bytes]:
    """A replay that waits for more on its standard input, its files begun."""
    program = BIN / "pelorus-replay"
    if not program.exists():
        pytest.skip(f"{program} is not built")
    outputs = (
        "--quiet",
        "--force",
        "--out",
        str(folder / "log.plr"),
        "--trajectory",
        str(folder / "t.tum"),
    )
    first = ("env", "--default-signal")  # the tests may run under nohup themselves
    replay = subprocess.Popen([*first, *before, str(program), "-", *outputs], stdin=subprocess.PIPE)
    assert replay.stdin
    replay.stdin.write(encode(drive())[:-400])
    replay.stdin.flush()
    end = time.monotonic() + WAIT_S
    while not (folder / "t.tum.part").exists() or not (folder / "log.plr.part").exists():
        assert time.monotonic() < end
        time.sleep(0.01)
    return replay


@pytest.mark.parametrize("number", LEAVING)
def test_a_signal_leaves_no_part_and_the_older_result(tmp_path: Path, number: int) -> None:
    (tmp_path / "t.tum").write_text("an older one\n")
    replay = begun(tmp_path)
    replay.send_signal(number)
    assert replay.wait(WAIT_S) == -number
    assert [path.name for path in tmp_path.iterdir()] == ["t.tum"]
    assert (tmp_path / "t.tum").read_text() == "an older one\n"


def test_what_a_killed_replay_left_is_replaced_by_the_next(tmp_path: Path) -> None:
    """Nothing can be done at SIGKILL: the name tells what it is, and the next run ends it."""
    (tmp_path / "t.tum").write_text("an older one\n")
    killed = begun(tmp_path)
    killed.kill()
    assert killed.wait(WAIT_S) == -signal.SIGKILL
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == ["log.plr.part", "t.tum", "t.tum.part"]
    assert (tmp_path / "t.tum").read_text() == "an older one\n"
    source = tmp_path / "drive.plr"
    source.write_bytes(encode(drive()))
    outputs = ("--quiet", "--out", str(tmp_path / "log.plr"))
    again = [str(BIN / "pelorus-replay"), str(source), *outputs]
    assert subprocess.run(again, check=False, timeout=WAIT_S).returncode == 0
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == ["drive.plr", "log.plr", "t.tum", "t.tum.part"]


def test_what_is_ignored_stays_ignored(tmp_path: Path) -> None:
    """As under nohup: the replay goes on to its end."""
    replay = begun(tmp_path, "sh", "-c", 'trap "" HUP; exec "$@"', "sh")
    replay.send_signal(signal.SIGHUP)
    assert replay.stdin
    replay.stdin.close()
    assert replay.wait(WAIT_S) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.plr", "t.tum"]
