# SPDX-License-Identifier: MIT
"""The result of one examination: the verdict, the numbers behind it, and what was done."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """The result of one examination."""

    subject: str  # what was examined
    found: bool  # whether it is faulty, as far as the data show
    evidence: str  # the numbers
    action: str  # what was done, or why nothing
    is_conclusive: bool = True  # whether there was enough to judge by
    measured: bool = False  # no fault: something was measured, and written
