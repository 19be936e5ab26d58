# SPDX-License-Identifier: MIT
"""`pelorus convert euroc | ros | kitti`: folders and bags, pictures or tracks and what moves."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Any

import typer
from rich.markup import escape

from pelorus.commands import own
from pelorus.commands.choices import Fix, Timing
from pelorus.commands.outputs import write
from pelorus.converters import csv, euroc, kitti, streams
from pelorus.converters.columns import Columns
from pelorus.converters.streams import Asked, Streams, TwistIn
from pelorus.errors import PelorusError
from pelorus.program.console import out
from pelorus.rig.lens import LensModel
from pelorus.wire.frames import TwistTiming

OWN_DATA = "Your own data"
RADIUS_MAX_M = 5.0
# The options of all of them, of which `_asked` makes what the readers take.
SHARED: dict[str, tuple[Any, Any]] = {
    "calibration": (list[Path], own.CALIBRATION),
    "extrinsic": (Path | None, own.EXTRINSIC),
    "lens": (LensModel | None, own.LENS),
    "cameras": (str, own.CAMERAS),
    "twists": (Path | None, own.TWISTS),
    "gyro": (Path | None, own.GYRO),
    "imu": (Path | None, own.IMU),
    "truth": (Path | None, own.TRUTH),
    "columns": (list[str], own.COLUMNS),
    "rows": (list[str], own.ROWS),
    "crs": (str, own.CRS),
    "measured": (str, own.MEASURED),
    "twist_in": (TwistIn, own.TWIST_IN),
    "twist_timing": (Timing | None, own.TIMING),
    "fix": (Fix, own.FIX),
    "keep_pictures": (bool, own.KEEP_PICTURES),
}


class StampSource(StrEnum):
    """Times of a bag's messages: of their headers, or of their arrival."""

    HEADER = "header"
    LOG = "log"


def register(app: typer.Typer) -> None:
    """Adds the commands to `convert`."""
    for name, command, example in (
        ("euroc", _euroc, "V1_01_easy V1_01.plr"),
        ("ros", _ros, "drive.mcap drive.plr --calibration camchain.yaml"),
        ("kitti", _kitti, "2011_09_30/2011_09_30_drive_0020_sync 0020.plr"),
    ):
        app.command(
            name,
            rich_help_panel=OWN_DATA,
            epilog=f"Example:  pelorus convert {name} {example}",
        )(own.with_options(command, SHARED))


def _asked(
    calibration: list[Path],
    extrinsic: Path | None,
    lens: LensModel | None,
    cameras: str,
    twists: Path | None,
    gyro: Path | None,
    imu: Path | None,
    truth: Path | None,
    columns: list[str],
    rows: list[str],
    crs: str,
    measured: str,
    twist_in: TwistIn,
    twist_timing: Timing | None,
    fix: Fix,
    keep_pictures: bool,
) -> Asked:
    named = Columns.of(columns, crs, rows)
    timing = None if twist_timing is None else twist_timing.value_in_header
    files = csv.MotionFiles(twists, gyro, imu, csv.measured_of(measured), twist_in)
    motion = None
    if twists or imu:
        held = TwistTiming.START if timing is None else timing
        motion = csv.motion_of(files, named, held)
    elif gyro:
        raise PelorusError("--gyro: it goes with --twists FILE or --imu FILE, which lack a gyro")
    poses = csv.truth_of(truth, named) if truth else None
    named.require_used()
    return Asked(
        tuple(calibration),
        extrinsic,
        lens,
        own.names(cameras),
        motion,
        poses,
        files.measured,
        twist_in,
        timing,
        fix is Fix.AUTO,
        tuple(named.remarks),
        keep_pictures,
    )


def _euroc(
    folder: Path = typer.Argument(..., metavar="FOLDER", help="With mav0/cam0, cam1, imu0."),
    target: Path = own.TARGET,
    **shared: Any,
) -> None:
    """A folder like EuRoC's or TUM-VI's (mav0): pictures, an IMU or your wheels, the truth."""
    asked = _asked(**shared)
    _convert(euroc.read(folder, asked), asked, target)


