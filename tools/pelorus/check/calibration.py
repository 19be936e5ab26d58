# SPDX-License-Identifier: MIT
"""What images and twists of a run together say of the camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot

from pelorus.check.mount import Turned, turned
from pelorus.check.scale import Doubt, bias_of, doubted
from pelorus.faults.agreement import NO_BIAS_MPS, Agreement
from pelorus.frames import Message


@dataclass(frozen=True)
class Calibration:
    """None: too few frames tell, or the fault that they show stops all else."""

    scale: Doubt | None = None
    turn: Turned | None = None

    @property
    def settings(self) -> dict[str, str]:
        """By which the covariances contain what is off, where they do not."""
        return {
            name: value
            for part in (self.scale, self.turn)
            if part is not None
            for name, value in part.setting.items()
        }

    @property
    def share(self) -> float:
        """Of the way, by which positions may be off, if more than the filter says."""
        return hypot(*(part.beyond for part in (self.scale, self.turn) if part is not None))


def calibration(
    agreed: Callable[[float], Agreement | None], messages: Sequence[Message]
) -> Calibration:
    """Of a run by twists; `agreed` is what the recording tells beside a bias of so many m/s."""
    found = agreed(max(bias_of(messages), NO_BIAS_MPS))
    if found is None or not found.told:
        return Calibration()
    return Calibration(doubted(found, messages), turned(found, messages))
