# SPDX-License-Identifier: MIT
"""What a camera is to `pelorus live`. Each adapter is one file; CAMERAS names them all.

A camera knows its calibration when it is open, and then gives what it measures, as it comes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import NamedTuple, Protocol

from pelorus.errors import PelorusError
from pelorus.online.order import Datum
from pelorus.rig import read as rig_files
from pelorus.rig.read import Calibrated
from pelorus.rig.rig import Rig
from pelorus.tracking.images import Gray
from pelorus.wire.layout import Floats

DRIFT = 1e-4  # by so much two cheap clocks may differ in rate


@dataclass
class OtherClock:
    """What comes last is late by the least time of all: the largest difference is the best. It is
    let go slowly, for clocks drift.
    """

    _ahead_ns: float | None = None
    _at_ns: int = 0

    def heard(self, stamp_ns: int, host_ns: int) -> None:
        """Something with the other clock's stamp has come at this time of the host."""
        ahead = float(stamp_ns - host_ns)
        if self._ahead_ns is not None:
            ahead = max(ahead, self._ahead_ns - DRIFT * max(host_ns - self._at_ns, 0))
        self._ahead_ns, self._at_ns = ahead, host_ns

    def at(self, host_ns: int) -> int | None:
        """Returns what the other clock shows at a time of the host; None if nothing is known."""
        return None if self._ahead_ns is None else host_ns + round(self._ahead_ns)

    def to_host(self, stamp_ns: int) -> int:
        """Returns the time of the host; something must have been heard."""
        assert self._ahead_ns is not None
        return stamp_ns - round(self._ahead_ns)


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


# --- calibration ----------------------------------------------------------------------------------


def calibrated(
    asked: Asked, size: tuple[int, int], name: str, own: Callable[[], Rig]
) -> Calibrated:
    """Returns what holds for pictures of this size; `own` reads what the camera knows itself."""
    if asked.calibration:
        if rig_files.is_own(asked.calibration):
            return rig_files.read(asked.calibration, name, asked.extrinsic)
        rig = rig_files.read_rig(asked.calibration)
        if rig.sizes[0][0] and size not in rig.sizes:
            told = " or ".join(f"{width} x {height}" for width, height in rig.sizes)
            raise PelorusError(
                f"{asked.calibration[0]}: is of pictures of {told} px, the camera gives {size[0]} "
                f"x {size[1]}: --size, or the calibration of these"
            )
        return rig_files.of_rig(rig.of_size(*size), name, asked.extrinsic)
    return rig_files.of_rig(scaled(own(), size), name, asked.extrinsic)


def scaled(rig: Rig, size: tuple[int, int]) -> Rig:
    """Returns the rig of pictures of this size, which show what its own ones show."""
    if size in rig.sizes:
        return rig.of_size(*size)
    try:
        left, right = rig.left.scaled(*size), rig.right.scaled(*size)
    except ValueError as error:
        raise PelorusError(f"--size: {error}: a size of the same shape is expected") from error
    return replace(rig, left=left, right=right, others=())
