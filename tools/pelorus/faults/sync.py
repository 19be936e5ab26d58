# SPDX-License-Identifier: MIT
"""Detects left and right pictures that were not taken together.

The rows of a point are equal in a rectified pair. If the right picture is taken dt later, its row
is off by dt times the rate at which the point moves through the rows. So the rows' difference is
regressed on that rate, which the same tracks give in neighbouring frames. Errors of the calibration
depend on the place in the picture alone, and are fitted with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pelorus.faults.fault import Fault
from pelorus.faults.seen import standard_error
from pelorus.io.tracks import Tracks
from pelorus.math.motion import Times
from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

ROWS_LEAST = 500
SIGMAS, APART_S, HARM_PX = 6.0, 1.5e-3, 0.3
MAD_TO_SIGMA, WITHIN_SIGMAS, ROUNDS = 1.4826, 4.0, 5


@dataclass(frozen=True)
class PictureDelay:
    """Delay of the right picture, s, and the motion of points meanwhile, px, RMS."""

    by_s: float
    sigma_s: float
    moved_px: float

    @property
    def found(self) -> bool:
        """Returns whether the delay is significant and does harm."""
        sure = abs(self.by_s) > max(SIGMAS * self.sigma_s, APART_S)
        return sure and self.moved_px > HARM_PX

    @property
    def words(self) -> str:
        """Returns a sentence without its full stop."""
        later = "right" if self.by_s > 0 else "left"
        return (
            f"left and right pictures are {abs(self.by_s) * 1e3:.0f} +- {self.sigma_s * 1e3:.1f} "
            f"ms apart, the {later} one later: points move by {self.moved_px:.1f} px meanwhile, "
            "and rows differ as they do"
        )

    @property
    def fault(self) -> Fault:
        return Fault(
            "left-right-time",
            f"{self.words}. Trigger both cameras together; with --pair-within, less is right",
            ratio=(self.by_s / self.sigma_s) ** 2,
        )


def apart(tracks: Tracks, t_ns: Times, camera: Camera) -> PictureDelay | None:
    """Measures the delay; None with too few data.

    The rate is that between adjacent frames, and has noise; the rate between frames farther away
    has independent noise, and is its instrument.
    """
    near, far = (_beside(tracks, t_ns, lag) for lag in (1, 2))
    both = np.isfinite(near.rows) & np.isfinite(far.rows)
    at = np.nonzero(both)[0]
    if len(at) < ROWS_LEAST:
        return None
    place = _of_place(tracks.pixels[at], camera)
    difference = tracks.pixels[at, 3] - tracks.pixels[at, 1]
    rate, weight, by_s = near.rows[at], np.ones(len(at)), 0.0
    for _ in range(ROUNDS):
        # of the instrument and of both sides, the part that does not depend on the place in the
        # picture
        told, d, x = (_beyond_place(c, place, weight) for c in (far.rows[at], difference, rate))
        power = float(np.sum(weight * told * x)) + 1e-12
        by_s = float(np.sum(weight * told * d)) / power
        left = d - by_s * x
        sigma = MAD_TO_SIGMA * float(np.median(np.abs(left))) + 1e-6
        weight = (np.abs(left) < WITHIN_SIGMAS * sigma).astype(np.float64)
    if weight.sum() < ROWS_LEAST or power <= 0:
        return None
    noise = weight * told * left
    by_frame = np.bincount(tracks.frame[at], noise, tracks.frame_count).astype(np.float64)
    speed = float(np.sqrt(np.average(near.rows[at] ** 2 + near.columns[at] ** 2, weights=weight)))
    return PictureDelay(by_s, standard_error(by_frame) / power, abs(by_s) * speed)


def _beyond_place(x: Floats, place: Floats, weight: Floats) -> Floats:
    """Returns x minus its fit as a function of the place in the picture."""
    fit = np.linalg.lstsq(place * weight[:, None], x * weight, rcond=None)[0]
    return np.asarray(x - place @ fit)


class Rates(NamedTuple):
    """Rates at which each row's point moves through rows and columns of the two pictures, px/s.

    NaN where it is not seen before and after.
    """

    rows: Floats
    columns: Floats


def _beside(tracks: Tracks, frame_t_ns: Times, lag: int) -> Rates:
    """Returns the rates by the views so many frames before and after."""
    pairs = tracks.pairs(lag)
    behind, before = np.full(len(tracks), -1), np.full(len(tracks), -1)
    behind[pairs.first], before[pairs.second] = pairs.second, pairs.first
    at = np.nonzero((behind >= 0) & (before >= 0))[0]
    out = np.full((2, len(tracks)), np.nan)
    if not len(at):
        return Rates(*out)
    later, earlier = behind[at], before[at]
    tau = (frame_t_ns[tracks.frame[later]] - frame_t_ns[tracks.frame[earlier]]) * 1e-9
    tau[tau > 1.5 * np.median(tau)] = np.nan
    moved = tracks.pixels[later] - tracks.pixels[earlier]
    out[0, at] = moved[:, [1, 3]].mean(axis=1) / tau
    out[1, at] = moved[:, [0, 2]].mean(axis=1) / tau
    return Rates(*out)


def _of_place(pixels: Floats, camera: Camera) -> Floats:
    """Returns 1, x, y, x^2, x y, y^2 of the left pixel, and the disparity."""
    x = (pixels[:, 0] - camera.cx_px) / camera.fx_px
    y = (pixels[:, 1] - camera.cy_px) / camera.fx_px
    disparity = (pixels[:, 0] - pixels[:, 2]) / camera.fx_px
    return np.column_stack((np.ones_like(x), x, y, x * x, x * y, y * y, disparity))
