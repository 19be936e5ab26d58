# SPDX-License-Identifier: MIT
"""Does it matter for a run's covariances what is wrong all along?"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pelorus.consistency import mean, nees_per_dof
from pelorus.frames import Message
from pelorus.layout import Floats
from pelorus.schema import DEFAULTS
from pelorus.se3 import Poses
from pelorus.trajectory import estimate_in

LARGEST = 0.1  # that baseline-sigma takes
ADDS = 0.5  # to a NEES of 1, a degree of freedom: less does not matter


ROUNDED = 0.9  # a setting of two digits stands for as much


def stands(given: float, amount: float, setting: str) -> bool:
    """Whether a setting, that is not the default, is there for so much."""
    return given > DEFAULTS[setting] and given >= ROUNDED * min(amount, LARGEST)


def added_nees(messages: Sequence[Message], off_by: Callable[[Poses], Floats]) -> float:
    """What it adds to the mean NEES of a run, a degree of freedom, if each pose is off by `off_by`:
    (n, 6), position and attitude in its own axes.
    """
    found = estimate_in(messages)
    if found is None:
        return 0.0
    estimate, P = found
    return mean(nees_per_dof(off_by(estimate.poses), P)) or 0.0
