# SPDX-License-Identifier: MIT
"""`pelorus stream` over TCP and over a serial device, to a board that is none. What a real one
computes is tests/target's.
"""

from __future__ import annotations

import errno
import io
import os
import re
import socket
import termios
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from fake_board import FULL, FakeBoard, Manner, Served, TcpBoard, TerminalBoard
from pelorus.errors import PelorusError
from pelorus.robot import link
from pelorus.robot.link import Link, LinkClosed
from pelorus.robot.serial import open_serial
from pelorus.robot.stream import FlightLog, Streamer, refusal
from pelorus.wire import framing
from pelorus.wire.frames import (
    Config,
    Kind,
    Message,
    Pose,
    Report,
    Stereo,
    Text,
)
from pelorus.wire.schema import STATUSES
from replay_drive import BIN, FRAMES, drive, encode, log_of, run

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = Config({4: 32.0}, 0xABCD, 32, 128, 8, 4)

Connection = Callable[[FakeBoard], Served]
BOTH = pytest.mark.parametrize("connection", [TcpBoard, TerminalBoard], ids=["tcp", "serial"])


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "drive.plr"
    path.write_bytes(encode(drive()))
    return path


def one_line(text: str) -> str:
    return " ".join(text.split())


# --- drives that go well --------------------------------------------------------------------------


@BOTH
def test_a_drive_is_sent_whole_and_answered(
    connection: Connection, recording: Path, tmp_path: Path, pelorus: Run
) -> None:
    board, log = FakeBoard(), tmp_path / "flight.plr"
    with connection(board) as served:
        said = pelorus("stream", recording, "--to", served.target, "--record", log)
    assert f"frames {FRAMES} sent, {FRAMES} answered with a pose" in one_line(said.out)
    assert "lost 0 without an answer; 0 restarts of the board" in one_line(said.out)
    sent = [message for message in board.heard if message.kind != Kind.END]
    assert sent == drive()
    assert [m for m in log_of(log) if isinstance(m, Pose)] == board.poses


@BOTH
def test_the_log_has_the_settings_before_the_data(
    connection: Connection, recording: Path, tmp_path: Path, pelorus: Run
) -> None:
    log = tmp_path / "flight.plr"
    with connection(FakeBoard()) as served:
        pelorus("stream", recording, "--to", served.target, "--record", log)
    kinds = [message.kind for message in log_of(log)]
    first = [Kind.HEADER, Kind.CONFIG, Kind.TWIST, Kind.TRUTH, Kind.STEREO, Kind.POSE, Kind.REPORT]
    assert kinds[: len(first)] == first
    assert kinds.count(Kind.CONFIG) == 1
    assert "no damage" in pelorus("info", log).out


def test_a_replay_of_the_log_takes_the_boards_settings(
    recording: Path, tmp_path: Path, pelorus: Run
) -> None:
    log = tmp_path / "flight.plr"
    with TcpBoard(FakeBoard(Manner(slots=7))) as served:
        pelorus("stream", recording, "--to", served.target, "--record", log)
    result = run(log)
    assert "7 slots" in result.stdout
    assert "refused" not in result.stderr


def test_a_boards_words_are_shown_whole_and_as_they_are(recording: Path, pelorus: Run) -> None:
    words = "[red]watchdog[/] :x: at 0x08001234, " + "so it was " * 15 + "the end"
    with TcpBoard(FakeBoard(Manner(says=words))) as served:
        said = pelorus("stream", recording, "--to", served.target)
    assert f"board     {words}\n" in said.out


def test_only_so_many_frames_are_sent_as_asked(recording: Path, pelorus: Run) -> None:
    board = FakeBoard()
    with TcpBoard(board) as served:
        pelorus("stream", recording, "--to", served.target, "--frames", "7")
    assert sum(message.kind == Kind.STEREO for message in board.heard) == 7


def with_a_long_frame() -> tuple[list[Message], int]:
    """The drive with 129 observations or more in one frame, and its time."""
    messages = drive()
    at = next(k for k, m in enumerate(messages) if isinstance(m, Stereo) and k > 20)
    frame = messages[at]
    assert isinstance(frame, Stereo)
    more = 128 // len(frame.ids) + 1
    ids = np.arange(more * len(frame.ids), dtype=np.uint32)
    messages[at] = Stereo(frame.t_ns, ids, np.tile(frame.pixels, (more, 1)))
    return messages, frame.t_ns