def _kitti(
    folder: Path = typer.Argument(
        ..., metavar="FOLDER", help="DATE_drive_NNNN_sync, or sequences/NN of the benchmark."
    ),
    target: Path = own.TARGET,
    velocity_sigma: float = typer.Option(
        0.5, metavar="M/S", help="Noise of the twists that are made from the benchmark's poses."
    ),
    gyro_sigma: float = typer.Option(0.05, metavar="RAD/S", help="Likewise."),
    seed: int = typer.Option(1, help="Of that noise."),
    **shared: Any,
) -> None:
    """A raw drive of KITTI with its OXTS, or a sequence of its odometry benchmark."""
    asked = _asked(**shared)
    found = kitti.read(folder, asked, kitti.Made(velocity_sigma, gyro_sigma, seed))
    oxts = kitti.is_raw(folder) and asked.motion is None
    _convert(found, asked, target, TwistTiming.END if oxts else None)


def _ros(
    source: Path = typer.Argument(
        ..., metavar="BAG", help="ROS 1 (.bag), ROS 2 (a folder with metadata.yaml), .mcap or .db3."
    ),
    target: Path = own.TARGET,
    left_topic: str = typer.Option("", help="Pictures; else of the calibration, or called left."),
    right_topic: str = typer.Option("", help="Likewise, of the right camera."),
    left_info_topic: str = typer.Option(
        "", help="CameraInfo of the left camera; else the one beside its pictures."
    ),
    right_info_topic: str = typer.Option("", help="Likewise, of the right camera."),
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
    gyro_topic: str = typer.Option(
        "",
        help="Imu whose gyro takes the place of the twists' rotation; or, beside --imu-topic, that "
        "of the gyro alone.",
    ),
    imu_topic: str = typer.Option(
        "",
        help="Or: the raw readings of an IMU move the body; or those of an accelerometer, with the "
        "gyro on another topic.",
    ),
    joint_topic: str = typer.Option(
        "",
        help="Or: JointState with the speeds of wheels, rad/s. With --imu-topic they are readings "
        "beside it.",
    ),
    joints: list[str] = typer.Option([], "--joint", help="A wheel's joint, left ones first."),
    wheel_radius: float = typer.Option(0.0, metavar="M", help="Of the wheels of --joint."),
    track_width: float = typer.Option(
        0.0,
        metavar="M",
        help="Between the first and the last --joint, or the wheels of --wheel-topic: then they "
        "tell turns too.",
    ),
    wheel_topic: str = typer.Option(
        "",
        help="Beside an IMU: Odometry, TwistStamped or TwistWithCovarianceStamped of wheels, as "
        "readings of their speed.",
    ),
    wheel_axes: str = typer.Option(
        "x", metavar="LETTERS", help="Axes of their frame that they measure; xy where all steer."
    ),
    wheel_sigma: float = typer.Option(
        0.0, metavar="M/S", help="Of each axis of it; else as the messages say."
    ),
    wheel_slide: float = typer.Option(
        0.0,
        metavar="M/S",
        help="The body neither slides nor rises by more than this sigma: 0 along the axes that the "
        "wheels do not measure is a reading, too.",
    ),
    wheel_standstill: bool = typer.Option(
        True, help="Where the wheels read 0 for a second the body stands."
    ),
    truth_topic: str = typer.Option(
        "", help="Odometry, PoseStamped, PoseWithCovarianceStamped or TransformStamped."
    ),
    position_topic: str = typer.Option(
        "", help="NavSatFix of a GNSS receiver, as positions; east, north and up of the first fix."
    ),
    position_sigma: float = typer.Option(
        0.0, metavar="M", help="Of each axis of it; else as its messages say."
    ),
    body_frame: str = typer.Option(
        "", help="Of what moves the body, for /tf_static; else as its messages say."
    ),
    camera_frame: str = typer.Option("", help="Likewise, of the left camera; z looks forward."),
    stamps: StampSource = typer.Option(
        StampSource.HEADER, help="Times of the headers, or of the arrival."
    ),
    begin: float = typer.Option(
        0.0, "--from", metavar="S", help="Leave out what arrived before, s since the bag began."
    ),
    until: float = typer.Option(math.inf, metavar="S", help="Likewise, what arrived later."),
    **shared: Any,
) -> None:
    """A bag of ROS 1 or 2, or MCAP: pictures or tracks, and odometry, an IMU or wheels."""
    from pelorus.converters import ros  # noqa: PLC0415 - many modules that no other format needs
    from pelorus.converters.bag import Bag  # noqa: PLC0415
    from pelorus.converters.ros_beside import Beside  # noqa: PLC0415
    from pelorus.converters.ros_frames import Cameras  # noqa: PLC0415
    from pelorus.converters.ros_motion import MotionTopics, Wheels  # noqa: PLC0415

    asked = _asked(**shared)
    infos, apart_ns = (left_info_topic, right_info_topic), round(pair_within * 1e6)
    cameras = Cameras(left_topic, right_topic, tracks_topic, apart_ns, *infos, camera_frame)
    wheels = None
    if _are_wheels(joint_topic, joints, wheel_radius, track_width):
        wheels = Wheels(joint_topic, tuple(joints), wheel_radius, track_width)
    beside = None
    if wheel_topic or (wheels and imu_topic):
        _require_imu(wheel_topic, twist_topic, joint_topic)
        told = (wheel_sigma, wheel_axes, track_width, wheel_standstill, wheel_slide)
        beside, wheels = Beside(wheel_topic, wheels, *told), None
    moving = MotionTopics(
        twist_topic, gyro_topic, imu_topic, wheels, body_frame, truth_topic, beside is not None
    )
    topics = ros.Topics(cameras, moving, position_topic, position_sigma, beside)
    with Bag(source, stamps.value, (begin, until)) as opened:
        _convert(ros.read(opened, topics, asked), asked, target)


