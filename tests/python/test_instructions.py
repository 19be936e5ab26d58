# SPDX-License-Identifier: MIT
"""A frame takes as many instructions as tests/bench/instructions.json says."""

from __future__ import annotations

import json

import pytest
from instructions import CASES, MOST_CHANGE, TABLE, count, made_by, why_not
from replay_drive import BIN


@pytest.mark.parametrize("name", CASES)
def test_a_fixed_input_takes_the_instructions_of_the_table(name: str) -> None:
    build = BIN.parent
    if reason := why_not(build):
        pytest.skip(f"skipped: {reason}")
    table = json.loads(TABLE.read_text())
    if made_by(build) != table["made by"]:
        pytest.skip(f"skipped: the table is of {table['made by']}, the build of {made_by(build)}")
    expected, found = table["instructions"][name], count(build, name)
    assert abs(found - expected) <= MOST_CHANGE * expected, (
        f"{name}: {found:,} instructions, {found / expected - 1:+.1%} beside {expected:,}; "
        "if that is meant, run tests/python/instructions.py --write"
    )
