# SPDX-License-Identifier: MIT
"""Where an autopilot listens: a serial device, a TCP or UDP peer. It may vanish, and come back."""

from __future__ import annotations

import socket
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from pelorus.errors import PelorusError
from pelorus.robot import link
from pelorus.robot.emulator import BAUD
from pelorus.robot.link import LinkClosed, LinkStalled

FORMS = "serial:DEVICE[:BAUD], udp:HOST:PORT, udpin:HOST:PORT or tcp:HOST:PORT"
STALL_S = 0.05  # a port that takes nothing for so long loses the message: the next one is newer
AGAIN_NS = 1_000_000_000
READ_BYTES = 65536


class Wire(Protocol):
    """An open way to the autopilot."""

    def exchange(self, outgoing: bytes, wait_s: float, stall_s: float) -> bytes: ...

    def close(self) -> None: ...


class Udp:
    """Datagrams to a peer; with `listens` to who spoke last, as PX4's offboard link wants it."""

    def __init__(self, host: str, port: int, listens: bool) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._peer: tuple[str, int] | None = None if listens else (host, port)
        try:
            if listens:
                self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise

    def exchange(self, outgoing: bytes, wait_s: float, stall_s: float) -> bytes:  # noqa: ARG002
        """Sends it if there is a peer; returns what has come, waiting up to `wait_s` for it."""
        if outgoing and self._peer is not None:
            self._socket.settimeout(STALL_S)
            self._socket.sendto(outgoing, self._peer)
        self._socket.settimeout(wait_s)
        try:
            heard, self._peer = self._socket.recvfrom(READ_BYTES)
        except (TimeoutError, BlockingIOError, ConnectionRefusedError):
            return b""
        return heard

    def close(self) -> None:
        self._socket.close()


def opener(target: str) -> Callable[[], Wire]:
    """Returns what opens it; PelorusError where the words name no port."""
    scheme, _, rest = target.partition(":")
    host, _, number = rest.rpartition(":")
    there = bool(host) and number.isdecimal() and 0 < int(number) < 65536
    if scheme in ("udp", "udpin") and there:
        return lambda: Udp(host, int(number), scheme == "udpin")
    if scheme == "tcp" and there:
        return lambda: link.tcp(host, int(number))
    if scheme == "serial" and rest:
        device, baud = (host, int(number)) if host and number.isdecimal() else (rest, BAUD)
        return lambda: _serial(Path(device), baud)
    raise PelorusError(f"--mavlink {target!r}: no such port; it may be {FORMS}")


def _serial(device: Path, baud: int) -> Wire:
    from pelorus.robot.serial import open_serial  # noqa: PLC0415 - Windows has no termios

    return open_serial(device, baud)


class Port:
    """Keeps a wire open. `trouble` says what is wrong now, `lost` counts what was not sent."""

    def __init__(self, target: str, clock_ns: Callable[[], int]) -> None:
        self.target, self.trouble, self.lost = target, "", 0
        self._open, self._clock_ns = opener(target), clock_ns
        self._tried_ns = clock_ns()
        self._wire: Wire | None = self._open_now(first=True)

    def exchange(self, outgoing: bytes, wait_s: float) -> bytes:
        """Sends it, or loses it where the port is gone; returns what has come."""
        if self._wire is None and self._clock_ns() - self._tried_ns >= AGAIN_NS:
            self._tried_ns = self._clock_ns()
            self._wire = self._open_now()
        if self._wire is None:
            self.lost += bool(outgoing)
            return b""
        try:
            return self._wire.exchange(outgoing, wait_s, STALL_S)
        except LinkStalled:
            self.lost += 1
        except (LinkClosed, OSError) as error:
            self.lost += bool(outgoing)
            why = str(error).partition("; ")[0] if isinstance(error, LinkClosed) else f"{error}"
            self.trouble = f"{self.target}: {why}; it is tried again each second"
            self.close()
        return b""

    def close(self) -> None:
        if self._wire is not None:
            self._wire.close()
        self._wire = None

    def _open_now(self, first: bool = False) -> Wire | None:
        """At the start a port that is not there is an error: the user has misspelt it."""
        try:
            opened = self._open()
        except (PelorusError, OSError) as error:
            if first:
                raise PelorusError(f"--mavlink {self.target}: {error}") from error
            return None
        self.trouble = ""
        return opened
