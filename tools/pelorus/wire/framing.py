# SPDX-License-Identifier: MIT
"""Frames on the wire: sequence, CRC-32, COBS and delimiter (docs/REPLAY-FORMAT.md).

`Reader` takes bytes in pieces of any size, as a UART or a file delivers them, and continues after
damage; `Writer` is its counterpart. `Counts` has what was read and what was lost.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError, whole, writing
from pelorus.program.console import progress
from pelorus.wire import calibrated, cobs, evidence, image, packed_file, schema
from pelorus.wire.frames import End, Header, Kind, Message
from pelorus.wire.layout import MalformedPayload, row_type

VERSION_MAJOR = schema.LIMITS["version_major"]
DELIMITER = b"\0"
BODY_BYTES_MIN = schema.LIMITS["overhead_bytes"]  # kind, sequence, CRC
STUFFED_BYTES_MAX = 1 << 20  # ten times this version's longest frame; limits the buffer
HOPELESS_BYTES = 1 << 20  # after so many bytes without a good frame no more will come
SEQUENCE_MODULUS = 1 << 16
KINDS: dict[int, type[Message]] = {cls.kind: cls for cls in Message.__subclasses__()}
assert {evidence.Evidence, calibrated.Calibrated, image.Image} <= set(KINDS.values())
FAULTS_KEPT = 100  # the first ones are remembered with their place, all are counted


class VersionError(PelorusError):
    """The recording is of a later major version."""


class Received(NamedTuple):
    """A good frame, and its offset in the stream."""

    message: Message
    sequence: int
    offset: int


class SkippedFrame(NamedTuple):
    """A frame that was skipped."""

    offset: int
    what: str


@dataclass
class Counts:
    """A reader's counts. `missing` are the gaps of the sequence, including damaged frames."""

    bytes: int = 0
    frames: Counter[Kind] = field(default_factory=Counter)
    damaged: int = 0
    unknown: int = 0
    malformed: int = 0
    too_long: int = 0
    missing: int = 0
    faults: list[SkippedFrame] = field(default_factory=list)

    @property
    def good(self) -> int:
        return sum(self.frames.values())

    @property
    def clean(self) -> bool:
        return not (self.damaged or self.unknown or self.malformed or self.too_long or self.missing)

    @property
    def ended(self) -> bool:
        """Returns whether an END was read; without one the recording was cut short."""
        return self.frames[Kind.END] > 0

    def fault(self, offset: int, what: str) -> None:
        if len(self.faults) < FAULTS_KEPT:
            self.faults.append(SkippedFrame(offset, what))


def encode(message: Message, sequence: int) -> bytes:
    """Returns one whole frame: COBS(kind, sequence, payload, CRC) and the delimiter."""
    body = struct.pack("<BH", message.kind, sequence % SEQUENCE_MODULUS) + message.pack()
    return cobs.encode(body + struct.pack("<I", zlib.crc32(body))) + DELIMITER


