# SPDX-License-Identifier: MIT
"""Opens what `--to` names: qemu:BOARD, tcp:HOST:PORT or serial:DEVICE[:BAUD]."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pelorus.errors import PelorusError
from pelorus.robot import link
from pelorus.robot.emulator import Emulator, image_of
from pelorus.robot.link import Link, LinkClosed

BAUD = 921600
LAST_WORDS_S = 2.0  # from an emulator's closing of its sockets to its end
FORMS = "qemu:BOARD, tcp:HOST:PORT or serial:DEVICE[:BAUD]"


@contextmanager
def open_target(target: str, image: Path | None) -> Iterator[Link]:
    """Connects to a target for the duration of the block; `image` is the emulator's firmware."""
    scheme, _, rest = target.partition(":")
    if scheme == "qemu" and rest:
        with Emulator(rest, image or image_of(rest)) as emulator:
            try:
                yield from _closing(emulator.connect())
            except LinkClosed as error:
                trouble = emulator.trouble(LAST_WORDS_S) or error
                raise LinkClosed(f"{target}: {trouble}") from error
        return
    if image is not None:
        raise PelorusError(f"{target}: --image is for qemu:BOARD alone")
    yield from _closing(_open(target, scheme, rest))


def _closing(opened: Link) -> Iterator[Link]:
    try:
        yield opened
    finally:
        opened.close()


def _open(target: str, scheme: str, rest: str) -> Link:
    if scheme == "tcp":
        host, _, port = rest.rpartition(":")
        if host and port.isdecimal() and 0 < int(port) < 65536:
            return link.tcp(host, int(port))
    if scheme == "serial" and rest:
        from pelorus.robot.serial import open_serial  # noqa: PLC0415 - Windows has no termios

        device, _, baud = rest.rpartition(":")
        if device and baud.isdecimal():
            return open_serial(Path(device), int(baud))
        return open_serial(Path(rest), BAUD)
    raise PelorusError(f"--to {target!r}: no such target; it may be {FORMS}")
