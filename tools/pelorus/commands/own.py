# SPDX-License-Identifier: MIT
"""Options that the importers of a user's own data share."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import typer

from pelorus.commands.choices import Fix
from pelorus.converters.streams import TwistIn


def with_options(
    command: Callable[..., None], options: Mapping[str, tuple[Any, Any]]
) -> Callable[..., None]:
    """Returns the command with more options, each a type and a typer.Option, which it gets by
    name, as **given.
    """
    known = inspect.signature(command, eval_str=True).parameters.values()
    keyword = inspect.Parameter.KEYWORD_ONLY
    own = [p.replace(kind=keyword) for p in known if p.kind is not inspect.Parameter.VAR_KEYWORD]
    more = [
        inspect.Parameter(name, keyword, default=option, annotation=kind)
        for name, (kind, option) in options.items()
    ]
    command.__dict__["__signature__"] = inspect.Signature([*own, *more])
    return command


def names(words: str) -> tuple[str, ...]:
    """Returns the words between commas."""
    return tuple(word.strip() for word in words.split(",") if word.strip())


TARGET = typer.Argument(
    ..., metavar="OUT.plr", help="The recording to write; as OUT.plr.zst it is packed."
)
FIX = typer.Option(
    Fix.AUTO,
    help="auto: find stale tracks, turned axes and a malformed lever from the data alone, say so "
    "and mend them; none: leave the data as they are.",
)
KEEP_PICTURES = typer.Option(
    False,
    "--keep-pictures",
    help="Keep the pictures themselves, 8-bit grey, in the place of tracks: pelorus-replay then "
    "follows the points with the library's own eyes. Name OUT.plr.zst, for they are large.",
)
CALIBRATION = typer.Option(
    [],
    metavar="FILE",
    help="What calibrates the cameras: of Kalibr (and a second time, its IMU file), ROS, OpenCV, "
    "ORB-SLAM3, VINS-Fusion, Basalt, OKVIS, SVO, maplab, ZED, OAK; docs/CONVERT.md has them all.",
)
TWISTS = typer.Option(
    None,
    help="Columns t_s (or t_ms, t_us, t_ns), vx_mps, vy_mps, vz_mps, wx_radps, wy_radps, "
    "wz_radps, in body axes; some of them alone: --measured.",
)
GYRO = typer.Option(
    None,
    help="Beside --twists: columns t_s, wx_radps, wy_radps, wz_radps of a gyro in body axes, in "
    "place of the twists' own; its mean between two twists is taken. Beside --imu: of an "
    "accelerometer's file the gyro's, with times of its own.",
)
IMU = typer.Option(
    None,
    help="In place of twists, an IMU's raw readings: columns t_s, ax_mps2, ay_mps2, az_mps2 (9.81 "
    "upwards at rest), wx_radps, wy_radps, wz_radps. The body is the IMU then.",
)
TRUTH = typer.Option(
    None,
    help="Columns t_s, px_m, py_m, pz_m, qx, qy, qz, qw: body to world; or a text file of "
    "poses as TUM (t x y z qx qy qz qw), EuRoC (ns, position, quaternion w x y z), ORB-SLAM3, "
    "VINS-Fusion or OpenVINS write it.",
)
COLUMNS = typer.Option(
    [],
    metavar="NAME=COLUMN,...",
    help="Columns that are called otherwise, with the unit behind the last underscore or a colon: "
    "v=speed_kmh,w=yaw_rate:deg/s,t=stamp_ms; for one file: stereo.t=stamp_ms.",
)
ROWS = typer.Option(
    [],
    metavar="COLUMN=VALUE",
    help="The rows to take of a file with several sensors, which a column tells apart: I=1, or of "
    "one file imu.I=1; repeatable. Else the first sensor's.",
)
CRS = typer.Option(
    "",
    metavar="CRS",
    help="Of places on the earth in a truth or in positions: EPSG:32632 for columns easting_m and "
    "northing_m (zone 32 north of UTM), and of lat_deg and lon_deg if it is not WGS 84.",
)
MEASURED = typer.Option(
    "vx,vy,vz,wx,wy,wz",
    metavar="NAMES",
    help="Which velocities the twists' file has: vx for a wheel speed alone, vx,wz for wheels that "
    "tell a turn. The others are taken as 0 and little believed.",
)
TWIST_IN = typer.Option(
    TwistIn.AUTO,
    help="The axes of the twists: body; world, or world-velocity for the velocity alone, turned by "
    "their orientation (odometry's pose, columns qx, qy, qz, qw); poses: made of the poses, where "
    "nobody fills in the twist. auto: body, unless their own poses say otherwise.",
)
TIMING = typer.Option(
    None, help="When a twist reading holds; else the calibration says it, else start."
)
EXTRINSIC = typer.Option(
    None,
    metavar="FILE",
    help="JSON with R_CB, as three rows of three, and t_CB_m (body to left camera), or R_BC and "
    "t_BC_m, where the calibration does not say it or is of another body.",
)
CAMERAS = typer.Option(
    "",
    metavar="NAME,NAME",
    help="Of a calibration of more than two cameras the two that are the pair, as it calls them: "
    "cam1,cam2, or their topics; else the first two that are alike.",
)
LENS = typer.Option(
    None,
    help="Of an OpenCV calibration whose four numbers may be of a fisheye or not; none beside "
    "camera_info files of ROS: the pictures are rectified already.",
)
