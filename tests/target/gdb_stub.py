# SPDX-License-Identifier: MIT
"""A debugger's hand on an emulated board's memory: so much of GDB's remote protocol as it takes.

The board stands still while a stub is connected.
"""

from __future__ import annotations

import socket
import subprocess
from pathlib import Path

TIMEOUT_S = 1800.0  # against hangs
STOPPED = "T"


def symbol(image: Path, name: str) -> int:
    """The address of a variable."""
    command = ["arm-none-eabi-nm", str(image)]
    rows = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    (address,) = [row.split()[0] for row in rows if row.split()[-1] == name]
    return int(address, 16)


class GdbStub:
    """A connection to QEMU's `-gdb unix:PATH`; a context manager that lets the board run again."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(TIMEOUT_S)
        self._socket.connect(str(path))
        self._stream = self._socket.makefile("rwb", buffering=0)

    def __enter__(self) -> GdbStub:
        assert self._ask("?").startswith(STOPPED), "the board does not stop"
        return self

    def __exit__(self, *_: object) -> None:
        self._ask("D")
        self._socket.close()

    def write(self, address: int, content: bytes) -> None:
        answer = self._ask(f"M{address:x},{len(content):x}:{content.hex()}")
        assert answer == "OK", answer

    def read(self, address: int, count: int) -> bytes:
        return bytes.fromhex(self._ask(f"m{address:x},{count:x}"))

    def _ask(self, command: str) -> str:
        checksum = sum(command.encode()) % 256
        self._stream.write(f"${command}#{checksum:02x}".encode())
        answer = self._answer()
        while command != "?" and answer.startswith(STOPPED):  # told unasked, too
            answer = self._answer()
        return answer

    def _answer(self) -> str:
        while self._next() != b"$":
            pass  # acknowledgements
        answer = b""
        while (byte := self._next()) != b"#":
            answer += byte
        self._next()
        self._next()
        self._stream.write(b"+")
        return answer.decode()

    def _next(self) -> bytes:
        byte = self._stream.read(1)
        assert byte, "the stub has gone"
        return bytes(byte)
