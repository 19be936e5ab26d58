# SPDX-License-Identifier: MIT
"""A fault of a recording, by name."""

from __future__ import annotations

from dataclasses import dataclass

from pelorus.faults.likelihood import told

UNTOLD = "untold"  # no fault, but not called good either


@dataclass(frozen=True)
class Fault:
    """`name` is for programs, `words` for people; nothing was mended."""

    name: str
    words: str
    stops: bool = True  # settings tuned in spite of it would be worth nothing
    grave: bool = True  # it spoils the result; else the filter can live with it
    ratio: float | None = None  # 2 ln of its likelihood beside that of no fault

    @property
    def told(self) -> str:
        """The words, and how much likelier what is seen is with the fault than without."""
        return told(self.words, self.ratio)

    @property
    def lasts(self) -> bool:
        """Is it off alike for longer than a step? Not gaps and order; and a clock can be set."""
        return self.name not in ("clock", UNTOLD) and not self.name.startswith("time-")
