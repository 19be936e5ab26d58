# SPDX-License-Identifier: MIT
"""`pelorus convert FORMAT IN OUT.plr`."""

from __future__ import annotations

from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import typer
from rich.markup import escape

from pelorus.commands import importers, own
from pelorus.commands.choices import Fix, Timing
from pelorus.commands.importers import OWN_DATA
from pelorus.commands.outputs import write
from pelorus.converters import csv as csv_converter
from pelorus.converters import imu_npz as imu_npz_converter
from pelorus.converters import landmark_map, late_turns, readings_csv
from pelorus.converters.columns import Columns
from pelorus.converters.streams import TwistIn
from pelorus.io.small_sensors import SMALL_SENSORS
from pelorus.program.console import out
from pelorus.rig.lens import LensModel

SOURCE = typer.Argument(..., metavar="IN", help="The file to convert.")
DATA_SETS = "Files of known data sets"

app = typer.Typer(
    name="convert",
    help="Make a recording (.plr) of other formats. Which is yours? docs/CONVERT.md has a command "
    "for each.",
    no_args_is_help=True,
    epilog="Example:  pelorus convert euroc V1_01_easy V1_01.plr",
)


SENSORS = {
    sensor.name: (list[Path], typer.Option([], help=readings_csv.columns_of(sensor)))
    for sensor in SMALL_SENSORS
}


def _csv(
    target: Path = own.TARGET,
    twists: Path | None = own.TWISTS,
    gyro: Path | None = own.GYRO,
    imu: Path | None = own.IMU,
    stereo: Path | None = typer.Option(
        None,
        help="Columns t_s (or t_ns), id, uL_px, vL_px, uR_px, vR_px; rows of one time are a frame. "
        "Without it another sensor is expected, such as --position.",
    ),
    calibration: list[Path] = typer.Option(
        [],
        help="Of Kalibr (and a second time, its IMU file), ROS, OpenCV, ORB-SLAM3, VINS-Fusion, "
        "Basalt, OKVIS, SVO, maplab, ZED or OAK (docs/CONVERT.md), or, of a rectified pair, JSON: "
        "fx_px, fy_px, cx_px, cy_px, baseline_m, and R_CB, as three rows of three, with t_CB_m "
        "(body to left camera) or R_BC with t_BC_m (the camera's pose in the body); optional "
        "image_width_px, image_height_px, body_axes (forward-left-up, forward-right-down, other), "
        "twist_timing (start, end, mid), name, and noise, an object with some of pixel_sigma_px, "
        "velocity_sigma_mps, gyro_sigma_radps, bias_velocity_sigma_mps, bias_gyro_sigma_radps.",
    ),
    truth: Path | None = own.TRUTH,
    columns: list[str] = own.COLUMNS,
    rows: list[str] = own.ROWS,
    crs: str = own.CRS,
    measured: str = own.MEASURED,
    twist_in: TwistIn = own.TWIST_IN,
    extrinsic: Path | None = own.EXTRINSIC,
    lens: LensModel | None = own.LENS,
    cameras: str = own.CAMERAS,
    fix: Fix = own.FIX,
    twist_timing: Timing | None = own.TIMING,
    **readings: list[Path],
) -> None:
    """CSV files: stereo tracks, and twists, a wheel speed alone or an IMU; your own columns."""
    timing = twist_timing.value_in_header if twist_timing else None
    sources = csv_converter.Sources(
        csv_converter.MotionFiles(twists, gyro, imu, csv_converter.measured_of(measured), twist_in),
        stereo,
        tuple(calibration),
        truth,
        extrinsic,
        lens,
        own.names(cameras),
        Columns.of(columns, crs, rows),
    )
    found = csv_converter.read(sources, readings, timing)
    importers.converted(found, timing, fix is Fix.AUTO, target)


app.command(
    "csv",
    rich_help_panel=OWN_DATA,
    epilog="Example:  pelorus convert csv --twists twists.csv --stereo stereo.csv "
    "--calibration camera.json --wheel wheel.csv mine.plr",
)(own.with_options(_csv, SENSORS))


