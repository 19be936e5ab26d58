# SPDX-License-Identifier: MIT
"""`pelorus stream` as a user calls it: to a board behind a TCP port, to one behind a serial device,
and to the emulator; what it records is replayed to the bits that the board answered.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from desk import digest
from pelorus.robot.emulator import MACHINES, Emulator
from pelorus.robot.stream import Streamer
from pelorus.wire.frames import Message, Pose
from pelorus.wire.framing import Counts, Writer, read_file
from recordings import first_frames

FRAMES = 24
PATIENCE_S = 1800.0  # against hangs
LOOK_AGAIN_S = 0.02


@pytest.fixture(scope="module")
def short_drive(drive: list[Message], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first frames of the simulated drive."""
    path = tmp_path_factory.mktemp("stream") / "drive.plr"
    with path.open("wb") as stream:
        writer = Writer(stream)
        for message in first_frames(drive, FRAMES):
            writer.write(message)
        writer.end()
    return path


@pytest.fixture(scope="session")
def endless_drive(robot: Path) -> Path:
    return robot / "recordings" / "light" / "endless.plr"


# --- boards ---------------------------------------------------------------------------------------


class Board(NamedTuple):
    """An emulated board, as a terminal server or a cable shows one."""

    process: subprocess.Popen[str]
    target: str


@contextmanager
def running(board: str, image: Path, serial: str) -> Iterator[subprocess.Popen[str]]:
    """QEMU, with the board's first UART there."""
    command = ["qemu-system-arm", "-M", MACHINES[board], "-kernel", str(image)]
    command += ["-display", "none", "-monitor", "none", "-serial", serial, "-serial", "null"]
    process = subprocess.Popen(command, text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def behind_tcp(board: str, image: Path) -> Iterator[Board]:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with running(board, image, f"tcp:127.0.0.1:{port},server=on,wait=off") as process:
        yield Board(process, f"tcp:127.0.0.1:{port}")


@contextmanager
def behind_a_terminal(board: str, image: Path) -> Iterator[Board]:
    with running(board, image, "pty") as process:
        assert process.stdout is not None
        said = process.stdout.readline()  # char device redirected to /dev/pts/3 (label serial0)
        device = re.search(r"/dev/pts/\d+", said)
        assert device is not None, said
        yield Board(process, f"serial:{device[0]}:921600")


Behind = Callable[[str, Path], AbstractContextManager[Board]]
BOTH = pytest.mark.parametrize("behind", [behind_tcp, behind_a_terminal], ids=["tcp", "serial"])


def words(*arguments: object) -> list[str]:
    given = [*map(str, arguments)]
    if given[0] == "stream":
        given += ["--answer", str(PATIENCE_S)]
    return [sys.executable, "-m", "pelorus", *given]


def pelorus(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words(*arguments), capture_output=True, text=True, check=False)


# --- what is said and recorded --------------------------------------------------------------------


def poses_in(path: Path) -> tuple[list[Pose], Counts]:
    received, counts = read_file(path)
    messages = [frame.message for frame in received]
    return [m for m in messages if isinstance(m, Pose) and m.after_stereo], counts


def replayed(log: Path, program: Path) -> list[Pose]:
    """What this machine computes from it, with no setting but what it says."""
    answers = log.with_suffix(".again.plr")
    subprocess.run([program, log, "--quiet", "--out", answers], check=True, timeout=PATIENCE_S)
    return poses_in(answers)[0]


def assert_same_bits(done: subprocess.CompletedProcess[str], log: Path, program: Path) -> None:
    """The command found them equal, and a replay of the log finds them again."""
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].startswith(f"the same bits: {FRAMES} of {FRAMES} frames")
    robots, counts = poses_in(log)
    assert counts.clean
    assert counts.ended
    assert len(robots) == FRAMES
    assert digest(replayed(log, program)) == digest(robots)


