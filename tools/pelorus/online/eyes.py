# SPDX-License-Identifier: MIT
"""The front end: a pair of pictures in, points with ids in both pictures out.

`Eyes` is all that the rest knows of it; `open_eyes` is the one line that says which is used.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.rig.rectification import Rectification
from pelorus.tracking.images import Gray
from pelorus.tracking.rectified import Evidence
from pelorus.tracking.settings import Settings
from pelorus.tracking.tracker import ADMITTED_AFTER, Tracker


class Seen(NamedTuple):
    """Points of a rectified pair: ids (n,), pixels (n, 4) of uL vL uR vR."""

    ids: NDArray[np.uint32]
    pixels: NDArray[np.float32]


class Eyes(Protocol):
    """Follows points from pair to pair."""

    def see(self, left: Gray, right: Gray) -> Seen:
        """Returns the points of the next pair, of pictures as the cameras took them."""


class OpenCvEyes:
    """The tracker of `pelorus track`, one pair at a time: a point is told from its third pair on.

    Raises PelorusError once the pictures show that they are those of no rectified pair: swapped,
    of another calibration, or not taken together.
    """

    def __init__(
        self, rectification: Rectification | None, settings: Settings | None = None
    ) -> None:
        self._rectification = rectification
        self._tracker = Tracker(settings or Settings())
        self._evidence = Evidence(self._tracker.settings)
        self._ages: dict[int, int] = {}

    def see(self, left: Gray, right: Gray) -> Seen:
        if self._rectification is not None:
            left, right = self._rectification.pictures(left, right)
        self._doubt(left, right)
        self._tracker.add(left, right)
        del self._tracker.frames[:-1]
        live = self._tracker.frames[-1]
        ids = live.id.tolist()
        self._ages = {id: self._ages.get(id, 0) + 1 for id in ids}
        old = np.array([self._ages[id] >= ADMITTED_AFTER for id in ids], bool)
        pixels = np.hstack((live.left, live.right))[old]
        return Seen((live.id[old] % 2**32).astype(np.uint32), pixels.astype(np.float32))

    def _doubt(self, left: Gray, right: Gray) -> None:
        self._evidence.add(left, right)
        if self._evidence.corners:
            self._evidence.require_rectified((Path("left"), Path("right")))


def open_eyes(rectification: Rectification | None) -> Eyes:
    """Returns the front end for pictures of this camera; None: they are rectified already."""
    return OpenCvEyes(rectification)


def require_size(left: Gray, right: Gray, width_px: int, height_px: int) -> None:
    """Raises PelorusError where pictures are not as large as the calibration says."""
    for name, picture in (("left", left), ("right", right)):
        rows, columns = picture.shape
        if width_px and (columns, rows) != (width_px, height_px):
            raise PelorusError(
                f"the {name} pictures have {columns} x {rows} pixels, the calibration is of "
                f"{width_px} x {height_px}: give the one of these pictures"
            )
