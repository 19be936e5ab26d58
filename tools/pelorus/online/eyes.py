# SPDX-License-Identifier: MIT
"""The front end: a pair of pictures in, points with ids in both pictures out.

`Eyes` is all that the rest knows of it; `open_eyes` says which is used.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pelorus import tracker as own
from pelorus.errors import PelorusError
from pelorus.online.choice import Kind
from pelorus.rig.read import Calibrated
from pelorus.rig.rectification import Rectification
from pelorus.tracking.images import Gray
from pelorus.tracking.rectified import Evidence
from pelorus.tracking.settings import Settings
from pelorus.tracking.tracker import ADMITTED_AFTER, Tracker
from pelorus.wire.layout import Floats

FIRST_LOOK = 4  # a look takes 60 ms, and the first pairs wait while the rest is made ready
Motion = tuple[Floats, Floats]


class Seen(NamedTuple):
    """Points of a rectified pair: ids (n,), pixels (n, 4) of uL vL uR vR."""

    ids: NDArray[np.uint32]
    pixels: NDArray[np.float32]


class Eyes(Protocol):
    """Follows points from pair to pair.

    `see` raises PelorusError once the pictures show that they are those of no rectified pair:
    swapped, of another calibration, or not taken together.
    """

    def see(self, t_ns: int, left: Gray, right: Gray, motion: Motion | None) -> Seen:
        """Returns the points of the next pair, of pictures as the cameras took them; `motion` is
        how points are expected to have moved in the rectified camera, x_now = R x_then + p."""


class OwnEyes:
    """The library's tracker (pelorus/vision.h), which rectifies no picture."""

    def __init__(self, calibrated: Calibrated, rectification: Rectification | None) -> None:
        header, rig = calibrated.header, calibrated.rig
        camera, size = header.camera, (header.image_width_px, header.image_height_px)
        self._tracker = (
            own.Tracker.rectified(camera, *size) if rig is None else own.Tracker(rig, camera=camera)
        )
        most = self._tracker.pixels_max
        if size[0] * size[1] > most:
            raise PelorusError(f"pictures of {size[0]} x {size[1]} px have more than {most} pixels")
        self._rectification = rectification
        self._evidence = Evidence(Settings(), FIRST_LOOK)

    def see(self, t_ns: int, left: Gray, right: Gray, motion: Motion | None) -> Seen:
        if self._evidence.needs_next:
            pair = left, right
            if self._rectification is not None:
                pair = self._rectification.pictures(left, right)
            _doubt(self._evidence, *pair)
        else:
            self._evidence.skip()
        seen = self._tracker.track(t_ns, left, right, motion=motion)
        return Seen(seen.observations["id"].copy(), seen.pixels)


class OpenCvEyes:
    """The tracker of `pelorus track`, a point is told from its third pair on."""

    def __init__(self, rectification: Rectification | None) -> None:
        self._rectification = rectification
        self._tracker = Tracker(Settings())
        self._evidence = Evidence(self._tracker.settings)
        self._ages: dict[int, int] = {}

    def see(self, t_ns: int, left: Gray, right: Gray, motion: Motion | None) -> Seen:
        del t_ns, motion  # its search begins where a point was
        if self._rectification is not None:
            left, right = self._rectification.pictures(left, right)
        _doubt(self._evidence, left, right)
        self._tracker.add(left, right)
        del self._tracker.frames[:-1]
        live = self._tracker.frames[-1]
        ids = live.id.tolist()
        self._ages = {id: self._ages.get(id, 0) + 1 for id in ids}
        old = np.array([self._ages[id] >= ADMITTED_AFTER for id in ids], bool)
        pixels = np.hstack((live.left, live.right))[old]
        return Seen((live.id[old] % 2**32).astype(np.uint32), pixels.astype(np.float32))


def _doubt(evidence: Evidence, left: Gray, right: Gray) -> None:
    """Raises PelorusError where a rectified pair would show something else."""
    evidence.add(left, right)
    if evidence.corners:
        evidence.require_rectified((Path("left"), Path("right")))


def open_eyes(calibrated: Calibrated, kind: Kind) -> tuple[Eyes, str]:
    """Returns the front end for pictures of this camera, and "". OpenCV's takes a lens or a size
    that own eyes cannot take: then the words say why."""
    rig = calibrated.rig
    rectification = None if rig is None else rig.rectification()
    why = ""
    if kind == "own":
        try:
            return OwnEyes(calibrated, rectification), ""
        except PelorusError as error:
            why = str(error)
    return OpenCvEyes(rectification), why


def require_size(left: Gray, right: Gray, width_px: int, height_px: int) -> None:
    """Raises PelorusError where pictures are not as large as the calibration says."""
    for name, picture in (("left", left), ("right", right)):
        rows, columns = picture.shape
        if width_px and (columns, rows) != (width_px, height_px):
            raise PelorusError(
                f"the {name} pictures have {columns} x {rows} pixels, the calibration is of "
                f"{width_px} x {height_px}: give the one of these pictures"
            )
