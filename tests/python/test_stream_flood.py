# SPDX-License-Identifier: MIT
"""`pelorus stream` on a line that is none: it never stops talking, takes nothing, or commands the
terminal.
"""

from __future__ import annotations

import select
import socket
import threading
from pathlib import Path

import pytest
from converted import Run
from fake_board import FakeBoard, Manner, TcpBoard
from pelorus.robot import stream
from pelorus.robot.link import Link, LinkStalled
from pelorus.wire import framing
from pelorus.wire.frames import Text
from replay_drive import drive, encode


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "drive.plr"
    path.write_bytes(encode(drive()))
    return path


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "GREETING_S", 0.2)


FLOODS = {
    "zeros": bytes(4096),
    "no end of a frame": b"\x55" * 4096,
    "many empty frames": b"\x01\x00" * 2048,
    "sound frames": framing.encode(Text("and another thing"), 0) * 100,
}
FLOODED = pytest.mark.parametrize("flood", list(FLOODS.values()), ids=list(FLOODS))


@pytest.mark.usefixtures("impatient")
@FLOODED
def test_a_line_that_is_never_quiet_is_given_up(
    recording: Path, pelorus: Run, flood: bytes
) -> None:
    with TcpBoard(FakeBoard(Manner(floods=flood))) as served:
        said = pelorus("stream", recording, "--to", served.target, "--answer", "0.2", status=1)
    assert "does not stop talking, for 0.2 s; is it a board with the firmware" in said.err


@FLOODED
def test_a_flood_instead_of_an_answer_does_not_hold_up_the_deadline(
    recording: Path, pelorus: Run, flood: bytes
) -> None:
    with TcpBoard(FakeBoard(Manner(floods=flood, floods_after=3))) as served:
        said = pelorus("stream", recording, "--to", served.target, "--answer", "0.2", status=1)
    assert "5 frames in a row without an answer" in said.err
    assert len(said.out) < 20_000, "what the flood said is not repeated whole"


@FLOODED
def test_another_side_that_talks_and_takes_nothing_is_given_up(flood: bytes) -> None:
    near, far = socket.socketpair()
    opened, stop = Link(near.detach(), "pair"), threading.Event()

    def talk() -> None:
        while not stop.is_set():
            if select.select([], [far], [], 0.02)[1]:
                far.send(flood)

    talker = threading.Thread(target=talk)
    talker.start()
    try:
        with pytest.raises(LinkStalled, match=r"pair: takes no bytes any more, for 0.2 s"):
            for _ in opened.pieces(bytes(10_000_000), 0.0, 0.2):
                pass
    finally:
        stop.set()
        talker.join()
        opened.close()
        far.close()


def test_what_a_terminal_would_obey_is_shown_and_not_done(recording: Path, pelorus: Run) -> None:
    words = "\x1b[2J\x1b]0;title\x07 a\rb \x9b31m \u202e tail"
    with TcpBoard(FakeBoard(Manner(says=words))) as served:
        said = pelorus("stream", recording, "--to", served.target)
    shown = r"\x1b[2J\x1b]0;title\x07 a\x0db \x9b31m \u202e tail"
    assert f"board     {shown}\n" in said.out
    assert all(c.isprintable() or c == "\n" for c in said.out)
