# SPDX-License-Identifier: MIT
"""Tells whether a constant error matters for a run's covariances."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pelorus.io.trajectory import estimate_in
from pelorus.math.consistency import mean, nees_per_dof
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Message
from pelorus.wire.layout import Floats
from pelorus.wire.schema import DEFAULTS

LARGEST = 0.1  # largest baseline-sigma that the filter takes
ADDS = 0.5  # NEES per degree of freedom: a smaller increase does not matter


ROUNDED = 0.9  # ratio that is rounding, for a setting has two digits


def stands(given: float, amount: float, setting: str) -> bool:
    """Returns whether a setting other than the default already covers this amount."""
    return given > DEFAULTS[setting] and given >= ROUNDED * min(amount, LARGEST)


def added_nees(messages: Sequence[Message], off_by: Callable[[Poses], Floats]) -> float:
    """Returns the increase of a run's mean NEES per degree of freedom if each pose is off by
    `off_by`.

    `off_by` returns (n, 6), position and attitude in the poses' own axes.
    """
    found = estimate_in(messages)
    if found is None:
        return 0.0
    estimate, P = found
    return mean(nees_per_dof(off_by(estimate.poses), P)) or 0.0
