# SPDX-License-Identifier: MIT
"""Tracks in the pixels of cameras: of which resolution they are, and rectified."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pelorus.faults import resolution
from pelorus.io.foreign import ForeignFileError
from pelorus.io.tracks import Tracks
from pelorus.rig.rectification import Rectification
from pelorus.rig.rig import Rig


def of_pixels(rig: Rig, tracks: Tracks) -> Rig:
    """Returns the rig at the smallest of its resolutions that holds all pixels."""
    if not rig.others or not len(tracks):
        return rig
    most = tracks.pixels.max(axis=0).reshape(2, 2).max(axis=0)
    holding = [size for size in rig.sizes if (most < size).all()]
    if not holding:
        raise ForeignFileError(
            rig.path,
            f"pixels reach ({most[0]:.0f}, {most[1]:.0f}), beyond every resolution; the "
            "calibration of these pictures is needed",
        )
    return rig.of_size(*min(holding, key=np.prod))


def require_resolution(where: Path, tracks: Tracks, size: tuple[int, int]) -> None:
    """Raises ForeignFileError where pixels lie beyond pictures of this size."""
    words = resolution.beyond(tracks.pixels, size)
    if words:
        raise ForeignFileError(
            where, f"{words}; the calibration of these pictures, or pixels of those, are expected"
        )


def rectified(tracks: Tracks, rectification: Rectification, source: Path) -> Tracks:
    """Rectifies the cameras' pixels; leaves out those that no ray of the lens reaches."""
    pixels = rectification.pixels(tracks.pixels)
    good = np.isfinite(pixels).all(axis=1)
    if not good.any():
        raise ForeignFileError(
            source,
            "no pixel is one of the calibration's lenses; pixels as the cameras took them are "
            "expected, of the calibration's resolution",
        )
    return replace(tracks, pixels=pixels).at(np.nonzero(good)[0])
