# SPDX-License-Identifier: MIT
"""What a detector says: the verdict, the numbers behind it, and what was done."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One examination."""

    subject: str  # what was examined
    found: bool  # whether it is faulty, as far as the data can tell
    evidence: str  # the numbers
    action: str  # what was done, or why nothing
    told: bool = True  # whether there was enough to judge by
    measured: bool = False  # no fault: something was measured, and written