@pytest.mark.parametrize("kept", [True, False])
def test_a_drive_is_compared_as_its_log_would_be(
    recording: Path, pelorus: Run, tmp_path: Path, kept: bool
) -> None:
    """The board that is none has bits of its own."""
    log = tmp_path / "flight.plr"
    record = ("--record", log) if kept else ()
    with TcpBoard(FakeBoard()) as served:
        said = pelorus(
            "stream",
            recording,
            "--to",
            served.target,
            *record,
            "--compare",
            "--bin",
            BIN,
            status=None,
        )
    assert said.status not in (0, 2), said.err
    assert "frames    40 sent, 40 answered with a pose" in said.out
    assert f"0 of {FRAMES} frames are the same to the bit" in said.out
    assert log.exists() is kept
    if kept:
        alone = pelorus("compare", log, "--bin", BIN, status=said.status)
        assert said.out.endswith(alone.out)


def test_a_frame_too_long_for_the_board_is_answered_and_told_in_words(
    tmp_path: Path, pelorus: Run
) -> None:
    path = tmp_path / "long.plr"
    path.write_bytes(encode(with_a_long_frame()[0]))
    with TcpBoard(FakeBoard()) as served:
        said = pelorus("stream", path, "--to", served.target)
    assert "lost 0 without an answer" in one_line(said.out)
    assert f"1 STEREO: {STATUSES[FULL]} (status -10)" in said.out


# --- the serial device's settings -----------------------------------------------------------------


def test_a_serial_device_is_made_raw_at_the_asked_speed() -> None:
    ours, theirs = os.openpty()
    opened = open_serial(Path(os.ttyname(theirs)), 115200)
    inputs, outputs, control, local, speed_in, speed_out, _ = termios.tcgetattr(theirs)
    assert (speed_in, speed_out) == (termios.B115200, termios.B115200)
    assert not inputs & (termios.ICRNL | termios.IXON | termios.ISTRIP | termios.INPCK)
    assert not outputs & termios.OPOST
    assert not local & (termios.ECHO | termios.ICANON | termios.ISIG | termios.IEXTEN)
    assert control & termios.CSIZE == termios.CS8
    assert control & termios.CLOCAL
    assert control & termios.CREAD
    assert not control & (termios.CSTOPB | termios.PARENB | termios.CRTSCTS)
    opened.close()
    os.close(ours)
    os.close(theirs)


def test_every_byte_value_goes_through_a_serial_device_unchanged() -> None:
    ours, theirs = os.openpty()
    opened = open_serial(Path(os.ttyname(theirs)), 921600)
    every = bytes(range(256))
    assert opened.exchange(every) == b""  # no echo
    assert os.read(ours, 1024) == every
    os.write(ours, every)
    assert opened.exchange(b"", 1.0) == every
    opened.close()
    os.close(ours)
    os.close(theirs)


def test_what_waits_in_a_serial_device_from_before_is_dropped() -> None:
    ours, theirs = os.openpty()
    os.write(ours, b"old news\n")
    opened = open_serial(Path(os.ttyname(theirs)), 921600)
    assert opened.exchange(b"", 0.1) == b""
    opened.close()
    os.close(ours)
    os.close(theirs)


# --- targets that cannot be opened ----------------------------------------------------------------


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "CONNECT_S", 0.1)


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize(
    ("target", "where", "what"),
    [
        ("tcp:no-such-host.invalid:5000", "no-such-host.invalid:5000", "no such host"),
        ("tcp:a..b:5000", "a..b:5000", "no name of a host"),
        ("serial:/dev/no-such-device", "/dev/no-such-device", "No such file or directory"),
        ("serial:/dev", "/dev", "Is a directory"),
        ("serial:/dev/null", "/dev/null", "is no serial device"),
        ("serial:/dev/null:12345", "/dev/null", "knows no 12345 baud; the boards run at 921600"),
        ("serial:/dev/null:0", "/dev/null", "knows no 0 baud"),
        ("tcp:localhost", "tcp:localhost", "tcp:HOST:PORT"),
        ("tcp:localhost:0", "tcp:localhost:0", "tcp:HOST:PORT"),
        ("tcp:localhost:65536", "tcp:localhost:65536", "tcp:HOST:PORT"),
        ("tcp:localhost:x", "tcp:localhost:x", "tcp:HOST:PORT"),
        ("serial:", "serial:", "serial:DEVICE[:BAUD]"),
        ("usb:x:1", "usb:x:1", "qemu:BOARD, tcp:HOST:PORT or serial:DEVICE[:BAUD]"),
        ("qemu:no_such_board", "no_such_board", "QEMU can be mps2_an386"),
    ],
)
def test_a_target_that_cannot_be_reached_says_which_and_why(
    recording: Path, tmp_path: Path, pelorus: Run, target: str, where: str, what: str
) -> None:
    log = tmp_path / "flight.plr"
    said = pelorus("stream", recording, "--to", target, "--record", log, status=1)
    assert said.out == ""
    assert said.err.startswith("error: ")
    assert where in said.err
    assert what in said.err
    assert not log.exists()


