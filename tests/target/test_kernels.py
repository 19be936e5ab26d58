# SPDX-License-Identifier: MIT
"""The kernels as they were built for the board, against their plain twins (main_kernels.c)."""

from __future__ import annotations

import re
from pathlib import Path

from pelorus.robot.emulator import Emulator

HANG_S = 1800.0


def test_kernels_have_the_bits_of_their_plain_twins(board: str, robot: Path) -> None:
    text = b""
    with Emulator(board, robot / "images" / f"kernels-{board}.elf") as emulator:
        link = emulator.connect()
        while not text.endswith(b"\n"):
            piece = link.exchange(b"", HANG_S)
            assert piece, f"silent after {text!r}: {emulator.trouble()}"
            text += piece
        link.close()
    said = re.fullmatch(rb"compared (\d+) different (\d+)\n", text)
    assert said, f"{text!r}"
    assert int(said[1]) > 8000
    assert int(said[2]) == 0
