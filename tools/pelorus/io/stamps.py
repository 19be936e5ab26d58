# SPDX-License-Identifier: MIT
"""Repairs stamps that a device's clock or driver spoilt.

A counter of 32 bits wraps to 0: its period is known, so its stamps are unwrapped. A driver that
empties a sensor's buffer gives all readings of a batch one stamp, that of the last one: the
readings are spread evenly over the time since the batch before.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from pelorus.math.motion import Times

BITS, UNITS_NS = (32, 24, 16), {"us": 1_000, "ms": 1_000_000, "ns": 1}
STEPS_MAX = 10.0  # ratio of the step across a wrap to the usual step
STEPS_LEAST = 1000  # usual steps in a period
PAUSE = 5.0  # ratio to the usual interval between batches: across a pause readings are not spread


class Unwrapped(NamedTuple):
    """Ascending times, and how often which counter wrapped."""

    t_ns: Times
    wraps: int = 0
    bits: int = 0
    unit: str = ""

    @property
    def words(self) -> str:
        times = "once" if self.wraps == 1 else f"{self.wraps} times"
        return f"its clock of {self.bits} bits of {self.unit} starts again at 0 {times}: unwrapped"


def unwrapped(t_ns: Times) -> Unwrapped:
    """Returns the times of a counter that wraps to 0, or the same times if none fits.

    Each step back must be the whole period less a usual step, which is a small part of the
    period: rows in no order of time are no counter.
    """
    steps = np.diff(t_ns)
    back, ahead = steps < 0, steps[steps > 0]
    if not back.any() or not len(ahead) or t_ns.min() < 0:
        return Unwrapped(t_ns)
    usual_ns = float(np.median(ahead))
    for (unit, unit_ns), bits in product(UNITS_NS.items(), BITS):
        period_ns = unit_ns << bits
        across = steps[back] + period_ns
        if usual_ns * STEPS_LEAST > period_ns:
            continue
        if t_ns.max() < period_ns and across.min() > 0 and across.max() <= STEPS_MAX * usual_ns:
            turns = np.concatenate(([0], np.cumsum(back)))
            return Unwrapped(t_ns + turns * period_ns, int(back.sum()), bits, unit)
    return Unwrapped(t_ns)


class Spread(NamedTuple):
    """Separate times, and the median number of readings in a batch."""

    t_ns: Times
    batch: int


def spread(t_ns: Times) -> Spread:
    """Returns times of their own for readings that share stamps in batches.

    Within a batch of n that follows the stamp before by T the k-th reading, from 1, is at
    stamp - T + k T / n. The first batch, and one behind a pause, take the usual interval.
    """
    stamps, first, count = np.unique(t_ns, return_index=True, return_counts=True)
    usual = int(np.median(count)) if len(count) else 0
    if len(stamps) < 2 or usual < 2:  # a duplicate stamp makes no batches
        return Spread(t_ns, usual)
    gaps = np.diff(stamps).astype(np.float64)
    usual_ns = float(np.median(gaps / count[1:]))  # of a reading
    since = np.concatenate(([np.inf], gaps))
    since = np.where(since > PAUSE * np.median(gaps), usual_ns * count, since)
    batch = np.repeat(np.arange(len(stamps)), count)
    k = np.arange(len(t_ns)) - first[batch] + 1
    early_ns = since[batch] * (1 - k / count[batch])
    return Spread(t_ns - np.round(early_ns).astype(np.int64), usual)
