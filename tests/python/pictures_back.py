# SPDX-License-Identifier: MIT
"""Puts the IMAGEs of a recording together again, as a session does: judges what was written."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from pelorus.wire.image import Grey, Image, Side, TimedPair
from pelorus.wire.message import Message


@dataclass
class _Half:
    """The picture of one side as it comes in."""

    t_ns: int = 0
    pixels: Grey = field(default_factory=lambda: np.zeros((0, 0), np.uint8))
    there: int = 0

    def take(self, band: Image) -> bool:
        """Adds a band; returns False where it does not go on with the picture."""
        shape = (band.height_px, band.width_px)
        if band.first_px == 0:
            self.t_ns, self.pixels, self.there = band.t_ns, np.zeros(shape, np.uint8), 0
        end = band.first_px + len(band.pixels)
        if (
            band.first_px != self.there
            or band.t_ns != self.t_ns
            or shape != self.pixels.shape
            or end > self.pixels.size
        ):
            self.there = 0
            return False
        self.pixels.ravel()[self.there : end] = band.pixels
        self.there = end
        return True

    @property
    def whole(self) -> bool:
        return 0 < self.there == self.pixels.size


def pairs_of(messages: Iterable[Message]) -> Iterator[TimedPair]:
    """Yields the pairs that the IMAGEs make up, as a session puts them together.

    Pictures with missing or disordered bands, and halves without the other one, are left out.
    """
    halves = {side: _Half() for side in Side}
    for message in messages:
        if isinstance(message, Image):
            halves[message.side].take(message)
            left, right = halves[Side.LEFT], halves[Side.RIGHT]
            if left.whole and right.whole:
                yield TimedPair(left.t_ns, right.t_ns, left.pixels, right.pixels)
                halves = {side: _Half() for side in Side}
