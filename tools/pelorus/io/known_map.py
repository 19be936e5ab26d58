# SPDX-License-Identifier: MIT
"""Landmarks of an earlier result as a map for another drive, as by `pelorus-replay --map-in`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pelorus.errors import PelorusError
from pelorus.wire.frames import UNKNOWN_VARIANCE, Landmark
from pelorus.wire.framing import messages_of
from pelorus.wire.layout import Floats, unpack_symmetric
from pelorus.wire.message import Role


def known_map(path: Path) -> tuple[Landmark, ...]:
    """Returns the landmarks of a log that holds results, else its known ones, by id; role KNOWN.

    Points of which it is not known where they are (a variance of 10^12 m^2) are left out.
    PelorusError where there is none, one stands twice, or a covariance is none.
    """
    every = [m for m in messages_of(path) if isinstance(m, Landmark)]
    made = [m for m in every if m.role != Role.KNOWN] or every
    found: dict[int, Landmark] = {}
    for m in made:
        P = unpack_symmetric(m.covariance[None], 3)[0]
        if np.trace(P) >= UNKNOWN_VARIANCE:
            continue
        if m.id in found:
            raise PelorusError(
                f"{path}: landmark {m.id} stands twice, and which one is right cannot be told: "
                "make the map with slots for all that come back"
            )
        if not (np.isfinite(m.p_W_m).all() and np.isfinite(P).all() and _is_covariance(P)):
            raise PelorusError(f"{path}: landmark {m.id}: its position or covariance is none")
        found[m.id] = replace(m, role=Role.KNOWN, t_ns=0)
    if not found:
        raise PelorusError(
            f"{path}: it has no landmark of known place; give a result of pelorus-replay --out"
        )
    return tuple(found[id] for id in sorted(found))


def _is_covariance(P: Floats) -> bool:
    """Returns whether it is positive semi-definite, but for rounding, and not zero."""
    return bool(np.trace(P) > 0 and np.linalg.eigvalsh(P)[0] >= -1e-9 * np.trace(P))
