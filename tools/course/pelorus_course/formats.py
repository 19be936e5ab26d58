# SPDX-License-Identifier: MIT
"""The formats that this package adds to `pelorus convert`."""

from __future__ import annotations

from pathlib import Path

import typer
from pelorus.commands import own
from pelorus.commands.choices import Fix, Timing, TimingOrAuto
from pelorus.commands.outputs import write
from pelorus.faults.mend import findings_of

from pelorus_course import ece276a as ece276a_converter
from pelorus_course import matlab

SOURCE = typer.Argument(..., metavar="IN", help="The file to convert.")
DATA_SETS = "Files of known data sets"

app = typer.Typer()


@app.command(
    rich_help_panel=DATA_SETS,
    epilog="Example:  pelorus convert ece276a 0027.npz 0027.plr --truth kitti-07.txt",
)
def ece276a(
    source: Path = SOURCE,
    target: Path = own.TARGET,
    truth: Path | None = typer.Option(
        None, metavar="POSES.txt", help="KITTI poses of the left camera; row k is frame k."
    ),
    fix: Fix = own.FIX,
    twist_timing: TimingOrAuto = typer.Option(
        TimingOrAuto.AUTO,
        help="When a twist reading holds; auto: end if the data say so clearly, else start.",
    ),
    keep_ids: bool = typer.Option(
        False,
        "--keep-ids",
        help="Leave stale tracks under the ids that the file gives them.",
    ),
) -> None:
    """A .npz of UCSD's ECE276A project 3 (visual-inertial SLAM)."""
    recording, findings = ece276a_converter.convert(
        source, truth, fix is Fix.AUTO, twist_timing.value_in_header, keep_ids
    )
    write(recording, findings, target)


@app.command(
    "starry-night",
    rich_help_panel=DATA_SETS,
    epilog="Example:  pelorus convert starry-night dataset3.mat starry.plr",
)
def starry_night(
    source: Path = SOURCE,
    target: Path = own.TARGET,
    twist_timing: Timing = typer.Option(Timing.START, help="When a twist reading holds."),
    landmark_sigma: float = typer.Option(
        matlab.LANDMARK_SIGMA_M,
        metavar="M",
        help="Standard deviation of the known landmarks, each axis.",
    ),
) -> None:
    """A .mat of UTIAS's Starry Night, with its landmarks as known ones."""
    recording = matlab.starry_night(source, twist_timing.value_in_header, landmark_sigma)
    write(recording, findings_of(recording), target)


@app.command(
    rich_help_panel=DATA_SETS,
    epilog="Example:  pelorus convert klt 2011_09_26_drive_0001_sync_KLT.mat drive.plr",
)
def klt(
    source: Path = SOURCE,
    target: Path = own.TARGET,
    twist_timing: Timing = typer.Option(Timing.MID, help="When a twist reading holds."),
) -> None:
    """A KITTI drive with KLT stereo tracks (.mat)."""
    recording = matlab.klt(source, twist_timing.value_in_header)
    write(recording, findings_of(recording), target)
