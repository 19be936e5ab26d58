# SPDX-License-Identifier: MIT
"""Detects pixels of another resolution than the calibration's.

Pixels outside the picture show it if their centre is that of a larger picture, too: moving points
and swapped columns also leave it. Where pixels fill only a part, it is compared with the picture
about the principal point: for another resolution both sides must be off by the same factor, and by
one that a camera's modes or a resized picture have.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pelorus.faults.fault import Fault
from pelorus.io.recording import Recording
from pelorus.wire.layout import Floats

ROWS_LEAST = 1000
BEYOND_PX, BEYOND_SHARE = 5.0, 0.01  # a tracker may predict a little outside
ENDS = (0.002, 0.998)  # quantiles of the pixels, without wild ones
FACTORS = (1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 2, 2.0, 3.0, 4.0)
# logarithms: distance to a factor, and of one side's factor to the other's
NEAR, ALIKE = 0.12, 0.12
BEGINS = 0.1  # share of the side within which the pixels must begin
# Between the middle of this picture and that of the next larger one (3/2).
MIDDLE_LEAST = (1 / 2 + 3 / 4) / 2


def beyond(pixels: Floats, size: tuple[int, int]) -> str:
    """Returns what is wrong with pixels (n, 4) in a picture of that size; empty if nothing."""
    if not size[0] or not len(pixels):
        return ""
    outside = (pixels.reshape(-1, 2, 2) > np.array(size) + BEYOND_PX).any(axis=(1, 2))
    middle = np.median(pixels.reshape(-1, 2), axis=0) / size
    if outside.mean() <= BEYOND_SHARE or (middle < MIDDLE_LEAST).any():
        return ""
    most = np.quantile(pixels.reshape(-1, 2), ENDS[1], axis=0)
    times = float(np.max(most / size))
    near = min(FACTORS, key=lambda factor: abs(np.log(times / factor)))
    guess = f": of pictures {near:g} times as large" if abs(np.log(times / near)) < NEAR else ""
    return (
        f"pixels reach ({most[0]:.0f}, {most[1]:.0f}), beyond the {size[0]} x {size[1]} for which "
        f"the calibration was made{guess}"
    )


def of_resolution(recording: Recording) -> Iterator[Fault]:
    """Yields a fault of resolution, or none."""
    header, pixels = recording.header, recording.tracks.pixels
    words = beyond(pixels, (header.image_width_px, header.image_height_px))
    if not words:
        words = _about_centre(pixels, (header.camera.cx_px, header.camera.cy_px))
    if words:
        remedy = "Give the calibration of these pictures: focal lengths and principal point scaled"
        yield Fault("resolution", f"{words}. {remedy}")


def _about_centre(pixels: Floats, centre: tuple[float, float]) -> str:
    if len(pixels) < ROWS_LEAST or min(centre) <= 0:
        return ""
    low, high = np.quantile(pixels.reshape(-1, 2), ENDS, axis=0)
    filled = low + high  # as much is free at one end as at the other
    times = filled / (2 * np.array(centre))
    factor = float(np.sqrt(times[0] * times[1])) if (times > 0).all() else 1.0
    near = min(FACTORS, key=lambda one: abs(np.log(factor / one)))
    alike = (times > 0).all() and abs(np.log(times[0] / times[1])) < ALIKE
    if not alike or abs(np.log(factor / near)) > NEAR or (low > BEGINS * filled).any():
        return ""
    return (
        f"pixels fill a picture of about {filled[0]:.0f} x {filled[1]:.0f}, the principal point is "
        f"that of one of {2 * centre[0]:.0f} x {2 * centre[1]:.0f}: is the calibration that of "
        f"pictures {1 / near:g} times as large?"
    )
