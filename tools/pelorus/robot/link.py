# SPDX-License-Identifier: MIT
"""Byte streams to a board: a TCP connection, a serial device, an emulator's socket.

`Link.exchange` is the only way to send, and it reads while it sends. That is half of the rule that
keeps both sides from waiting for each other; docs/PORTING.md, "Flow control", has the other half.
"""

from __future__ import annotations

import os
import select
import socket
import termios
import time
import tty
from pathlib import Path

from pelorus.errors import PelorusError

READ_BYTES = 65536
WRITE_BYTES = 4096
CONNECT_S = 10.0


class LinkClosed(PelorusError):
    """The other side is gone."""


class Link:
    """An open file descriptor that takes and gives bytes without blocking."""

    def __init__(self, fd: int, what: str) -> None:
        self._fd = fd
        self.what = what
        os.set_blocking(fd, False)

    def exchange(self, outgoing: bytes, wait_s: float = 0.0) -> bytes:
        """Send everything, and return what came meanwhile.

        With nothing (left) to send, wait up to `wait_s` for the first bytes to come.
        """
        deadline = time.monotonic() + wait_s
        incoming = bytearray()
        left = memoryview(outgoing)
        while True:
            patience = None if left else max(0.0, deadline - time.monotonic())
            readable, writable, _ = select.select(
                [self._fd], [self._fd] if left else [], [], patience
            )
            if readable:
                incoming += self._read()
            if writable:
                left = left[self._write(left[:WRITE_BYTES]) :]
            if not left and (incoming or time.monotonic() >= deadline):
                return bytes(incoming)

    def close(self) -> None:
        os.close(self._fd)

    def _read(self) -> bytes:
        try:
            piece = os.read(self._fd, READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkClosed(f"{self.what}: {error.strerror}") from error
        if not piece:
            raise LinkClosed(f"{self.what}: the other side closed the connection")
        return piece

    def _write(self, piece: memoryview) -> int:
        try:
            return os.write(self._fd, piece)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise LinkClosed(f"{self.what}: {error.strerror}") from error


def _socket_link(family: int, address: tuple[str, int] | str, what: str) -> Link:
    """Connect; the other side may need a moment until it listens."""
    deadline = time.monotonic() + CONNECT_S
    while True:
        connection = socket.socket(family, socket.SOCK_STREAM)
        try:
            connection.connect(address)
        except OSError as error:
            connection.close()
            if time.monotonic() > deadline:
                raise PelorusError(f"{what}: cannot be reached: {error.strerror}") from error
            time.sleep(0.05)
        else:
            return Link(connection.detach(), what)


def tcp(host: str, port: int) -> Link:
    """A TCP connection, for example to an emulator's or a terminal server's serial port."""
    return _socket_link(socket.AF_INET, (host, port), f"{host}:{port}")


def unix(path: Path) -> Link:
    """A local socket."""
    return _socket_link(socket.AF_UNIX, str(path), str(path))


def serial(device: Path, baud: int) -> Link:
    """A serial device, raw: 8 data bits, no parity, 1 stop bit, no flow control of its own."""
    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise PelorusError(f"{device}: this system knows no {baud} baud; the boards run at 921600")
    try:
        fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(fd)
        settings = termios.tcgetattr(fd)
        settings[2] |= termios.CLOCAL | termios.CREAD
        settings[2] &= ~(termios.CRTSCTS | termios.CSTOPB | termios.PARENB)
        settings[4] = settings[5] = speed
        termios.tcsetattr(fd, termios.TCSANOW, settings)
        termios.tcflush(fd, termios.TCIOFLUSH)
    except OSError as error:
        raise PelorusError(f"{device}: cannot be opened: {error.strerror}") from error
    except termios.error as error:
        raise PelorusError(f"{device}: is no serial device: {error.args[-1]}") from error
    return Link(fd, str(device))
