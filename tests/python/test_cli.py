# SPDX-License-Identifier: MIT
"""The command line itself: its help, its version, the order of what it writes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from drives import clean
from pelorus import __version__
from pelorus.commands.cli import COMMANDS
from pelorus.errors import write_text
from pelorus.native import replay
from pelorus.wire import framing
from pelorus.wire.frames import End, Header, Stereo, Truth, Twist

SUBCOMMANDS = [
    ("convert",),
    ("track",),
    ("convert", "ece276a"),
    ("convert", "starry-night"),
    ("convert", "klt"),
    ("convert", "csv"),
    ("convert", "euroc"),
    ("convert", "ros"),
    ("convert", "kitti"),
    ("convert", "imu-npz"),
    ("info",),
    ("evaluate",),
    ("simulate",),
    ("report",),
    ("map",),
    ("course",),
    ("convert", "map"),
    ("live",),
    ("stream",),
    ("compare",),
]


@pytest.mark.parametrize("command", SUBCOMMANDS, ids=" ".join)
def test_every_help_shows_an_example(pelorus: Run, command: tuple[str, ...]) -> None:
    outcome = pelorus(*command, "--help")
    assert f"Example:  pelorus {' '.join(command)}" in outcome.out


def test_the_commands_and_the_version_are_there(pelorus: Run) -> None:
    text = pelorus("--help").out
    for command in COMMANDS:
        assert command in text
    assert pelorus("--version").out.strip() == f"pelorus {__version__}"
    pelorus("no-such-command", status=2)
    pelorus("info", status=2)


def test_the_package_runs_as_a_module_and_errors_go_to_stderr(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pelorus", "info", str(tmp_path / "absent.plr")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith("error: ")
    assert "absent.plr: cannot be read" in done.stderr


NOT_ON_WINDOWS = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")
BLOCKED = """
import sys
for name in {names!r}:
    sys.modules[name] = None  # importing it raises ImportError, as where there is none
from pelorus.commands.cli import main
for command in {commands!r}:
    assert main([*command, "--help"]) == 0, command
"""


def test_every_command_starts_where_there_is_no_termios() -> None:
    program = BLOCKED.format(names=NOT_ON_WINDOWS, commands=[(), *SUBCOMMANDS])
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    for command in SUBCOMMANDS:
        assert f"Usage: pelorus {' '.join(command)} " in done.stdout.decode()


HEAVY = (
    *(f"scipy.{part}" for part in ("spatial", "special", "linalg", "sparse", "stats", "optimize")),
    *(
        "scipy.signal",
        "scipy.ndimage",
        "matplotlib",
        "pandas",
        "duckdb",
        "dask",
        "distributed",
        "cv2",
    ),
)
LOADED = """
import sys
from pelorus.commands.cli import main
for words in {commands!r}:
    assert main(words) == 0, words
    loaded = [name for name in {heavy!r} if name in sys.modules]
    assert not loaded, (words, loaded)
"""


def test_what_loads_slowly_is_loaded_by_those_commands_alone_that_use_it(tmp_path: Path) -> None:
    """By what is loaded, not by the clock. A rotation of scipy takes longer to load than most
    commands to run.
    """
    drive = tmp_path / "drive.plr"
    clean(duration_s=1.0).write(drive)
    of_all = [["info", str(drive)], *([*command, "--help"] for command in ((), *SUBCOMMANDS))]
    for commands, heavy in (([["--version"]], (*HEAVY, "numpy")), (of_all, HEAVY)):
        program = LOADED.format(commands=commands, heavy=heavy)
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
        assert done.returncode == 0, done.stderr.decode()


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_name_that_the_output_cannot_encode_is_no_reason_to_fail(
    tmp_path: Path, encoding: str
) -> None:
    drive, lacking = tmp_path / "Zürich 道.plr", tmp_path / "dürr 道.plr"
    clean(duration_s=1.0).write(drive)
    for path, status in ((drive, 0), (lacking, 1)):
        done = subprocess.run(
            [sys.executable, "-m", "pelorus", "info", path],
            capture_output=True,
            env=os.environ | {"PYTHONIOENCODING": encoding},
            check=False,
        )
        assert done.returncode == status, done.stderr
        assert b"\\u9053" in (done.stderr if status else done.stdout)
        assert b"Error:" not in done.stderr


def test_the_replay_is_found_beside_the_package_from_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PELORUS_BIN", raising=False)
    built = replay.find_programs(None).float32.resolve()
    monkeypatch.chdir(tmp_path)
    assert replay.find_programs(None).float32 == built


def test_a_recording_is_written_in_the_order_of_the_format(tmp_path: Path) -> None:
    path = tmp_path / "x.plr"
    clean(duration_s=3.0).write(path)
    received, counts = framing.read_file(path)
    messages = [frame.message for frame in received]
    assert isinstance(messages[0], Header)
    assert isinstance(messages[-1], End)
    rank = {Twist: 0, Truth: 1, Stereo: 2}
    keys = [(m.t_ns, rank[m.__class__]) for m in messages if isinstance(m, (Twist, Truth, Stereo))]
    assert keys == sorted(keys)
    assert len(keys) == 3 * 31
    assert counts.clean
    assert not list(tmp_path.glob("*.part"))
    ids = [m.ids for m in messages if isinstance(m, Stereo)]
    assert all((np.diff(x.astype(np.int64)) > 0).all() for x in ids)


def test_a_pipe_that_is_written_to_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_text(pipe, "some text")
        assert pipe.is_fifo()
        assert os.read(reader, 100) == b"some text"
    finally:
        os.close(reader)


def test_standard_output_is_written_to_by_its_name() -> None:
    words = "from pathlib import Path; from pelorus.errors import write_text; "
    words += "write_text(Path('/dev/stdout'), 'some text')"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"some text", b"")


def test_a_link_that_is_written_to_stays_a_link(tmp_path: Path) -> None:
    there, link = tmp_path / "there.txt", tmp_path / "link.txt"
    there.write_text("old", encoding="utf-8")
    link.symlink_to(there)
    write_text(link, "new")
    assert link.is_symlink()
    assert there.read_text(encoding="utf-8") == "new"