def _require_imu(wheel_topic: str, twist_topic: str, joint_topic: str) -> None:
    """Raises PelorusError where another topic than an IMU's would move the body, beside wheels."""
    if wheel_topic and joint_topic:
        raise PelorusError(
            "--wheel-topic and --joint-topic: both are wheels, one of them is expected"
        )
    if twist_topic:
        raise PelorusError(
            "--twist-topic moves the body in place of an IMU, and wheels go beside an IMU: leave "
            "it out, and say --wheel-topic"
        )


def _are_wheels(topic: str, joints: list[str], radius_m: float, track_m: float) -> bool:
    """Returns whether joints are named; raises PelorusError where more must be known of them."""
    if not topic and not joints:
        return False
    if not topic or not joints or not 0 < radius_m < RADIUS_MAX_M or track_m < 0:
        raise PelorusError(
            "wheels: --joint-topic TOPIC, --joint NAME (once or more) and --wheel-radius M "
            "are expected"
        )
    return True


def _convert(found: Streams, asked: Asked, target: Path, usual: TwistTiming | None = None) -> None:
    whole = replace(found, remarks=[*asked.remarks, *found.remarks])
    timing = usual if asked.timing is None else asked.timing
    if asked.keep_pictures:
        from pelorus.converters import with_pictures  # noqa: PLC0415 - it loads the library

        for remark in whole.all_remarks:
            out.print(escape(remark))
        made, findings = with_pictures.recording(whole)
        write(made if timing is None else made.with_header(twist_timing=timing), findings, target)
        return
    converted(whole, timing, asked.fix, target)


def converted(found: Streams, timing: TwistTiming | None, fix: bool, target: Path) -> None:
    """Prints the remarks, makes the recording, and writes it."""
    for remark in found.all_remarks:
        out.print(escape(remark))
    write(*streams.converted(found, timing, fix), target)
