# SPDX-License-Identifier: MIT
"""Tracks in pictures, as pelorus track makes them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pelorus.eyes.front_end import CORNERS, Eyes, Shown, track
from pelorus.io.tracks import Tracks
from pelorus.tracking.images import Gray

WHERE = Path("left"), Path("right")


def followed_in(
    pairs: Sequence[tuple[Gray, Gray]],
    corners: int = CORNERS,
    where: tuple[Path, Path] = WHERE,
) -> Tracks:
    """Returns the tracks of pairs that are 0.1 s apart."""
    height, width = pairs[0][0].shape
    timed = (Shown(100_000_000 * k, *pair) for k, pair in enumerate(pairs))
    return track(timed, Eyes(None, (width, height), corners=corners), where)
