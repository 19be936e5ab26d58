# SPDX-License-Identifier: MIT
"""The CALIBRATION of docs/REPLAY-FORMAT.md: the filter's online estimate of the calibration."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, Self

import numpy as np

from pelorus.wire.frames import Camera, Kind, Message, identity, zeros
from pelorus.wire.layout import Floats


class CalibrationPart(NamedTuple):
    """One number of the calibration, in the order of the message."""

    key: str
    name: str
    unit: str
    scale: float  # from SI


PARTS = (
    CalibrationPart("baseline", "baseline", "%", 100),
    CalibrationPart("focal", "focal length", "%", 100),
    *(
        CalibrationPart(f"turn_{axis}", f"turn of the camera about its {axis}", "deg", 180 / np.pi)
        for axis in "xyz"
    ),
    *(CalibrationPart(f"centre_{axis}", f"principal point {axis}", "px", 1) for axis in "uv"),
    *(
        CalibrationPart(f"place_{axis}", f"place of the camera along its {axis}", "mm", 1000)
        for axis in "xyz"
    ),
    CalibrationPart("clock", "camera's clock", "ms", 1000),
    CalibrationPart("wheel_scale", "wheels' radius", "%", 100),
    CalibrationPart("wheel_track", "distance between wheels", "%", 100),
)
OF_CAMERA = 11  # of these
CLOCK = OF_CAMERA - 1
MEANING = {
    f"calibrated_{part.key}{end}": f"{what} of the {part.name}, {part.unit}"
    for part in PARTS
    for end, what in (("", "estimated correction"), ("_sigma", "its sigma, in the end,"))
}


@dataclass(frozen=True, eq=False)
class Calibrated(Message, kind=Kind.CALIBRATION):
    """The filter's calibration: `corrected` and `sigma` (11,), and behind them `wheels` and
    `wheels_sigma` (2,), are in the order of PARTS.
    """

    t_ns: int
    estimated: int  # bits
    camera: Camera
    R_CB: Floats = identity()
    t_CB_m: Floats = zeros(3)
    corrected: Floats = zeros(OF_CAMERA)
    sigma: Floats = zeros(OF_CAMERA)
    wheels: Floats = zeros(len(PARTS) - OF_CAMERA)
    wheels_sigma: Floats = zeros(len(PARTS) - OF_CAMERA)

    def values(self) -> dict[str, Any]:
        return super().values() | vars(self.camera)

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:  # noqa: ARG003
        camera = Camera(**{part.name: values.pop(part.name) for part in fields(Camera)})
        return cls(camera=camera, **values)

    def parts(self) -> Iterator[tuple[CalibrationPart, float, float]]:
        """Yields each estimated part with its correction and sigma, in the part's unit."""
        corrected = np.concatenate((self.corrected, self.wheels))
        sigma = np.concatenate((self.sigma, self.wheels_sigma))
        for k, part in enumerate(PARTS):
            if self.estimated >> k & 1:
                yield part, corrected[k] * part.scale, sigma[k] * part.scale

    @property
    def figures(self) -> dict[str, float | int | None]:
        """Returns the figures by the keys of MEANING."""
        return {
            f"calibrated_{part.key}{end}": float(x)
            for part, value, sigma in self.parts()
            for end, x in (("", value), ("_sigma", sigma))
        }

    @property
    def offset_s(self) -> float:
        """Returns the amount to add to the setting camera-offset, s."""
        return float(self.corrected[CLOCK]) if self.estimated >> CLOCK & 1 else 0.0


def last_calibrated(messages: Iterable[Message]) -> Calibrated | None:
    """Returns a log's last estimate; None if nothing was estimated."""
    found = None
    for message in messages:
        if isinstance(message, Calibrated):
            found = message
    return found
