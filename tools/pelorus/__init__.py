# SPDX-License-Identifier: MIT
"""Pelorus: the filter from Python (`pelorus.Filter`), and tools that convert, inspect, simulate and
evaluate recordings.
"""

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"
ARITHMETIC = 25  # PLR_ARITHMETIC of the library that these tools belong to

__all__ = [
    "NOT_SEEN_PX",
    "Calibration",
    "Filter",
    "FilterError",
    "KnownLandmark",
    "PelorusError",
    "Reason",
    "Tracker",
    "observations",
]

if TYPE_CHECKING:
    from pelorus.errors import PelorusError
    from pelorus.filter import (
        NOT_SEEN_PX,
        Calibration,
        Filter,
        FilterError,
        KnownLandmark,
        Reason,
        observations,
    )
    from pelorus.tracker import Tracker


def __getattr__(name: str) -> Any:
    """Imports a name of `__all__` at its first use: most commands need no filter, nor numpy."""
    if name not in __all__:
        raise AttributeError(f"module 'pelorus' has no attribute {name!r}")
    if name == "Tracker":
        from pelorus.tracker import Tracker  # noqa: PLC0415

        return Tracker
    from pelorus import filter as found  # noqa: PLC0415

    return getattr(found, name)
