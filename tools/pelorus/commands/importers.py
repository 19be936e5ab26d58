# SPDX-License-Identifier: MIT
"""`pelorus convert euroc | ros | kitti`: folders and bags, pictures or tracks and what moves."""

from __future__ import annotations

from pathlib import Path

import typer

from pelorus.commands.choices import Fix, Timing
from pelorus.commands.conversion import write
from pelorus.commands.own import (
    CALIBRATION,
    COLUMNS,
    EXTRINSIC,
    FIX,
    IMU,
    LENS,
    MEASURED,
    TARGET,
    TRUTH,
    TWISTS,
)
from pelorus.converters import csv, euroc, streams
from pelorus.converters.asked import Asked
from pelorus.converters.columns import Columns
from pelorus.converters.streams import Streams, Twists
from pelorus.rig.lens import LensModel

TIMING = typer.Option(Timing.START, help="When a twist reading holds.")
OWN_DATA = "Your own data"


def register(app: typer.Typer) -> None:
    """Add the commands to `convert`."""
    app.command(
        "euroc",
        rich_help_panel=OWN_DATA,
        epilog="Example:  pelorus convert euroc V1_01_easy V1_01.plr",
    )(euroc_)


def euroc_(
    folder: Path = typer.Argument(..., metavar="FOLDER", help="With mav0/cam0, cam1, imu0."),
    target: Path = TARGET,
    calibration: list[Path] = CALIBRATION,
    extrinsic: Path | None = EXTRINSIC,
    lens: LensModel | None = LENS,
    twists: Path | None = TWISTS,
    imu: Path | None = IMU,
    truth: Path | None = TRUTH,
    columns: list[str] = COLUMNS,
    measured: str = MEASURED,
    twist_timing: Timing = TIMING,
    fix: Fix = FIX,
) -> None:
    """A folder like EuRoC's or TUM-VI's (mav0): pictures, an IMU or your wheels, the truth."""
    asked = _asked(calibration, extrinsic, lens, twists, imu, truth, columns, measured)
    _convert(euroc.read(folder, asked), target, twist_timing, fix)


def _asked(
    calibration: list[Path],
    extrinsic: Path | None,
    lens: LensModel | None,
    twists: Path | None,
    imu: Path | None,
    truth: Path | None,
    columns: list[str],
    measured: str,
) -> Asked:
    named = Columns.of(columns)
    has = csv.measured_of(measured)
    motion = csv.motion_of(twists, imu, has, named) if twists or imu else None
    poses = csv.truth_of(truth, named) if truth else None
    named.require_used()
    return Asked(tuple(calibration), extrinsic, lens, motion, poses)


def _convert(found: Streams, target: Path, twist_timing: Timing, fix: Fix) -> None:
    recording = streams.recording(found).with_header(twist_timing=twist_timing.value_in_header)
    if fix is Fix.NONE:
        write(recording, [], target)
        return
    whole = isinstance(found.motion, Twists) and found.motion.is_whole
    write(*streams.examined(recording, whole), target)