@app.command(
    "imu-npz",
    rich_help_panel=DATA_SETS,
    epilog="Example:  pelorus convert imu-npz tum_corridor1-60-seed0.npz corridor.plr --seed 3",
)
def imu_npz(
    source: Path = SOURCE,
    target: Path = own.TARGET,
    keep_ids: bool = typer.Option(
        False,
        "--keep-ids",
        help="Landmarks that come back keep their id, so that loops close. Else, as of a tracker, "
        "an id is new after a frame's absence.",
    ),
    seed: int | None = typer.Option(
        None,
        min=0,
        metavar="N",
        help="Draw a simulated recording anew: the noise of every pixel, and new ids at random. "
        "The landmarks are placed by all that the true poses see of them. Else the pixels are the "
        "file's, and the ids count up.",
    ),
    pixel_sigma: float = typer.Option(
        0.0,
        min=0,
        metavar="PX",
        help="Noise to be added to what the pixels have; the seed's, or 0's.",
    ),
    start_sigmas: str = typer.Option(
        ",".join(f"{sigma:g}" for sigma in imu_npz_converter.StartSigmas()),
        metavar="M,RAD,M/S,M/S^2,RAD/S",
        help="How well the state of init is known, of each axis: position, rotation, velocity, "
        "biases of accelerometer and gyro.",
    ),
) -> None:
    """A .npz with the raw readings of an IMU, stereo tracks and the truth."""
    choices = imu_npz_converter.Choices(
        keep_ids, seed, pixel_sigma, imu_npz_converter.start_sigmas(start_sigmas)
    )
    recording, findings = imu_npz_converter.convert(source, choices)
    write(recording, findings, target)


@app.command(
    "map",
    rich_help_panel="A map",
    epilog="Example:  pelorus convert map landmarks.csv map.plr --like drive.plr",
)
def map_(
    source: Path = typer.Argument(
        ...,
        metavar="IN",
        help="CSV with the columns id, x_m, y_m, z_m in the world, and sigma_m or cov_xx_m2, "
        "cov_yx_m2, cov_yy_m2, cov_zx_m2, cov_zy_m2, cov_zz_m2 (a column frame must say world): "
        "what pelorus export --map OUT.csv writes.",
    ),
    target: Path = typer.Argument(..., metavar="OUT.plr", help="The map to write."),
    like: Path = typer.Option(
        ...,
        "--like",
        metavar="DRIVE.plr",
        help="A recording of the camera that will see the landmarks: for HEADER and body axes.",
    ),
) -> None:
    """Make known landmarks of a map, to be localised in (pelorus-replay --map-in).

    A result of pelorus-replay --out is such a map as it is.
    """
    recording = landmark_map.convert(source, like)
    size = recording.write(target)
    sigma = [float(np.sqrt(m.covariance[[0, 2, 5]].mean())) for m in recording.known]
    out.print(
        f"{escape(str(target))}: {size} bytes, {len(sigma)} known landmarks, sigma "
        f"{min(sigma):.3g} to {max(sigma):.3g} m"
    )


@app.command(
    "late-turns",
    rich_help_panel="A recording, mended",
    epilog="Example:  pelorus convert late-turns drive.plr moved.plr --late 0.15",
)
def late_turns_(
    source: Path = typer.Argument(..., metavar="IN.plr", help="A recording moved by twists."),
    target: Path = own.TARGET,
    late: float = typer.Option(
        ...,
        metavar="S",
        help="By how much the rates of turn come after the velocities, as convert and check say; "
        "negative if they come before.",
    ),
) -> None:
    """Move rates of turn that come later than the velocities beside them; all else stays."""
    count = late_turns.convert(source, late, target)
    out.print(f"{escape(str(target))}: the rates of turn of {count} twists, {late:g} s earlier")


importers.register(app)
app.registered_commands.sort(key=lambda command: command.rich_help_panel != OWN_DATA)


for added in entry_points(group="pelorus.formats"):  # of other packages
    app.add_typer(added.load())
