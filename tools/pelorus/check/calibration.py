# SPDX-License-Identifier: MIT
"""What images and twists of a run together say of the camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot

from pelorus.check.mount import Turned, turned
from pelorus.check.scale import Doubt, bias_of, doubted
from pelorus.faults.agreement import NO_BIAS_MPS, Agreement, agreement
from pelorus.faults.handeye import first_part
from pelorus.faults.two_views import TwoViews
from pelorus.frames import Message
from pelorus.recording import Recording


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
    recording: Recording, views: TwoViews | None, messages: Sequence[Message]
) -> Calibration:
    """Of a run by twists; `views` of neighbouring frames of the recording's first part."""
    found = None if views is None else _agreed(recording, views, messages)
    if found is None:
        return Calibration()
    return Calibration(doubted(found, messages), turned(found, messages))


def _agreed(recording: Recording, views: TwoViews, messages: Sequence[Message]) -> Agreement | None:
    """With the run's biases."""
    short = first_part(recording)
    bias = max(bias_of(messages), NO_BIAS_MPS)
    noise = replace(short.header.noise, bias_velocity_sigma_mps=bias)
    found = agreement(short.with_header(noise=noise), views)
    return found if found.told else None
