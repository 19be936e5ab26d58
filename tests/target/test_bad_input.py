# SPDX-License-Identifier: MIT
"""What a wire can do to a drive, done to a board and to the desktop alike: the same damaged bytes
must give the same answers, to the bit, and the drive after them must be as good as any.
"""

from __future__ import annotations

import random
import struct
import subprocess
import time
import zlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import pytest
from desk import digest
from gdb_stub import GdbStub, symbol
from pelorus.robot.emulator import Emulator
from pelorus.robot.link import Link
from pelorus.robot.stream import Streamer
from pelorus.wire import cobs
from pelorus.wire.frames import End, Header, Kind, Message, Pose, Report, Stereo, Text, Truth, Twist
from pelorus.wire.framing import DELIMITER, Reader, encode, read_file
from recordings import first_frames

FRAMES = 24
SLOTS = 32
STUCK = 15  # messages, five frames
RATE = 0.0025  # of bytes; of a STEREO's 130 or so, every third frame is hit
UNKNOWN_KINDS = (0, 77, 200, 255)
FOREIGN, NOT_READY = -16, -13  # plr_status
FUZZ = Path(__file__).resolve().parents[1] / "fuzz"
STREAM = 128  # in the first byte of an input of corpus_session: see fuzz_session.c
PATIENCE_S = 1800.0  # against hangs
DAY_NS = 86_400_000_000_000
END = DELIMITER + encode(End(0, 0, 0, 0, 0), 0)


@pytest.fixture(scope="module")
def messages(drive: list[Message]) -> list[Message]:
    return first_frames(drive, FRAMES)


# --- the same bytes, there and here ---------------------------------------------------------------


def boards_answers(link: Link, pieces: Iterable[bytes]) -> list[Message]:
    """All that the board says to these bytes, up to its END."""
    Streamer(link).greet()
    reader, answers = Reader(), []
    for piece in [*pieces, END]:
        answers += [got.message for got in reader.feed(link.exchange(piece))]
    deadline = time.monotonic() + PATIENCE_S
    while not any(isinstance(answer, End) for answer in answers):
        assert time.monotonic() < deadline, "the board does not answer END any more"
        answers += [got.message for got in reader.feed(link.exchange(b"", 1.0))]
    assert reader.counts.clean or reader.counts.missing  # it goes on counting from before
    return answers