class Reader:
    """Turns a byte stream into messages. Feed it pieces, then `finish` it."""

    def __init__(self, counts: Counts | None = None) -> None:
        self.counts = Counts() if counts is None else counts
        self._held = bytearray()
        self._held_at = 0  # offset in the stream of the first buffered byte
        self._overlong = False  # the buffered bytes are the rest of a frame that was given up
        self._expected = 0

    def feed(self, piece: bytes) -> Iterator[Received]:
        """Yields the frames that `piece` completes."""
        self.counts.bytes += len(piece)
        self._held += piece
        if DELIMITER not in piece:  # buffered bytes are not searched again for each piece
            self._give_up_on_overlong()
            return
        *whole, rest = bytes(self._held).split(DELIMITER)
        self._held = bytearray(rest)
        offset = self._held_at
        self._held_at += sum(len(stuffed) + 1 for stuffed in whole)
        for stuffed in whole:
            received = self._frame(stuffed, offset)
            offset += len(stuffed) + 1
            if received is not None:
                yield received
        self._give_up_on_overlong()

    def finish(self) -> None:
        """Ends the stream: a frame that lacks its delimiter was cut off, hence damaged."""
        if self._held and not self._overlong:
            self._damaged(self._held_at, "cut off by the end of the stream")
        self._held.clear()

    def lose(self, why: str) -> None:
        """Ends a stream that fails: one more frame is damaged, and no END will come.

        The fault is listed before all others, which it may have caused.
        """
        self.counts.damaged += 1
        self.counts.faults.insert(0, SkippedFrame(self.counts.bytes, f"damaged: {why}"))

    def _give_up_on_overlong(self) -> None:
        if len(self._held) <= STUFFED_BYTES_MAX:
            return
        if not self._overlong:
            self._overlong = True
            self._too_long(self._held_at)
        self._held_at += len(self._held)
        self._held.clear()

    def _frame(self, stuffed: bytes, offset: int) -> Received | None:
        if self._overlong:  # already counted; this is its tail
            self._overlong = False
            return None
        if len(stuffed) > STUFFED_BYTES_MAX:
            self._too_long(offset)
            return None
        content = self._checked(stuffed, offset) if stuffed else None
        if content is None:
            return None
        kind, sequence = struct.unpack_from("<BH", content)
        self._count_missing(sequence)
        return self._message(kind, sequence, content[3:], offset)

    def _checked(self, stuffed: bytes, offset: int) -> bytes | None:
        """Returns kind, sequence and payload of an undamaged frame."""
        body = cobs.decode(stuffed)
        if body is None:
            self._damaged(offset, "not valid COBS")
        elif len(body) < BODY_BYTES_MIN:
            self._damaged(offset, f"{len(body)} bytes, at least {BODY_BYTES_MIN} are expected")
        elif zlib.crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
            self._damaged(offset, "the CRC does not fit")
        else:
            return body[:-4]
        return None

    def _message(self, kind: int, sequence: int, payload: bytes, offset: int) -> Received | None:
        if kind not in KINDS:
            self.counts.unknown += 1
            self.counts.fault(offset, f"unknown kind {kind}")
            return None
        if kind == Kind.HEADER and payload and payload[0] > VERSION_MAJOR:
            raise VersionError(
                f"byte {offset}: the recording is of format version {payload[0]}, "
                f"this reader knows up to {VERSION_MAJOR}"
            )
        try:
            message = KINDS[kind].read(payload)
        except MalformedPayload as error:
            self.counts.malformed += 1
            self.counts.fault(offset, f"malformed {Kind(kind).name}: {error}")
            return None
        self.counts.frames[Kind(kind)] += 1
        return Received(message, sequence, offset)

    def _count_missing(self, sequence: int) -> None:
        """Counts missing frames; a step back, as after a restart, is no gap of almost 2^16."""
        gap = (sequence - self._expected) % SEQUENCE_MODULUS
        if gap < SEQUENCE_MODULUS // 2:
            self.counts.missing += gap
        self._expected = (sequence + 1) % SEQUENCE_MODULUS

    def _damaged(self, offset: int, what: str) -> None:
        self.counts.damaged += 1
        self.counts.fault(offset, f"damaged: {what}")

    def _too_long(self, offset: int) -> None:
        self.counts.too_long += 1
        self.counts.fault(offset, f"longer than {STUFFED_BYTES_MAX} bytes")


def end_of(counts: Counter[Kind], heard: End | None = None) -> End:
    """Returns the END after that many frames; `heard` gives what has arrived."""
    sent = End(
        twists=counts[Kind.TWIST],
        stereos=counts[Kind.STEREO],
        truths=counts[Kind.TRUTH],
        landmarks=counts[Kind.LANDMARK],
        readings=counts[Kind.READING],
        imus=counts[Kind.IMU],
        frames=sum(counts.values()),
    )
    if heard is None:
        return sent
    return replace(
        sent, differs=heard.differs, arrived=heard.arrived, imus_arrived=heard.imus_arrived
    )


class Writer:
    """Writes messages as frames, counts them, and closes the stream with END."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._counts: Counter[Kind] = Counter()
        self._written = 0

    def write(self, message: Message) -> None:
        """Writes a message as the next frame."""
        self.write_frame(message.kind, encode(message, self._written))

    def write_frame(self, kind: Kind, frame: bytes) -> None:
        """Writes the next frame, which has been made with its number in the stream already."""
        self._stream.write(frame)
        self._written += 1
        self._counts[kind] += 1

    def end(self, heard: End | None = None) -> None:
        """Closes the stream; `heard` is a robot's END, whose numbers go into this one."""
        self.write(end_of(self._counts, heard))


