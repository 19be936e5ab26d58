# SPDX-License-Identifier: MIT
"""Why a filter is not good: the bits of plr_reason, with the header's names."""

from __future__ import annotations

from enum import IntFlag

from pelorus.wire import schema


class Reason(IntFlag):
    """Flags of a report or of a health; unknown bits of a later version are kept."""

    FEW_OBSERVATIONS = 1 << 0
    NO_OBSERVATIONS = 1 << 1
    GATE_LOCKED = 1 << 2
    GATE_INERT = 1 << 3
    BLOCK_FAILED = 1 << 4
    SINK_FAILED = 1 << 5
    NO_ROOM = 1 << 6
    REFUSED_INPUT = 1 << 7
    NIS_HIGH = 1 << 8
    RANGE_LIMITED = 1 << 9
    NOT_POSITIVE = 1 << 10
    BUDGET = 1 << 11
    TWIST_CONTRADICTED = 1 << 12
    POSE_MAY_BE_WRONG = 1 << 13
    BIAS_OFF_PRIOR = 1 << 14
    NIS_LOW = 1 << 15
    FROZEN_IMAGE = 1 << 16
    RECOVERED = 1 << 18
    NO_FRAMES = 1 << 19
    STATE_DAMAGED = 1 << 20
    NO_TWISTS = 1 << 21
    READINGS_REJECTED = 1 << 22
    NOT_STARTED = 1 << 23
    IMU_FAULT = 1 << 24
    RELOCATED = 1 << 25
    MAP_DISAGREES = 1 << 26
    NOISE_MISFIT = 1 << 27
    CALIBRATION_OFF = 1 << 28

    def __str__(self) -> str:
        """Returns `FROZEN_IMAGE|NO_TWISTS`; `none` without flags."""
        return self.name or "none"

    @property
    def words(self) -> tuple[str, ...]:
        """Returns the meaning of each; include/pelorus/types.h has causes and remedies."""
        return tuple(schema.REASONS[reason.value] for reason in self)
