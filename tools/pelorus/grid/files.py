# SPDX-License-Identifier: MIT
"""Writes a grid as the two files that nav2's map_server reads: an image and a YAML text.

The image's first row is the map's upper edge, while the origin is the lower left corner. Without
`negate` a pixel of brightness b says that the cell is occupied with probability (255 - b) / 255; in
the mode `trinary` a cell is occupied above occupied_thresh, free below free_thresh, else unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import whole, writing
from pelorus.grid.occupancy import Band, Grid

OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.25
WHITE = 255
UNKNOWN, FREE, OCCUPIED = -1, 0, 100
IMAGE, TEXT, PICTURE = "map.pgm", "map.yaml", "map.png"


def brightness(grid: Grid) -> NDArray[np.uint8]:
    """Returns the brightness (height, width), row 0 the lowest."""
    return np.round(WHITE * (1 - grid.probability)).astype(np.uint8)


def cells(grid: Grid) -> NDArray[np.int8]:
    """Returns the cells by a reader of the files: OCCUPIED, FREE or UNKNOWN; row 0 the lowest."""
    occupied = (WHITE - brightness(grid).astype(float)) / WHITE
    out = np.full(occupied.shape, UNKNOWN, np.int8)
    out[occupied > OCCUPIED_THRESH] = OCCUPIED
    out[occupied < FREE_THRESH] = FREE
    return out


def image(grid: Grid) -> bytes:
    """Returns a binary PGM (netpbm's P5)."""
    pixels = brightness(grid)[::-1]
    height, width = pixels.shape
    return f"P5\n{width} {height}\n{WHITE}\n".encode("ascii") + pixels.tobytes()


def text(grid: Grid) -> str:
    """Returns the YAML text."""
    x, y = grid.origin_m
    right, up = (axis.name for axis in grid.plane[:2])
    return (
        f"# x of the map is {right} of the world, y is {up}; {heights(grid.band)}\n"
        f"image: {IMAGE}\n"
        "mode: trinary\n"
        f"resolution: {grid.resolution_m:g}\n"
        f"origin: [{x:.6f}, {y:.6f}, 0.0]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH}\n"
        f"free_thresh: {FREE_THRESH}\n"
    )


def heights(band: Band) -> str:
    """Returns the band in words."""
    if np.isinf(band.low_m) and np.isinf(band.high_m):
        return "all heights"
    return f"heights from {band.low_m:g} to {band.high_m:g} m about the body"


def write(folder: Path, grid: Grid, draw: Callable[[Path], None] | None) -> None:
    """Writes all files, or none. `draw` makes the PNG at a path; with None there is no PNG."""
    makers: dict[str, Callable[[Path], object]] = {
        IMAGE: lambda path: path.write_bytes(image(grid)),
        **({PICTURE: draw} if draw else {}),
        # names the image, so it comes last
        TEXT: lambda path: path.write_text(text(grid), encoding="ascii"),
    }
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        with whole(*(folder / name for name in makers)) as parts:
            for make, part in zip(makers.values(), parts, strict=True):
                make(part)