@pytest.mark.spread
@BOTH
def test_a_board_on_a_wire_computes_the_same_bits(
    behind: Behind, board: str, firmware: Path, short_drive: Path, program: Path, tmp_path: Path
) -> None:
    log = tmp_path / "flight.plr"
    with behind(board, firmware) as connected:
        to = ("--to", connected.target, "--record", log)
        done = pelorus("stream", short_drive, *to, "--compare", "--bin", program.parent)
    assert_same_bits(done, log, program)


@pytest.mark.once
@BOTH
def test_a_board_that_goes_away_leaves_a_log_that_replays_to_its_bits(
    behind: Behind, board: str, firmware: Path, endless_drive: Path, program: Path, tmp_path: Path
) -> None:
    log = tmp_path / "flight.plr"
    with behind(board, firmware) as connected:
        command = words("stream", endless_drive, "--to", connected.target, "--record", log)
        sender = subprocess.Popen(
            command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        wait_for_poses(log, 10, sender)
        connected.process.kill()
        said, trouble = sender.communicate(timeout=PATIENCE_S)
    assert sender.returncode == 1
    where = connected.target.split(":", 1)[1].removesuffix(":921600")
    assert f"{where}: the connection is lost: " in trouble
    assert re.search(r"\(after \d+ of \d+ frames\)", trouble)
    assert f"recorded  {log}" in said
    robots, counts = poses_in(log)
    assert counts.clean
    assert not counts.ended
    assert len(robots) >= 10
    assert pelorus("info", log).returncode == 0
    ours = replayed(log, program)
    assert digest(ours[: len(robots)]) == digest(robots)
    assert len(ours) - len(robots) <= 1  # the frame that was under way


@pytest.mark.once
@pytest.mark.parametrize("asked", [signal.SIGINT, signal.SIGTERM], ids=["ctrl-c", "terminate"])
def test_a_drive_that_is_ended_by_hand_says_how_far_it_came_and_leaves_no_emulator(
    board: str, firmware: Path, endless_drive: Path, tmp_path: Path, asked: signal.Signals
) -> None:
    log = tmp_path / "flight.plr"
    to = ("--to", f"qemu:{board}", "--image", firmware, "--record", log)
    sender = subprocess.Popen(
        words("stream", endless_drive, *to),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    wait_for_poses(log, 5, sender)
    emulator = child_of(sender)
    sender.send_signal(asked)
    said, _ = sender.communicate(timeout=PATIENCE_S)
    assert sender.returncode == 130
    assert re.search(r"^frames    \d+ sent, \d+ answered with a pose$", said, re.M)
    assert f"recorded  {log}" in said
    assert not Path(f"/proc/{emulator}").exists()
    assert poses_in(log)[1].clean


@pytest.mark.once
def test_an_emulator_that_dies_is_told_as_such(
    board: str, firmware: Path, endless_drive: Path, tmp_path: Path
) -> None:
    log = tmp_path / "flight.plr"
    to = ("--to", f"qemu:{board}", "--image", firmware, "--record", log)
    sender = subprocess.Popen(
        words("stream", endless_drive, *to), text=True, stderr=subprocess.PIPE
    )
    wait_for_poses(log, 5, sender)
    os.kill(child_of(sender), signal.SIGKILL)
    _, trouble = sender.communicate(timeout=PATIENCE_S)
    assert sender.returncode == 1
    assert f"qemu:{board}: QEMU stopped with status -9" in trouble
    assert re.search(r"\(after \d+ of \d+ frames\)", trouble)


def child_of(process: subprocess.Popen[str]) -> int:
    (child,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    return int(child)


def wait_for_poses(log: Path, count: int, sender: subprocess.Popen[str]) -> None:
    """Until the log, as it is on the disk, holds so many."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline and sender.poll() is None:
        if log.exists() and log.stat().st_size and len(poses_in(log)[0]) >= count:
            return
        time.sleep(LOOK_AGAIN_S)
    pytest.fail("the drive did not come so far")


@pytest.mark.once
def test_a_log_that_is_sent_to_the_board_again_gives_its_bits_again(
    board: str, firmware: Path, short_drive: Path, program: Path, tmp_path: Path
) -> None:
    first, second = tmp_path / "first.plr", tmp_path / "second.plr"
    to = ("--to", f"qemu:{board}", "--image", firmware)
    assert pelorus("stream", short_drive, *to, "--record", first).returncode == 0
    comparing = (*to, "--compare", "--bin", program.parent)
    done = pelorus("stream", first, *comparing, "--record", second)
    assert_same_bits(done, second, program)
    assert digest(poses_in(second)[0]) == digest(poses_in(first)[0])


@pytest.mark.once
def test_the_log_of_a_drive_is_taken_by_info_replay_and_report(
    board: str, firmware: Path, short_drive: Path, program: Path, tmp_path: Path
) -> None:
    log, out = tmp_path / "flight.plr", tmp_path / "report"
    to = ("--to", f"qemu:{board}", "--image", firmware, "--record", log)
    done = pelorus("stream", short_drive, *to, "--compare", "--bin", program.parent)
    assert_same_bits(done, log, program)
    info = pelorus("info", log)
    assert info.returncode == 0, info.stderr
    assert re.search(rf"^POSE +{FRAMES} *$", info.stdout, re.M)
    assert "no damage" in info.stdout
    report = pelorus("report", log, "--out", out, "--bin", program.parent)
    assert report.returncode == 0, report.stderr
    assert (out / "report.html").stat().st_size > 10_000


@pytest.mark.once
def test_the_log_of_a_drive_compares_equal_and_one_other_bit_does_not(
    board: str, firmware: Path, short_drive: Path, program: Path, tmp_path: Path
) -> None:
    log, other = tmp_path / "flight.plr", tmp_path / "other.plr"
    to = ("--to", f"qemu:{board}", "--image", firmware, "--record", log)
    assert pelorus("stream", short_drive, *to).returncode == 0
    same = pelorus("compare", log, "--bin", program.parent)
    assert same.returncode == 0, same.stdout + same.stderr
    assert f"the same bits: {FRAMES} of {FRAMES} frames" in same.stdout
    messages = [frame.message for frame in read_file(log)[0][:-1]]
    at = [k for k, message in enumerate(messages) if isinstance(message, Pose)][17]
    pose = messages[at]
    assert isinstance(pose, Pose)
    moved = pose.p_WB_m.copy()
    moved[0] = np.nextafter(moved[0], np.inf)
    messages[at] = replace(pose, p_WB_m=moved)
    with other.open("wb") as stream:
        writer = Writer(stream)
        for message in messages:
            writer.write(message)
        writer.end()
    found = pelorus("compare", other, "--bin", program.parent)
    assert found.returncode == 1, found.stdout + found.stderr
    assert "frame 18, " in found.stdout


@pytest.mark.spread
def test_the_log_of_a_board_that_was_reset_compares_equal_in_both_its_lives(
    emulator: Emulator, short_drive: Path, program: Path, tmp_path: Path
) -> None:
    log = tmp_path / "flight.plr"
    link = emulator.connect()
    messages = [frame.message for frame in read_file(short_drive)[0]]

    def pressed() -> Iterator[Message]:
        for at, message in enumerate(messages):
            if at == len(messages) // 2:
                emulator.reset()
            yield message

    with log.open("wb") as stream:
        outcome = Streamer(link, stream).run(pressed())
    link.close()
    assert outcome.restarts == 1
    found = pelorus("compare", log, "--bin", program.parent)
    assert found.returncode == 0, found.stdout + found.stderr
    assert "part 2 of 2, " in found.stdout
    assert f"the same bits: {len(outcome.poses)} of {FRAMES} frames" in found.stdout