@pytest.mark.usefixtures("impatient")
def test_a_port_where_nobody_listens_is_refused(recording: Path, pelorus: Run) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    said = pelorus("stream", recording, "--to", f"tcp:127.0.0.1:{port}", status=1)
    assert f"127.0.0.1:{port}: cannot be reached: Connection refused" in said.err
    assert "does something listen on this port?" in said.err


def test_a_file_is_no_serial_device_and_stays_as_it_is(recording: Path, pelorus: Run) -> None:
    before = recording.read_bytes()
    said = pelorus("stream", recording, "--to", f"serial:{recording}", status=1)
    assert "is no serial device" in said.err
    assert recording.read_bytes() == before


def test_a_device_that_does_not_take_the_speed_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ours, theirs = os.openpty()
    before = len(os.listdir("/proc/self/fd"))
    monkeypatch.setattr(termios, "tcsetattr", lambda *_: None)
    with pytest.raises(PelorusError, match=r"/dev/pts/\d+: cannot do 921600 baud"):
        open_serial(Path(os.ttyname(theirs)), 921600)
    assert len(os.listdir("/proc/self/fd")) == before
    os.close(ours)
    os.close(theirs)


def test_an_image_that_is_none_is_refused_before_qemu_sees_it(
    recording: Path, pelorus: Run
) -> None:
    said = pelorus(
        "stream", recording, "--to", "qemu:mps2_an500", "--image", recording, status=None
    )
    assert said.status != 0
    assert f"{recording}: is no firmware image; give the .elf of a board" in said.err


def test_an_image_is_for_the_emulator_alone(recording: Path, pelorus: Run) -> None:
    said = pelorus(
        "stream", recording, "--to", "tcp:localhost:5000", "--image", recording, status=1
    )
    assert "--image is for qemu:BOARD alone" in said.err


# --- drives that end badly ------------------------------------------------------------------------


@BOTH
def test_a_connection_that_is_lost_says_how_far_it_came_and_leaves_a_whole_log(
    connection: Connection, recording: Path, tmp_path: Path, pelorus: Run
) -> None:
    board, log = FakeBoard(Manner(leaves_after=10)), tmp_path / "flight.plr"
    with connection(board) as served:
        where = served.target.split(":", 1)[1].removesuffix(":115200")
        said = pelorus("stream", recording, "--to", served.target, "--record", log, status=1)
    assert f"{where}: the connection is lost: " in said.err
    assert "is the board still powered and connected" in said.err
    assert re.search(rf"\(after 1[01] of {FRAMES} frames\)", said.err)
    assert "10 answered with a pose" in said.out
    assert f"recorded {log}" in one_line(said.out)
    received, counts = framing.read_file(log)
    assert counts.clean
    assert not counts.ended
    kept = [frame.message for frame in received]
    assert [m for m in kept if isinstance(m, Pose)] == board.poses
    inputs = [m for m in kept if m.kind in (Kind.HEADER, Kind.TWIST, Kind.TRUTH, Kind.STEREO)]
    assert inputs == drive()[: len(inputs)]
    assert len(inputs) >= 1 + 3 * 10
    info = pelorus("info", log)
    assert "there is no END: the recording was cut short" in info.out


def test_a_board_that_never_answers_is_given_up_and_the_log_says_when(
    recording: Path, tmp_path: Path, pelorus: Run
) -> None:
    log = tmp_path / "flight.plr"
    with TcpBoard(FakeBoard(Manner(silent=True))) as served:
        to = ("--to", served.target, "--answer", "0.02")
        said = pelorus("stream", recording, *to, "--record", log, status=1)
    assert "5 frames in a row without an answer; is the board running the firmware" in said.err
    received, counts = framing.read_file(log)
    assert counts.clean
    remarks = [frame.message.text for frame in received if isinstance(frame.message, Text)]
    times = [m.t_ns for m in drive() if isinstance(m, Stereo)][:5]
    for t_ns, remark in zip(times, remarks, strict=True):
        assert remark.startswith(f"no answer to the frame of {t_ns} ns")


def test_the_answer_to_an_earlier_frame_is_not_taken_for_that_to_the_last(
    recording: Path, pelorus: Run
) -> None:
    with TcpBoard(FakeBoard(Manner(a_frame_late=True))) as served:
        said = pelorus("stream", recording, "--to", served.target, "--answer", "0.1", status=1)
    assert "5 frames in a row without an answer" in said.err
    # The first has no earlier one: it is answered, if this machine is not too busy.
    assert re.search(rf"\(after [56] of {FRAMES} frames\)", said.err)


