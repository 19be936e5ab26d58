# SPDX-License-Identifier: MIT
"""2 ln of the likelihood ratio of the data with a fault and without.

What is read off a file, and not estimated, has none: stamps that go back, pictures that repeat bit
for bit, twists that are all zero.
"""

from __future__ import annotations

import numpy as np


def of_estimate(x: float, given: float, other: float, sigma: float) -> float:
    """Returns the ratio of an estimate that is `given` without the fault, `other` with it."""
    return ((x - given) ** 2 - (x - other) ** 2) / (sigma**2 + 1e-12)


def of_share(share: float, count: float, usual: float) -> float:
    """Returns the ratio of a share of `count` independent events, `usual` at most without the
    fault.

    It is 0 if the share is no larger than that (Wilks 1938).
    """
    if not usual < share <= 1:
        return 0.0
    parts = ((share, usual), (1 - share, 1 - usual))
    return 2 * count * sum(p * float(np.log(p / expected)) for p, expected in parts if p > 0)


def with_ratio(words: str, ratio: float | None) -> str:
    """Returns the words, with the ratio where there is one."""
    return words if ratio is None else f"{words} (2 ln of the likelihood ratio: {ratio:.0f})"
