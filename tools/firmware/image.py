# SPDX-License-Identifier: MIT
"""Runs an image that measures on an emulated board, and reads what it writes.

Its lines are fields, `name number name number ...`: `size ...` first, one a measurement, and
`done stack N` at the end.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from pelorus.errors import PelorusError
from pelorus.robot.emulator import Emulator

HANG_S = 1800.0
# QEMU's SysTick rates where the part's clock tree is not modelled.
EMULATED_HZ = {"stm32f405": 168_000_000}
INSTRUCTIONS_PER_SECOND = 1_000_000_000  # -icount shift=0: one a nanosecond
DONE = re.compile(rb"done stack (\d+) \n")
REFUSED = re.compile(rb"^(?:error: (.*)|(refused .*))$", re.MULTILINE)


@dataclass(frozen=True)
class Measured:
    """What an image wrote: sizes in bytes, a dictionary for each line, stack in bytes."""

    sizes: dict[str, int]
    rows: list[dict[str, int]]
    stack_bytes: int
    instructions_per_clock: float


def measured(board: str, image: Path) -> Measured:
    """Runs the image with one instruction a nanosecond.

    Raises PelorusError if it falls silent, or refuses what it was given.
    """
    with Emulator(board, image, ("-icount", "shift=0")) as emulator:
        link = emulator.connect()
        text = b""
        while not (done := DONE.search(text)):
            piece = link.exchange(b"", HANG_S)
            if not piece:
                raise PelorusError(f"{image}: silent for {HANG_S:.0f} s. {emulator.trouble()}")
            text += piece
            if b"\n" in piece and (said := REFUSED.search(text[: text.rfind(b"\n")])):
                raise PelorusError(f"{image}: {(said[1] or said[2]).decode().strip()}")
        link.close()
    first, *lines, _ = text.decode().splitlines()
    sizes = _fields(first.removeprefix("size "))
    per_clock = INSTRUCTIONS_PER_SECOND / EMULATED_HZ.get(board, sizes["hz"])
    return Measured(sizes, [_fields(line) for line in lines], int(done[1]), per_clock)


def _fields(line: str) -> dict[str, int]:
    words = line.split()
    return {name: int(number) for name, number in zip(words[::2], words[1::2], strict=True)}
