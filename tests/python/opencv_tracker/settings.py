# SPDX-License-Identifier: MIT
"""The tracker's settings, with defaults that work on a car and on a hand."""

from __future__ import annotations

from dataclasses import dataclass

from pelorus.errors import PelorusError
from pelorus.wire.frames import OBSERVATIONS_MAX


@dataclass(frozen=True)
class Settings:
    """Lengths in px."""

    corners: int = 100  # at most so many tracks in a frame: the filter's slots
    spacing_px: float = 20.0  # between two new corners, and to the tracks that are there
    window_px: int = 15  # side of the patch that is followed
    round_trip_px: float = 0.5  # there and back again, a point may miss its start by so much
    row_gap_px: float = 1.5  # |vL - vR| of a match: the pictures are rectified
    epipolar_px: float = 1.0  # RANSAC: how far a point may lie off what the others' motion says
    disparity_max_px: int = 0  # 0: an eighth of the picture's width

    def check(self) -> None:
        """Refuse what cannot work."""
        for name, value, least, most in (
            ("corners", self.corners, 8, OBSERVATIONS_MAX),
            ("spacing", self.spacing_px, 1, 1000),
            ("window", self.window_px, 5, 101),
            ("round trip", self.round_trip_px, 0.01, 100),
            ("row gap", self.row_gap_px, 0.01, 100),
            ("epipolar distance", self.epipolar_px, 0.01, 100),
            ("largest disparity", self.disparity_max_px, 0, 10_000),
        ):
            if not least <= value <= most:
                raise PelorusError(f"{name} {value}: {least} to {most} is expected")
        if self.window_px % 2 == 0:
            raise PelorusError(f"window {self.window_px}: an odd number is expected")
