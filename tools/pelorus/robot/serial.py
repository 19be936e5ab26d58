# SPDX-License-Identifier: MIT
"""A serial device as a link.

Only this file needs termios, which Windows does not have. It is imported when a serial device is
asked for, so that every other command works there.
"""

from __future__ import annotations

import os
import termios
import tty
from pathlib import Path

from pelorus.errors import PelorusError
from pelorus.robot.link import Link


def open_serial(device: Path, baud: int) -> Link:
    """Opens a serial device, raw: 8 data bits, no parity, 1 stop bit, no flow control."""
    speed = getattr(termios, f"B{baud}", None) if baud else None  # B0 would hang up
    if speed is None:
        raise PelorusError(f"{device}: this system knows no {baud} baud; the boards run at 921600")
    try:
        fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise PelorusError(
            f"{device}: cannot be opened: {error.strerror}; "
            "is it plugged in, and may you use it (group dialout)?"
        ) from error
    try:
        _set_raw(fd, speed)
        if termios.tcgetattr(fd)[4:6] != [speed, speed]:
            raise PelorusError(f"{device}: cannot do {baud} baud")
    except termios.error as error:
        os.close(fd)
        raise PelorusError(f"{device}: is no serial device: {error.args[-1]}") from error
    except PelorusError:
        os.close(fd)
        raise
    return Link(fd, str(device))


def _set_raw(fd: int, speed: int) -> None:
    tty.setraw(fd, termios.TCSANOW)  # does not wait for output that no one reads
    settings = termios.tcgetattr(fd)
    settings[2] |= termios.CLOCAL | termios.CREAD
    settings[2] &= ~(termios.CRTSCTS | termios.CSTOPB | termios.PARENB)
    settings[4] = settings[5] = speed
    termios.tcsetattr(fd, termios.TCSANOW, settings)
    termios.tcflush(fd, termios.TCIOFLUSH)
