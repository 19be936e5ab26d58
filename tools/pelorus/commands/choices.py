# SPDX-License-Identifier: MIT
"""Words that options take, and what they stand for."""

from __future__ import annotations

from enum import Enum

from pelorus.frames import TwistTiming


class Fix(str, Enum):
    """Whether a converter mends what it finds."""

    AUTO = "auto"
    NONE = "none"


class Timing(str, Enum):
    """The twist timings of HEADER by name."""

    START = "start"
    END = "end"
    MID = "mid"

    @property
    def value_in_header(self) -> TwistTiming:
        return TwistTiming[self.name]


class TimingOrAuto(str, Enum):
    """As Timing, or decided from the data."""

    AUTO = "auto"
    START = "start"
    END = "end"
    MID = "mid"

    @property
    def value_in_header(self) -> TwistTiming | None:
        return None if self is TimingOrAuto.AUTO else TwistTiming[self.name]