def write_file(path: Path, messages: Iterable[Message], count: int | None = None) -> int:
    """Writes the whole file, packed if its name says so; returns its size in bytes.

    Nothing remains if that fails. `count` is the number of messages, if known, for the
    progress.
    """
    with whole(path) as (part,), writing(path):
        with closing(packed_file.create(part, packed_file.is_packed(path))) as stream:
            writer = Writer(stream)
            for message in progress(messages, "writing", count):
                writer.write(message)
            writer.end()
        return part.stat().st_size


def read_file(path: Path, piece_bytes: int = 1 << 16) -> tuple[list[Received], Counts]:
    """Returns all good frames of a file, packed or not, and the counts.

    Raises PelorusError where nothing can be read.
    """
    counts = Counts()
    return list(frames_in(path, counts, piece_bytes)), counts


def frames_in(path: Path, counts: Counts, piece_bytes: int = 1 << 16) -> Iterator[Received]:
    """Yields the same, one after the other."""
    if path.is_dir():
        raise PelorusError(
            f"{path}: is a folder, a recording is a .plr file: `pelorus convert` makes one of a "
            "folder of pictures, a ROS 2 bag or a KITTI drive"
        )
    reader, found = Reader(counts), False
    try:
        count = path.stat().st_size // piece_bytes if path.is_file() else None
        pieces = packed_file.pieces(path, piece_bytes)
        for piece in progress(pieces, f"reading {path.name}", count):
            for frame in reader.feed(piece):
                found = True
                yield frame
            if not found and counts.bytes > HOPELESS_BYTES:
                break  # not a recording but a picture or a disk's image, of terabytes
    except packed_file.PackingDamaged as error:
        reader.lose(str(error))
    except OSError as error:
        raise PelorusError(f"{path}: cannot be read: {error.strerror}") from error
    except VersionError as error:
        raise VersionError(f"{path}: {error}") from None
    reader.finish()
    if not found and counts.faults and not counts.bytes:
        raise PelorusError(f"{path}: {counts.faults[0].what}")
    if not counts.bytes:
        raise PelorusError(f"{path}: the file is empty, a recording begins with a HEADER frame")
    if not found:
        raise PelorusError(
            f"{path}: holds no frame in its first {counts.bytes} bytes; this is no .plr recording"
        )


def messages_of(path: Path) -> list[Message]:
    """Returns a recording's messages without its damaged frames; it must have a HEADER."""
    return counted_messages_of(path)[0]


def counted_messages_of(path: Path) -> tuple[list[Message], Counts]:
    """Returns the same, and what was left out."""
    if not path.exists():
        raise PelorusError(f"{path}: there is no such file")
    counts = Counts()
    messages = [frame.message for frame in frames_in(path, counts)]
    if not counts.frames[Kind.HEADER]:
        raise without_header(path)
    return messages, counts


def header_of_messages(messages: Iterable[Message]) -> Header:
    """Returns the HEADER among the messages of `messages_of`."""
    return next(m for m in messages if isinstance(m, Header))


def stuffed_of(path: Path) -> list[bytes]:
    """Returns the undecoded frames of a sound file that our own program has just written."""
    return path.read_bytes().split(DELIMITER)


def only(frames: Iterable[bytes], kind: Kind) -> Iterator[Message]:
    """Yields the messages of one kind among frames of `stuffed_of`."""
    return map(KINDS[kind].unpack, _payloads(frames, kind))


def rows_of(frames: Iterable[bytes], kind: Kind) -> NDArray[np.void]:
    """Returns the same as one array, whose columns are the fields; each is a single number."""
    row = row_type(schema.MESSAGES[kind.name].fields)
    return np.frombuffer(b"".join(_payloads(frames, kind)), row)


def _payloads(frames: Iterable[bytes], kind: Kind) -> Iterator[bytes]:
    """Yields payloads; other kinds are skipped undecoded, which takes a tenth of the time."""
    for stuffed in frames:
        if len(stuffed) > 1 and stuffed[1] == kind:  # stuffed[0] is COBS's: no kind is zero
            body = cobs.decode(stuffed)
            if body is not None:
                yield body[BODY_BYTES_MIN - 4 : -4]


def header_of(received: list[Received], path: Path) -> Header:
    """Returns the first HEADER; raises an error without one."""
    for frame in received:
        if isinstance(frame.message, Header):
            return frame.message
    raise without_header(path)


def without_header(path: Path) -> PelorusError:
    """Returns the error of a file without the one frame that all others need."""
    return PelorusError(f"{path}: holds no HEADER frame; without the calibration it is of no use")
