# SPDX-License-Identifier: MIT
"""A named fault of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pelorus.faults.likelihood import with_ratio
from pelorus.math.se3 import Poses

UNTOLD = "untold"  # no fault, but not called good either


@dataclass(frozen=True)
class Fault:
    """A fault: `name` is for programs, `words` are for people; nothing was mended."""

    name: str
    words: str
    stops: bool = True  # settings tuned in spite of it would be worth nothing
    grave: bool = True  # it spoils the result; otherwise the filter copes
    ratio: float | None = None  # 2 ln of the likelihood ratio with and without it
    # that make up for what is off, or estimate it; `calibrate` is added to what is there
    settings: Mapping[str, str] = field(default_factory=dict)
    extrinsic: Poses | None = None  # T_CB with which the recording has no such fault

    @property
    def sentence(self) -> str:
        """Returns the words, with the likelihood ratio of the fault against none."""
        return with_ratio(self.words, self.ratio)

    @property
    def lasts(self) -> bool:
        """Returns whether the error lasts longer than a step; gaps, order, clocks do not count."""
        return self.name not in ("clock", UNTOLD) and not self.name.startswith("time-")
