# SPDX-License-Identifier: MIT
"""Every image's stack holds the deepest chain of calls that there can be."""

from __future__ import annotations

from pathlib import Path

import pytest
from gdb_stub import symbol
from pelorus.robot.sizes import PROCESSORS
from pelorus.robot.stack import image_bound

FLOAT64_BOARD = "mps2_an500"


@pytest.mark.parametrize("bits", [32, 64])
def test_the_stack_holds_the_deepest_chain_of_calls(board: str, robot: Path, bits: int) -> None:
    if bits == 64 and board != FLOAT64_BOARD:
        pytest.skip("an image in float64 is made for the M7 alone: it has the FPU for it")
    image = robot / "images" / f"pelorus-{board}-n32{'-f64' if bits == 64 else ''}.elf"
    library = f"pelorus-{PROCESSORS[board]}-n32-f{bits}.dir"
    folders = [robot / "CMakeFiles" / library, robot / "CMakeFiles" / f"{image.stem}.dir"]
    deepest = image_bound(image, folders)
    there = symbol(image, "_stack_top") - symbol(image, "_stack_bottom")
    assert deepest.stack_bytes <= there, " -> ".join(deepest.path)