def test_a_log_that_cannot_be_written_is_told(
    recording: Path, tmp_path: Path, pelorus: Run
) -> None:
    with TcpBoard(FakeBoard()) as served:
        log = tmp_path / "no-such-folder" / "flight.plr"
        said = pelorus("stream", recording, "--to", served.target, "--record", log, status=1)
    assert f"{log}: cannot be written: there is no folder {log.parent}" in said.err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_is_told_by_its_name(recording: Path, pelorus: Run) -> None:
    with TcpBoard(FakeBoard()) as served:
        said = pelorus(
            "stream", recording, "--to", served.target, "--record", "/dev/full", status=1
        )
    assert f"/dev/full: cannot be written: {os.strerror(errno.ENOSPC)}" in said.err


def test_the_recording_that_is_sent_is_not_written_over(recording: Path, pelorus: Run) -> None:
    before = recording.read_bytes()
    call = ("stream", recording, "--to", "tcp:localhost:5000", "--record", recording)
    assert "is there already" in pelorus(*call, status=1).err
    said = pelorus(*call, "--force", status=1)
    assert "--record needs another file" in said.err
    assert recording.read_bytes() == before


# --- the parts ------------------------------------------------------------------------------------


def test_what_came_before_a_connection_closed_is_not_lost() -> None:
    near, far = socket.socketpair()
    opened = Link(near.detach(), "pair")
    far.send(b"last words")
    far.close()
    assert opened.exchange(b"anyone?") == b"last words"
    with pytest.raises(LinkClosed, match="pair: the connection is lost"):
        opened.exchange(b"anyone?")
    opened.close()


def kept(*messages: Message) -> list[Message]:
    """What a log holds of them, without being ended."""
    stream = io.BytesIO()
    log = FlightLog(stream)
    for message in messages:
        log.keep(message, heard=message is SETTINGS or isinstance(message, Report))
    return [frame.message for frame in framing.Reader().feed(stream.getvalue())]


def test_the_log_holds_data_back_until_the_settings_are_told() -> None:
    first, second, third = drive()[1:4]
    header, answer = drive()[0], Report(third.t_ns, Kind.STEREO)  # type: ignore[attr-defined]
    assert kept(header, first, second, third) == [header]
    assert kept(header, first, SETTINGS, second) == [header, SETTINGS, first, second]
    assert kept(header, first, third, answer) == [header, first, third, answer]
    assert kept(header, first, answer, SETTINGS, second)[-2:] == [SETTINGS, second]


def test_each_message_is_on_the_disk_at_once(tmp_path: Path) -> None:
    path = tmp_path / "flight.plr"
    with path.open("wb") as stream:
        log = FlightLog(stream)
        for count, message in enumerate([drive()[0], SETTINGS, *drive()[1:5]], 1):
            log.keep(message, heard=message is SETTINGS)
            assert len(log_of(path)) == count


def test_wanted_settings_among_the_data_release_nothing() -> None:
    header, first = drive()[:2]
    assert kept(header, first, Config({4: 16.0})) == [header]


def test_a_log_that_is_sent_again_has_the_settings_of_its_time_not_of_this_board() -> None:
    header, first = drive()[:2]
    theirs = replace(SETTINGS, build_fingerprint=SETTINGS.build_fingerprint + 1)
    assert kept(header, theirs, first) == [header, theirs]
    assert kept(header, theirs, first, SETTINGS) == [header, theirs, SETTINGS, first]


def test_a_log_that_is_ended_holds_all_and_is_whole() -> None:
    stream = io.BytesIO()
    log = FlightLog(stream)
    for message in drive(3):
        log.keep(message)
    log.end()
    reader = framing.Reader()
    assert [frame.message for frame in reader.feed(stream.getvalue())][:-1] == drive(3)
    assert reader.counts.clean
    assert reader.counts.ended


def test_a_doubled_frame_is_waited_for_twice() -> None:
    """The answer to the first is not taken for that to the second."""
    frame = next(message for message in drive() if isinstance(message, Stereo))
    board = FakeBoard()
    with TcpBoard(board) as served:
        host, port = served.target.split(":")[1:]
        opened = link.tcp(host, int(port))
        outcome = Streamer(opened).run([drive()[0], frame, frame])
        opened.close()
    assert len(outcome.poses) == 2
    assert outcome.reports == {0: 2}


def test_the_words_for_a_refusal_are_those_of_every_status() -> None:
    text = (ROOT / "include" / "pelorus" / "types.h").read_text()
    numbers = [int(number) for number in re.findall(r"PLR_E_\w+ = (-\d+)", text)]
    assert sorted([*numbers, 0]) == sorted(STATUSES)
    assert (
        refusal(Kind.TWIST, -6, 3)
        == "3 TWIST: time repeats or goes back; it must ascend (status -6)"
    )
    assert refusal(77, -16, 1).startswith(
        "1 kind 77: it comes from another version or build, or is of a kind"
    )
    assert refusal(0, -15, 2) == "2 frames: damaged: bytes fail their check (status -15)"
    assert STATUSES[FULL].startswith("there is no room for it: no slot is free, a board holds less")