def desktops_answers(program: Path, stream: bytes, folder: Path) -> list[Message]:
    """All that the desktop says to the same bytes."""
    recording, answers = folder / "bytes.plr", folder / "answers.plr"
    recording.write_bytes(stream + END)
    command = [str(program), str(recording), "--quiet", "--slots", str(SLOTS)]
    command += ["--out", str(answers)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [frame.message for frame in read_file(answers)[0]]


def computed(answers: list[Message]) -> list[Message]:
    """Poses and reports, without what a frame took: that is each machine's own."""
    found: list[Message] = []
    for answer in answers:
        if isinstance(answer, Pose):
            found.append(answer)
        elif isinstance(answer, Report):
            found.append(replace(answer, update_us=0))
    return found


def poses(answers: Iterable[Message]) -> list[Pose]:
    return [answer for answer in answers if isinstance(answer, Pose)]


def refusals(answers: Iterable[Message]) -> list[tuple[int, int]]:
    return [(a.subject, a.status) for a in answers if isinstance(a, Report) and a.status]


def frames_of(messages: Iterable[Message]) -> bytes:
    return b"".join(encode(message, number) for number, message in enumerate(messages))


# --- lost, doubled, damaged bytes -----------------------------------------------------------------


def lost(_byte: int, _dice: random.Random) -> bytes:
    return b""


def doubled(byte: int, _dice: random.Random) -> bytes:
    return bytes((byte, byte))


def damaged(byte: int, dice: random.Random) -> bytes:
    return bytes((byte ^ 1 << dice.randrange(8),))


Fault = Callable[[int, random.Random], bytes]


def hit(stream: bytes, faults: list[Fault], seed: int) -> bytes:
    """The stream with seeded faults."""
    dice = random.Random(seed)
    out = bytearray()
    for byte in stream:
        fault = dice.random() < RATE
        out += dice.choice(faults)(byte, dice) if fault else bytes((byte,))
    return bytes(out)


@pytest.mark.spread
@pytest.mark.parametrize(
    ("faults", "seed"),
    [([lost], 1), ([doubled], 2), ([damaged], 3), ([lost, doubled, damaged], 4)],
    ids=["lost", "doubled", "damaged", "all"],
)
def test_lost_doubled_and_damaged_bytes_cost_the_same_frames_as_on_the_desktop(
    link: Link,
    messages: list[Message],
    program: Path,
    tmp_path: Path,
    faults: list[Fault],
    seed: int,
) -> None:
    clean = digest(Streamer(link).run(messages).poses)
    header, data = encode(messages[0], 0), frames_of(messages)
    stream = header + hit(data[len(header) :], faults, seed)
    board = boards_answers(link, [stream])
    assert computed(board) == computed(desktops_answers(program, stream, tmp_path))
    assert FRAMES / 3 < len(poses(board)) < FRAMES
    assert digest(Streamer(link).run(messages).poses) == clean


@pytest.mark.spread
def test_pieces_of_any_size_change_no_bit(link: Link, messages: list[Message]) -> None:
    stream, dice = frames_of(messages), random.Random(5)
    clean = computed(boards_answers(link, [stream]))
    assert len(poses(clean)) == FRAMES
    pieces, at = [], 0
    while at < len(stream):
        size = dice.randrange(1, 60)
        pieces.append(stream[at : at + size])
        at += size
    assert computed(boards_answers(link, pieces)) == clean


# --- frames that are no messages ------------------------------------------------------------------


def frame_of_kind(kind: int, payload: bytes) -> bytes:
    body = struct.pack("<BH", kind, 0) + payload
    return cobs.encode(body + struct.pack("<I", zlib.crc32(body))) + DELIMITER


@pytest.mark.spread
def test_unknown_kinds_are_refused_and_change_no_bit(link: Link, messages: list[Message]) -> None:
    clean = boards_answers(link, [frames_of(messages)])
    assert refusals(clean) == []
    pieces = []
    for number, message in enumerate(messages):
        kind = UNKNOWN_KINDS[number % len(UNKNOWN_KINDS)]
        pieces += [frame_of_kind(kind, bytes(number % 50)), encode(message, number)]
    board = boards_answers(link, pieces)
    assert len(refusals(board)) == len(messages)
    assert set(refusals(board)) == {(kind, FOREIGN) for kind in UNKNOWN_KINDS}
    assert digest(poses(board)) == digest(poses(clean))


@pytest.mark.spread
def test_a_header_of_a_later_version_is_refused_and_the_drive_goes_on(
    link: Link, messages: list[Message]
) -> None:
    clean = boards_answers(link, [frames_of(messages)])
    header = messages[0]
    assert isinstance(header, Header)
    later = encode(replace(header, version_major=2), 0)
    half = len(messages) // 2
    board = boards_answers(link, [frames_of(messages[:half]), later, frames_of(messages[half:])])
    assert refusals(board) == [(Kind.HEADER, FOREIGN)]
    assert digest(poses(board)) == digest(poses(clean))


@pytest.mark.spread
def test_data_before_a_header_is_refused_one_by_one(link: Link, messages: list[Message]) -> None:
    board = boards_answers(link, [frames_of(messages[1:])])
    kinds = [message.kind for message in messages[1:]]  # TRUTH is for mapping and evaluation alone
    assert refusals(board) == [(kind, NOT_READY) for kind in kinds if kind != Kind.TRUTH]
    assert poses(board) == []


def session_input(path: Path) -> bytes:
    """An input of the harness of the whole loop: a stream, or records of which it makes frames."""
    content = path.read_bytes()
    first, records = content[0], content[2:]
    if first & STREAM:
        return records
    stream = b""
    while len(records) >= 3:
        kind, size = struct.unpack_from("<BH", records)
        stream += frame_of_kind(kind, records[3 : 3 + size])
        records = records[3 + size :]
    return stream


@pytest.mark.spread
def test_what_a_fuzzer_recorded_neither_stops_nor_resets_it(
    link: Link, messages: list[Message]
) -> None:
    clean = digest(Streamer(link).run(messages).poses)
    inputs = [path.read_bytes() for path in sorted((FUZZ / "corpus").iterdir())]
    inputs += [session_input(path) for path in sorted((FUZZ / "corpus_session").iterdir())]
    for recorded in inputs:
        link.exchange(recorded + DELIMITER)
    streamer = Streamer(link)
    assert digest(streamer.run(messages).poses) == clean
    assert streamer.outcome.restarts == 0


# --- clocks ---------------------------------------------------------------------------------------


def shifted(message: Message, by_ns: int) -> Message:
    if isinstance(message, Twist | Stereo | Truth):
        return replace(message, t_ns=message.t_ns + by_ns)
    return message


@pytest.mark.spread
@pytest.mark.parametrize(
    "by_ns", [DAY_NS, 5_000_000_000, -3_000_000_000], ids=["day", "5s", "back"]
)
def test_time_stamps_that_jump_are_followed_as_on_the_desktop(
    link: Link, messages: list[Message], program: Path, tmp_path: Path, by_ns: int
) -> None:
    half = len(messages) // 2
    origin = 10_000_000_000  # so that there is room to go back
    jumping = [shifted(message, origin) for message in messages[:half]]
    jumping += [shifted(message, origin + by_ns) for message in messages[half:]]
    stream = frames_of(jumping)
    board = boards_answers(link, [stream])
    assert computed(board) == computed(desktops_answers(program, stream, tmp_path))
    assert any("clock" in answer.text for answer in board if isinstance(answer, Text))
    last = poses(board)[-1]
    assert last.t_ns == next(m.t_ns for m in reversed(jumping) if isinstance(m, Stereo))


@pytest.mark.spread
def test_time_stamps_that_stand_still_are_refused_as_on_the_desktop(
    link: Link, messages: list[Message], program: Path, tmp_path: Path
) -> None:
    half = len(messages) // 2
    times = [m.t_ns for m in messages[:half] if isinstance(m, Twist | Stereo)]
    stuck = [
        replace(message, t_ns=times[-1]) if isinstance(message, Twist | Stereo) else message
        for message in messages[half : half + STUCK]
    ]
    stream = frames_of([*messages[:half], *stuck, *messages[half + STUCK :]])
    board = boards_answers(link, [stream])
    assert computed(board) == computed(desktops_answers(program, stream, tmp_path))
    assert refusals(board)
    assert poses(board)[-1].t_ns == messages[-1].t_ns  # type: ignore[attr-defined]


CLOCKS = {
    "ahead": ("elapsed", struct.pack("<Q", 1 << 62)),
    "back": ("elapsed", bytes(8)),
    "stalls": ("period", bytes(4)),
}


@pytest.mark.spread
@pytest.mark.parametrize("what", CLOCKS)
def test_the_boards_own_clock_changes_no_bit(
    board: str, firmware: Path, messages: list[Message], tmp_path: Path, what: str
) -> None:
    """Written into the clock's memory in mid-drive: it jumps, or stands still from there on."""
    name, content = CLOCKS[what]
    debugger = tmp_path / "gdb"
    options = ("-gdb", f"unix:{debugger},server=on,wait=off")
    hit_at = [at for at, message in enumerate(messages) if isinstance(message, Stereo)][15]
    with Emulator(board, firmware, options) as emulator:
        link = emulator.connect()
        clean = Streamer(link).run(messages)
        streamer = Streamer(link)
        streamer.greet()
        for message in messages[:hit_at]:
            streamer.send(message)
        with GdbStub(debugger) as stub:
            stub.write(symbol(firmware, name), content)
            assert stub.read(symbol(firmware, name), len(content)) == content
        for message in messages[hit_at:]:
            streamer.send(message)
        streamer.finish()
        link.close()
    assert streamer.outcome.unanswered == 0
    assert streamer.outcome.restarts == 0
    assert digest(streamer.outcome.poses) == digest(clean.poses)
    assert len(clean.poses) == FRAMES
