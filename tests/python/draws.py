# SPDX-License-Identifier: MIT
"""How often a statistical test is drawn: once in a usual run, and as often as it says with
tools/test.sh --long (PELORUS_LONG=1).
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TypeVar

import pytest

LONG = os.environ.get("PELORUS_LONG", "0") == "1"
T = TypeVar("T")


def draws(of: Iterable[T]) -> list[T]:
    """Returns all of them in a long run, else the first."""
    every = list(of)
    return every if LONG else every[:1]


long_run = pytest.mark.skipif(not LONG, reason="takes minutes: tools/test.sh --long")
