# SPDX-License-Identifier: MIT
"""The CALIBRATION of docs/REPLAY-FORMAT.md: what the filter has estimated of it on the way."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, Self

import numpy as np

from pelorus.frames import Camera, Kind, Message, identity, zeros
from pelorus.layout import Floats


class Part(NamedTuple):
    """One number of the calibration, in the order of the message."""

    name: str
    unit: str
    scale: float  # from SI


PARTS = (
    Part("baseline", "%", 100),
    Part("focal length", "%", 100),
    *(Part(f"camera turned about its {axis}", "deg", 180 / np.pi) for axis in "xyz"),
    *(Part(f"principal point, {axis}", "px", 1) for axis in "uv"),
    *(Part(f"camera shifted along its {axis}", "mm", 1000) for axis in "xyz"),
    Part("clock of the camera", "ms", 1000),
)


@dataclass(frozen=True, eq=False)
class Calibrated(Message, kind=Kind.CALIBRATION):
    """The calibration as the filter estimates it; `corrected` and `sigma` (11,) in the order of
    PARTS.
    """

    t_ns: int
    estimated: int  # bits
    camera: Camera
    R_CB: Floats = identity()
    t_CB_m: Floats = zeros(3)
    corrected: Floats = zeros(len(PARTS))
    sigma: Floats = zeros(len(PARTS))

    def values(self) -> dict[str, Any]:
        return vars(self) | vars(self.camera)

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:  # noqa: ARG003
        camera = Camera(**{part.name: values.pop(part.name) for part in fields(Camera)})
        return cls(camera=camera, **values)


def last_calibrated(messages: Iterable[Message]) -> Calibrated | None:
    """What a log says last of it; None if nothing was estimated."""
    found = None
    for message in messages:
        if isinstance(message, Calibrated):
            found = message
    return found
