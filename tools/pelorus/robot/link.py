# SPDX-License-Identifier: MIT
"""Byte streams to a board: a TCP connection, a serial device, an emulator's socket.

`Link.exchange` is the only way to send, and it reads while it sends. That is half of the rule that
keeps both sides from waiting for each other; docs/PORTING.md, "Flow control", has the other half.
"""

from __future__ import annotations

import os
import select
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from pelorus.errors import PelorusError

READ_BYTES = 65536
WRITE_BYTES = 4096
CONNECT_S = 10.0
CONNECT_AGAIN_S = 0.05
STALL_S = 1800.0  # default limit of a caller, against hangs


class LinkClosed(PelorusError):
    """The other side has closed the link."""


class LinkStalled(PelorusError):
    """The other side is connected, but takes no bytes."""


class Link:
    """An open file descriptor that is read and written without blocking."""

    def __init__(self, fd: int, what: str) -> None:
        self._fd = fd
        self.what = what
        os.set_blocking(fd, False)

    def exchange(self, outgoing: bytes, wait_s: float = 0.0, stall_s: float = STALL_S) -> bytes:
        """Sends everything, and returns all bytes that came meanwhile (`pieces`).

        What came before the link closed is still returned; the next call raises LinkClosed.
        """
        incoming = bytearray()
        try:
            for piece in self.pieces(outgoing, wait_s, stall_s):
                incoming += piece
        except LinkClosed:
            if not incoming:
                raise
        return bytes(incoming)

    def pieces(self, outgoing: bytes, wait_s: float, stall_s: float) -> Iterator[bytes]:
        """Sends everything, and yields what comes meanwhile, piece by piece.

        With nothing (left) to send, waits up to `wait_s` for the first bytes to come. Raises
        LinkStalled where the other side takes no byte for `stall_s`, whatever it sends meanwhile.
        """
        deadline = time.monotonic() + wait_s
        left = memoryview(outgoing)
        took_at, came = time.monotonic(), False
        while True:
            patience_s = stall_s if left else max(0.0, deadline - time.monotonic())
            readable, writable, _ = select.select(
                [self._fd], [self._fd] if left else [], [], patience_s
            )
            if readable and (piece := self._read()):
                came = True
                yield piece
            if writable:
                left = left[self._write(left[:WRITE_BYTES]) :]
                took_at = time.monotonic()
            now = time.monotonic()
            if not left and (came or now >= deadline):
                return
            if left and not writable and now - took_at >= stall_s:
                raise LinkStalled(
                    f"{self.what}: takes no bytes any more, for {stall_s:g} s; "
                    "is the board running the firmware, at this baud rate?"
                )

    def close(self) -> None:
        os.close(self._fd)

    def _read(self) -> bytes:
        try:
            piece = os.read(self._fd, READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._closed(str(error.strerror)) from error
        if not piece:
            raise self._closed("the other side ended it")
        return piece

    def _write(self, piece: memoryview) -> int:
        try:
            return os.write(self._fd, piece)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise self._closed(str(error.strerror)) from error

    def _closed(self, why: str) -> LinkClosed:
        return LinkClosed(
            f"{self.what}: the connection is lost: {why}; "
            "is the board still powered and connected, its emulator or terminal server running?"
        )


def _reached(connect: Callable[[], socket.socket], what: str) -> Link:
    """Connects; repeats it until the other side listens."""
    deadline = time.monotonic() + CONNECT_S
    while True:
        try:
            return Link(connect().detach(), what)
        except socket.gaierror as error:
            raise PelorusError(f"{what}: no such host: {error.strerror}") from error
        except UnicodeError as error:
            raise PelorusError(f"{what}: this is no name of a host") from error
        except OSError as error:
            if time.monotonic() > deadline:
                raise PelorusError(
                    f"{what}: cannot be reached: {error.strerror or error}; "
                    "does something listen on this port?"
                ) from error
            time.sleep(CONNECT_AGAIN_S)


def tcp(host: str, port: int) -> Link:
    """Connects by TCP, for example to an emulator's or a terminal server's serial port."""

    def connect() -> socket.socket:
        connection = socket.create_connection((host, port), timeout=CONNECT_S)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # twists are not delayed
        return connection

    return _reached(connect, f"{host}:{port}")


def unix(path: Path) -> Link:
    """Connects to a local socket."""

    def connect() -> socket.socket:
        connection = socket.socket(socket.AF_UNIX)
        try:
            connection.connect(str(path))
        except OSError:
            connection.close()
            raise
        return connection

    return _reached(connect, str(path))
