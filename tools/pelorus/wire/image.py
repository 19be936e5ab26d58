# SPDX-License-Identifier: MIT
"""The IMAGE and RIG of docs/REPLAY-FORMAT.md: pictures in bands, and the cameras that took them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pelorus.wire import schema
from pelorus.wire.frames import Kind, Message, identity, rows_of, zeros
from pelorus.wire.layout import Floats, row_type

Grey = NDArray[np.uint8]
BAND_PIXELS = schema.LIMITS["image_pixels"]  # suit every reader
_BAND_MOST = (1 << 16) - 1
_GREY = row_type(schema.MESSAGES["IMAGE"].rows)


class Side(IntEnum):
    """One of the two cameras."""

    LEFT = schema.number("side", "LEFT")
    RIGHT = schema.number("side", "RIGHT")


@dataclass(frozen=True, eq=False)
class Image(Message, kind=Kind.IMAGE):
    """A band of a picture: `pixels` (n,) uint8 in the order of the rows, behind `first_px`."""

    t_ns: int
    side: Side
    width_px: int
    height_px: int
    first_px: int
    pixels: Grey

    choices: ClassVar = {"side": Side}

    def values(self) -> dict[str, Any]:
        return super().values() | {"count": len(self.pixels)}

    def pack(self) -> bytes:
        if not 1 <= len(self.pixels) <= _BAND_MOST:
            raise ValueError(f"{len(self.pixels)} pixels in one IMAGE, 1 to {_BAND_MOST} fit")
        return super().pack() + self.pixels.astype(np.uint8).tobytes()

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:
        rows = rows_of(payload, end, _GREY, values.pop("count"))
        return cls(**values, pixels=rows["grey"])


@dataclass(frozen=True, eq=False)
class RigMessage(Message, kind=Kind.RIG):
    """The cameras of pictures that are not rectified; the HEADER's is then the virtual one."""

    width_px: int
    height_px: int
    left_model: int
    left_fx_px: float
    left_fy_px: float
    left_cx_px: float
    left_cy_px: float
    right_model: int
    right_fx_px: float
    right_fy_px: float
    right_cx_px: float
    right_cy_px: float
    left_k: Floats = zeros(8)
    right_k: Floats = zeros(8)
    R_RL: Floats = identity()
    t_RL_m: Floats = zeros(3)
    row_time_s: float = 0.0
    disparity_max_px: int = 0
    tracks: int = 0


def bands_of(t_ns: int, side: Side, picture: Grey, pixels: int = BAND_PIXELS) -> Iterator[Image]:
    """Yields a picture, uint8 (rows, columns), as messages."""
    rows, columns = picture.shape
    flat = np.ascontiguousarray(picture).ravel()
    for at in range(0, len(flat), pixels):
        yield Image(t_ns, side, columns, rows, at, flat[at : at + pixels])


class TimedPair(NamedTuple):
    """A stereo pair, uint8 (rows, columns) each, with the times of both."""

    t_ns: int
    t_right_ns: int
    left: Grey
    right: Grey


@dataclass(frozen=True)
class PicturesOf:
    """The pictures of a recording, of one size; `read` yields them in order, anew at each call."""

    t_ns: NDArray[np.int64]
    width_px: int
    height_px: int
    read: Callable[[], Iterator[TimedPair]]
    rig: RigMessage | None = None  # where they are not rectified

    def __len__(self) -> int:
        """Returns the number of their messages."""
        return 2 * len(self.t_ns) * -(-self.width_px * self.height_px // BAND_PIXELS)

    def messages(self) -> Iterator[tuple[int, Image]]:
        """Yields them with the time at which they come: when the pair is whole."""
        for pair in self.read():
            for t_ns, side, picture in (
                (pair.t_ns, Side.LEFT, pair.left),
                (pair.t_right_ns, Side.RIGHT, pair.right),
            ):
                for band in bands_of(t_ns, side, picture):
                    yield max(pair.t_ns, pair.t_right_ns), band
