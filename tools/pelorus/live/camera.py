# SPDX-License-Identifier: MIT
"""What a camera is to `pelorus live`. Each adapter is one file; CAMERAS names them all.

A camera knows its calibration when it is open, and then gives what it measures, as it comes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import NamedTuple, Protocol

from pelorus.errors import PelorusError
from pelorus.online.order import Datum
from pelorus.rig.read import Calibrated
from pelorus.tracking.images import Gray
from pelorus.wire.layout import Floats


class Picture(NamedTuple):
    """Of the left or the right camera, as it took it, at the middle of the exposure."""

    t_ns: int
    is_right: bool
    pixels: Gray


class Force(NamedTuple):
    """What an accelerometer reads, gravity in it: upwards at rest."""

    t_ns: int
    a_B_mps2: Floats


class Rate(NamedTuple):
    """What a gyro reads."""

    t_ns: int
    w_B_radps: Floats


Measured = Picture | Force | Rate | Datum  # Datum: readings of an IMU as one, wheels, tracks


class Camera(Protocol):
    """An open camera. All stamps are of one clock."""

    name: str
    calibrated: Calibrated
    inertial: bool  # an IMU moves the body, not wheels
    recorded: bool  # it waits for its reader, and ends
    remarks: Sequence[str]  # what its user should know

    def measured(self) -> Iterator[Measured]:
        """Returns what it measures, as it comes; PelorusError where the camera is gone."""

    def close(self) -> None:
        """Lets the device go; may be called twice."""


@dataclass(frozen=True)
class Asked:
    """What the user says of the camera; what is not given the camera knows, or has a default."""

    source: str = ""  # a folder, a recording, a device
    size: tuple[int, int] | None = None  # of a picture, px
    rate_hz: int | None = None
    calibration: tuple[Path, ...] = ()
    extrinsic: Path | None = None
    imu: str = ""  # where the camera has none


CAMERAS = {
    "oak": "an OAK of Luxonis, with its own IMU (extra `oak`)",
    "realsense": "a RealSense D435i, D455 or D456: infrared pair and IMU (extra `realsense`)",
    "v4l2": "a USB camera that gives both pictures side by side, with an IMU at --imu",
    "folder": "a folder like EuRoC's, as if it were a camera",
    "plr": "a recording, as if it were a camera",
}


def open_camera(kind: str, asked: Asked) -> Camera:
    """Returns the camera, open; PelorusError where it is not there, with what would help."""
    if kind not in CAMERAS:
        raise PelorusError(f"--camera {kind}: {', '.join(CAMERAS)} are possible")
    adapter: Callable[[Asked], Camera] = import_module(f"pelorus.live.{kind}").open_camera
    return adapter(asked)
