# SPDX-License-Identifier: MIT
"""Every image's stack holds the deepest chain of calls that there can be."""

from __future__ import annotations

from pathlib import Path

import pytest
from firmware.sizes import objects_of
from firmware.stack import image_bound
from gdb_stub import symbol

FLOAT64_BOARD = "mps2_an500"


def demand_room(board: str, robot: Path, image_name: str, bits: int) -> None:
    image = robot / "images" / f"{image_name}.elf"
    deepest = image_bound(image, objects_of(image, board, 32, bits))
    there = symbol(image, "_stack_top") - symbol(image, "_stack_bottom")
    assert deepest.stack_bytes <= there, " -> ".join(deepest.path)


def test_the_stack_holds_the_deepest_chain_of_calls(board: str, robot: Path) -> None:
    demand_room(board, robot, f"pelorus-{board}-n32", 32)


@pytest.mark.boards(FLOAT64_BOARD)
def test_the_stack_holds_the_deepest_chain_of_calls_in_float64(board: str, robot: Path) -> None:
    demand_room(board, robot, f"pelorus-{board}-n32-f64", 64)
