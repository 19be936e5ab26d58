# SPDX-License-Identifier: MIT
"""From pictures to a pose on a board: the desk's bits, within the bars of docs/EYES.md."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from firmware import eyes

# Million instructions of eyes, a pair, in the mean of those behind the first. The aim for 320 x 240
# pixels is 9, and half of what the M7 takes with a Cortex-M55's vectors.
MOST = {"stm32f405": 4.0, "mps2_an500": 9.0, "mps3_an547": 4.1}


@pytest.mark.boards(*MOST)
def test_pictures_give_the_desks_bits_within_the_instructions_of_the_page(
    board: str, robot: Path, program: Path
) -> None:
    image = robot / "images" / f"eyes-replay-{board}.elf"
    found = eyes.on_board(board, image)
    assert found.pairs == eyes.at_desk(program, robot / "pictures" / f"{board}.plr")
    assert len(found.pairs) == 12
    assert sum(found.look[1:]) / len(found.look[1:]) <= 1e6 * MOST[board]


@pytest.mark.boards("stm32f405")
def test_firmware_with_eyes_and_a_pair_of_pictures_fits_the_real_board(
    board: str, robot: Path
) -> None:
    told = (robot / "images" / f"eyes-{board}.map").read_text(encoding="utf-8")
    places = dict(re.findall(r"^ ?\.bss\.(pictures|eyes|session)\s+0x0*([0-9a-f]+)", told, re.M))
    assert 0x20000000 <= int(places["pictures"], 16) < 0x20020000, "a DMA must reach them"
    assert 0x10000000 <= int(places["eyes"], 16) < 0x10010000
