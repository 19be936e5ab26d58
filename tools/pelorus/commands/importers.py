# SPDX-License-Identifier: MIT
"""`pelorus convert euroc | ros | kitti`: folders and bags, pictures or tracks and what moves."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import typer
from rich.markup import escape

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
from pelorus.console import out
from pelorus.converters import bag, csv, euroc, kitti, ros, streams
from pelorus.converters.asked import Asked
from pelorus.converters.bag import Bag
from pelorus.converters.columns import Columns
from pelorus.converters.ros_frames import Cameras
from pelorus.converters.streams import Streams, Twists
from pelorus.errors import PelorusError
from pelorus.rig.lens import LensModel

TIMING = typer.Option(Timing.START, help="When a twist reading holds.")
OWN_DATA = "Your own data"
RADIUS_MAX_M = 5.0


class Stamps(StrEnum):
    """Of a bag's messages."""

    HEADER = bag.HEADER
    LOG = bag.LOG


def register(app: typer.Typer) -> None:
    """Add the commands to `convert`."""
    app.command(
        "euroc",
        rich_help_panel=OWN_DATA,
        epilog="Example:  pelorus convert euroc V1_01_easy V1_01.plr",
    )(euroc_)
    app.command(
        "kitti",
        rich_help_panel=OWN_DATA,
        epilog="Example:  pelorus convert kitti 2011_09_30/2011_09_30_drive_0020_sync 0020.plr",
    )(kitti_)
    app.command(
        "ros",
        rich_help_panel=OWN_DATA,
        epilog="Example:  pelorus convert ros drive.mcap drive.plr --calibration camchain.yaml",
    )(ros_)


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


def kitti_(
    folder: Path = typer.Argument(
        ..., metavar="FOLDER", help="DATE_drive_NNNN_sync, or sequences/NN of the benchmark."
    ),
    target: Path = TARGET,
    calibration: list[Path] = CALIBRATION,
    extrinsic: Path | None = EXTRINSIC,
    lens: LensModel | None = LENS,
    twists: Path | None = TWISTS,
    imu: Path | None = IMU,
    truth: Path | None = TRUTH,
    columns: list[str] = COLUMNS,
    measured: str = MEASURED,
    velocity_sigma: float = typer.Option(
        0.5, metavar="M/S", help="Noise of the twists that are made from the benchmark's poses."
    ),
    gyro_sigma: float = typer.Option(0.05, metavar="RAD/S", help="Likewise."),
    seed: int = typer.Option(1, help="Of that noise."),
    twist_timing: Timing | None = typer.Option(
        None, help="When a twist reading holds; else end for a raw drive, start for the others."
    ),
    fix: Fix = FIX,
) -> None:
    """A raw drive of KITTI with its OXTS, or a sequence of its odometry benchmark."""
    asked = _asked(calibration, extrinsic, lens, twists, imu, truth, columns, measured)
    usual = Timing.END if kitti.is_raw(folder) and asked.motion is None else Timing.START
    found = kitti.read(folder, asked, kitti.Made(velocity_sigma, gyro_sigma, seed))
    _convert(found, target, twist_timing or usual, fix)


def ros_(
    source: Path = typer.Argument(
        ..., metavar="BAG", help="ROS 1 (.bag), ROS 2 (a folder with metadata.yaml), .mcap or .db3."
    ),
    target: Path = TARGET,
    calibration: list[Path] = CALIBRATION,
    extrinsic: Path | None = EXTRINSIC,
    lens: LensModel | None = LENS,
    left_topic: str = typer.Option("", help="Pictures; else of the calibration, or called left."),
    right_topic: str = typer.Option("", help="Likewise, of the right camera."),
    pair_within: float = typer.Option(
        2.0, metavar="MS", help="Pictures of a pair may be so far apart in time."
    ),
    tracks_topic: str = typer.Option(
        "",
        help="In place of pictures, tracks: PointCloud2 or PointCloud with id, uL, vL, uR, vR, or "
        "features with id, u0, v0, u1, v1 as of msckf_vio.",
    ),
    twist_topic: str = typer.Option(
        "", help="Odometry, TwistStamped or TwistWithCovarianceStamped; else the only one."
    ),
    imu_topic: str = typer.Option("", help="Or: the raw readings of an IMU move the body."),
    joint_topic: str = typer.Option("", help="Or: JointState with the speeds of wheels, rad/s."),
    joints: list[str] = typer.Option([], "--joint", help="A wheel's joint, left ones first."),
    wheel_radius: float = typer.Option(0.0, metavar="M", help="Of the wheels of --joint."),
    track_width: float = typer.Option(
        0.0, metavar="M", help="Between the first and the last --joint: then they tell turns too."
    ),
    truth_topic: str = typer.Option(
        "", help="Odometry, PoseStamped, PoseWithCovarianceStamped or TransformStamped."
    ),
    stamps: Stamps = typer.Option(Stamps.HEADER, help="Times of the headers, or of the arrival."),
    twists: Path | None = TWISTS,
    imu: Path | None = IMU,
    truth: Path | None = TRUTH,
    columns: list[str] = COLUMNS,
    measured: str = MEASURED,
    twist_timing: Timing = TIMING,
    fix: Fix = FIX,
) -> None:
    """A bag of ROS 1 or 2, or MCAP: pictures or tracks, and odometry, an IMU or wheels."""
    asked = _asked(calibration, extrinsic, lens, twists, imu, truth, columns, measured)
    topics = ros.Topics(
        Cameras(left_topic, right_topic, tracks_topic, round(pair_within * 1e6)),
        twist_topic,
        imu_topic,
        truth_topic,
        _wheels(joint_topic, joints, wheel_radius, track_width),
        csv.measured_of(measured),
    )
    with Bag(source, stamps.value) as opened:
        _convert(ros.read(opened, topics, asked), target, twist_timing, fix)


def _wheels(topic: str, joints: list[str], radius_m: float, track_m: float) -> ros.Wheels | None:
    if not topic and not joints:
        return None
    if not topic or not joints or not 0 < radius_m < RADIUS_MAX_M or track_m < 0:
        raise PelorusError(
            "wheels: --joint-topic TOPIC, --joint NAME (once or more) and --wheel-radius M are due"
        )
    return ros.Wheels(topic, tuple(joints), radius_m, track_m)


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
    for remark in found.remarks:
        out.print(escape(remark))
    recording = streams.recording(found).with_header(twist_timing=twist_timing.value_in_header)
    if fix is Fix.NONE:
        write(recording, [], target)
        return
    whole = isinstance(found.motion, Twists) and found.motion.is_whole
    write(*streams.examined(recording, whole), target)
