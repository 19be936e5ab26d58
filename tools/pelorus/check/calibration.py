# SPDX-License-Identifier: MIT
"""What the images and twists of a run show of the camera's calibration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot

from pelorus.check.mount import Turned, turned
from pelorus.check.scale import Doubt, bias_of, doubted
from pelorus.faults.agreement import NO_BIAS_MPS, Agreement
from pelorus.wire.frames import Message


@dataclass(frozen=True)
class CalibrationDoubts:
    """Doubts about scale and mounting. None: too few frames, or a fault must be mended first."""

    scale: Doubt | None = None
    turn: Turned | None = None

    @property
    def settings(self) -> dict[str, str]:
        """Returns the settings with which the covariances cover the errors, if they do not."""
        return {
            name: value
            for part in (self.scale, self.turn)
            if part is not None
            for name, value in part.setting.items()
        }

    @property
    def share(self) -> float:
        """Returns the position error as a share of the way, if it is more than the filter says."""
        return hypot(*(part.beyond for part in (self.scale, self.turn) if part is not None))


def calibration(
    agreed: Callable[[float], Agreement | None], messages: Sequence[Message]
) -> CalibrationDoubts:
    """Returns what a run by twists shows of the calibration.

    `agreed` returns how far images and twists agree beside a velocity bias of a given sigma, m/s.
    """
    found = agreed(max(bias_of(messages), NO_BIAS_MPS))
    if found is None or not found.is_known:
        return CalibrationDoubts()
    return CalibrationDoubts(doubted(found, messages), turned(found, messages))
