# SPDX-License-Identifier: MIT
"""Recordings on disk: plain (.plr), or packed by zstd (.plr.zst).

When reading, the first bytes decide; when writing, the name. The frames inside are the same:
`zstdcat FILE.plr.zst` gives the plain recording.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, cast

from pelorus.errors import PelorusError

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

SUFFIX = ".zst"
MAGIC = b"\x28\xb5\x2f\xfd"  # of a zstd frame (RFC 8878, 3.1.1)
LEVEL, LIVE_LEVEL = 19, 3  # level of a finished recording, and of a log, for which a robot waits
LIVE_BYTES = 1 << 15  # after so many a live log's block is closed, and outlives a crash


class PackingDamaged(PelorusError):
    """Nothing after this place can be unpacked."""


def is_packed(path: Path) -> bool:
    """Returns whether the name asks for zstd."""
    return path.suffix == SUFFIX


def bare_name(path: Path) -> str:
    """Returns the file's name without .plr, .plr.zst."""
    return (path.with_suffix("") if is_packed(path) else path).stem


def pieces(path: Path, piece_bytes: int = 1 << 16) -> Iterator[bytes]:
    """Yields the recording's bytes, unpacked if need be.

    Raises OSError where the disk fails, and PackingDamaged after the last bytes that could be
    unpacked.
    """
    with path.open("rb") as stream:
        if stream.peek(len(MAGIC))[: len(MAGIC)] == MAGIC:
            yield from _unpacked(cast(BinaryIO, stream), piece_bytes)
            return
        while piece := stream.read(piece_bytes):
            yield piece


def _unpacked(stream: BinaryIO, piece_bytes: int) -> Iterator[bytes]:
    """Yields the content of all packed frames in order, and what there is of an incomplete last
    one.

    zstd's own file object gives nothing of the last piece of a file that was cut.
    """
    unpacker = zstd.ZstdDecompressor()
    while True:
        packed = b""
        if unpacker.eof:
            packed = unpacker.unused_data
            unpacker = zstd.ZstdDecompressor()
        if unpacker.needs_input and not packed and not (packed := stream.read(piece_bytes)):
            return
        try:
            piece = unpacker.decompress(packed, piece_bytes)
        except zstd.ZstdError as error:
            raise PackingDamaged(f"the zstd packing is damaged here: {error}") from error
        if piece:
            yield piece


def create(path: Path, packed: bool, live: bool = False) -> BinaryIO:
    """Opens a file to write a recording to; raises OSError where that fails.

    `live`: if the program is killed, all that was written but the last LIVE_BYTES stays readable;
    in a plain file, all of it.
    """
    stream = path.open("wb")
    return cast(BinaryIO, _Packer(stream, live)) if packed else stream


class _Packer:
    """Packs its input; has as much of a file's interface as a recording's writers need."""

    def __init__(self, stream: BinaryIO, live: bool) -> None:
        level = LIVE_LEVEL if live else LEVEL
        parameter = zstd.CompressionParameter
        self._packer = zstd.ZstdCompressor(
            options={parameter.compression_level: level, parameter.checksum_flag: 1}
        )
        self._stream = stream
        self._live = live
        self._held = 0
        self.name = stream.name

    def write(self, data: bytes) -> int:
        self._stream.write(self._packer.compress(data))
        self._held += len(data)
        return len(data)

    def flush(self) -> None:
        """Closes a block where it is large enough: a block for each message would pack badly."""
        if self._live and self._held >= LIVE_BYTES:
            self._stream.write(self._packer.flush(self._packer.FLUSH_BLOCK))
            self._held = 0
        self._stream.flush()

    def close(self) -> None:
        try:
            if not self._stream.closed:
                self._stream.write(self._packer.flush())
        finally:
            self._stream.close()


def for_program(path: Path) -> tuple[str, bytes | None]:
    """Returns a recording as an argument of pelorus-replay, and what to feed to its standard input.

    A packed one is unpacked here: the program need not know zstd.
    """
    try:
        with path.open("rb") as stream:
            if stream.read(len(MAGIC)) == MAGIC:
                return "-", b"".join(pieces(path))
    except OSError:
        pass  # the program opens it next, and reports the error
    except PackingDamaged as error:
        raise PelorusError(f"{path}: {error}") from error
    return str(path), None
