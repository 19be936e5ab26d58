# SPDX-License-Identifier: MIT
"""A user's own data: CSV files with a row of column names, in any order, and a calibration.

twists   t_s (or t_ms, t_us, t_ns), vx_mps, vy_mps, vz_mps, wx_radps, wy_radps, wz_radps
imu      t_s, ax_mps2, ay_mps2, az_mps2, wx_radps, wy_radps, wz_radps, in place of twists
stereo   t_s, id, uL_px, vL_px, uR_px, vR_px; the rows of one time are one frame
truth    t_s, px_m, py_m, pz_m, qx, qy, qz, qw: body to world (optional); or a TUM or EuRoC file

Small sensors have files of their own (readings_csv), and columns may have other names (columns).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pelorus.converters import readings_csv, streams, twist_axes, wheels
from pelorus.converters.columns import Columns, example
from pelorus.converters.streams import RawTracks, Readings, Streams, TwistIn, Twists
from pelorus.errors import PelorusError
from pelorus.io import foreign, trajectory
from pelorus.io.foreign import ForeignFileError
from pelorus.io.small_sensors import SMALL_SENSORS, STANDSTILL
from pelorus.io.table import Table
from pelorus.io.tracks import Tracks
from pelorus.io.trajectory import Trajectory
from pelorus.math.inertial import Inertial
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.rig import read as rig_files
from pelorus.rig.lens import LensModel
from pelorus.rig.read import Calibrated
from pelorus.wire.frames import Reading, TwistTiming

ID_MAX = 2**32 - 1
VELOCITIES = {
    f"{kind}{axis}": f"{kind}{axis}_{unit}"
    for kind, unit in (("v", "mps"), ("w", "radps"))
    for axis in "xyz"
}
RATES = {short: name for short, name in VELOCITIES.items() if short[0] == "w"}
FORCES = ("ax_mps2", "ay_mps2", "az_mps2")
PIXELS = ("uL_px", "vL_px", "uR_px", "vR_px")
POSITION, QUATERNION = ("px_m", "py_m", "pz_m"), ("qx", "qy", "qz", "qw")
NO_ROTATION = "the quaternion's norm is not 1 (the columns are qx, qy, qz, qw)"
NAMES_ITS_COLUMNS = 0.5  # share of the first row's cells with letters, where others have numbers


@dataclass(frozen=True)
class MotionFiles:
    """The files of twists or of an IMU, one of which is expected; a gyro may have a file of its
    own.

    `measured` are the velocities that the twists' file has, `axes` are theirs.
    """

    twists: Path | None = None
    gyro: Path | None = None
    imu: Path | None = None
    measured: frozenset[str] = frozenset(VELOCITIES)
    axes: TwistIn = TwistIn.AUTO


@dataclass(frozen=True)
class Sources:
    """The files of one recording; its calibration and choices are as rig.read has them."""

    motion: MotionFiles
    stereo: Path | None
    calibration: tuple[Path, ...]
    truth: Path | None = None
    extrinsic: Path | None = None
    lens: LensModel | None = None
    cameras: tuple[str, ...] = ()
    columns: Columns = field(default_factory=Columns)


def read(
    sources: Sources,
    readings: Mapping[str, list[Path]],
    twist_timing: TwistTiming | None = None,
) -> Streams:
    """Reads the files as they are."""
    columns = sources.columns
    calibrated = _calibrated(sources)
    timing = calibrated.header.twist_timing if twist_timing is None else twist_timing
    motion = motion_of(sources.motion, columns, timing)
    truth = None if sources.truth is None else truth_of(sources.truth, columns)
    small = _readings(readings, motion, columns)
    if isinstance(motion, Readings) and not readings.get(STANDSTILL.name):
        small += wheels.standing(small, columns.remarks)
    if sources.stereo is None:
        frames = _blind(motion, small, columns.remarks)
    else:
        frames = RawTracks(sources.stereo, *_stereo(columns.read(sources.stereo, "stereo")))
    columns.require_used()
    on_earth = columns.ground.origin_m is not None
    return Streams(calibrated, frames, motion, truth, small, columns.remarks, on_earth)


def _calibrated(sources: Sources) -> Calibrated:
    paths = sources.calibration
    if sources.stereo is None:
        return rig_files.without_cameras(paths, "no camera")
    if not paths:
        raise PelorusError(f"{sources.stereo}: of which cameras? --calibration FILE is expected")
    return rig_files.read(
        paths, sources.stereo.stem, sources.extrinsic, sources.lens, sources.cameras
    )


def _blind(motion: Twists | Readings, small: list[Reading], remarks: list[str]) -> RawTracks:
    """Returns frames without points at the times of the small sensors' readings.

    There the filter reports its pose, which is compared with a truth.
    """
    if not small:
        raise PelorusError(
            "no --stereo, and no other sensor: the motion alone is summed up to nothing that a "
            "filter could better; --stereo FILE or --position FILE is expected"
        )
    t_ns = np.array(sorted({reading.t_ns for reading in small}), np.int64)
    remarks.append(
        f"no --stereo: {len(t_ns)} frames without a point, at the times of the other sensors' "
        "readings; the camera in the HEADER stands for none"
    )
    return RawTracks(motion.where, t_ns, Tracks.none(len(t_ns)))


# --- motion ---------------------------------------------------------------------------------------


def motion_of(files: MotionFiles, columns: Columns, timing: TwistTiming) -> Twists | Readings:
    """Reads twists or an IMU from the files that are given."""
    twists, imu = files.twists, files.imu
    if twists is not None and imu is None:
        if files.gyro is None:
            table = columns.read(twists, "twists")
            found = _twists(table, files.measured)
            poses = _poses_beside(table)
            return twist_axes.in_body(found, poses, files.axes, timing, columns.remarks)
        speeds = _twists(columns.read(twists, "twists"), files.measured - RATES.keys())
        table = columns.read(files.gyro, "gyro")
        table.leave_out_bad(*RATES.values())
        rates = table.numbers(*RATES.values())
        return streams.with_gyro(speeds, files.gyro, table.ascending_times(), rates, timing)
    if imu is not None and twists is None:
        table = columns.read(imu, "imu")
        if files.gyro is None and not any(map(table.has, RATES.values())):
            raise ForeignFileError(
                imu,
                f"has no rates of turn; {', '.join(RATES.values())} are expected, or --gyro FILE "
                f"with them; there are: {', '.join(table.names)}",
            )
        if files.gyro is None:
            table.leave_out_bad(*FORCES, *RATES.values())
            a, w = table.numbers(*FORCES), table.numbers(*RATES.values())
            return Readings(imu, Inertial(table.ascending_times(), a, w))
        table.leave_out_bad(*FORCES)
        gyro = columns.read(files.gyro, "gyro")
        gyro.leave_out_bad(*RATES.values())
        forces = table.ascending_times(), table.numbers(*FORCES)
        turns = gyro.ascending_times(), gyro.numbers(*RATES.values())
        return Readings(imu, streams.joined(imu, files.gyro, forces, turns, columns.remarks))
    raise PelorusError(
        f"{'--twists and --imu' if imu else 'neither --twists nor --imu'} given; one is expected: "
        "twists (wheels, odometry, a wheel speed alone) or the raw readings of an IMU"
    )


def measured_of(words: str) -> frozenset[str]:
    """Parses --measured (vx,wz and such)."""
    found = [word.strip() for word in words.split(",")]
    if not set(found) <= set(VELOCITIES) or not found:
        raise PelorusError(
            f"--measured {words}: some of {', '.join(VELOCITIES)} are expected, parted by commas"
        )
    return frozenset(found)


def _twists(table: Table, measured: frozenset[str]) -> Twists:
    path = table.path
    lacking = [
        name for short, name in VELOCITIES.items() if short in measured and not table.has(name)
    ]
    if lacking and len(lacking) < len(measured):
        there = [short for short, name in VELOCITIES.items() if table.has(name)]
        otherwise = example(lacking[0], table.names)
        raise ForeignFileError(
            path,
            f"lacks the column {', '.join(lacking)}; there are: {', '.join(table.names)}. If "
            f"nothing measures them: --measured {','.join(there)}. If they are called otherwise: "
            f"--columns {otherwise}",
        )
    table.require(*lacking)
    table.leave_out_bad(*(name for short, name in VELOCITIES.items() if short in measured))
    numbers = [
        table.numbers(name)[:, 0] if short in measured else np.zeros(table.count)
        for short, name in VELOCITIES.items()
    ]
    whole = np.stack(numbers, axis=-1)
    return Twists(path, table.ascending_times(), whole[:, :3], whole[:, 3:], measured)


def _poses_beside(table: Table) -> Poses | None:
    """Returns the poses in the twists' file, with NaN positions if unknown; None without
    attitude.
    """
    if not all(map(table.has, QUATERNION)):
        return None
    p = np.full((table.count, 3), np.nan)
    if all(map(table.has, POSITION)):
        p = table.numbers(*POSITION)
    q = table.numbers(*QUATERNION)
    table.refuse(trajectory.off_unit(q), NO_ROTATION)
    return Poses.of_quaternions(q, p)


def _readings(
    paths: Mapping[str, list[Path]], motion: Twists | Readings, columns: Columns
) -> list[Reading]:
    """Reads all small sensors."""
    found: list[Reading] = []
    files = [(sensor, path) for sensor in SMALL_SENSORS for path in paths.get(sensor.name, [])]
    for sensor, path in files:
        own = readings_csv.read(columns.read(path, sensor.name), sensor)
        streams.require_overlap(path, np.array([m.t_ns for m in own], np.int64), motion)
        found += own
    return found


# --- tracks and truth -----------------------------------------------------------------------------


def _stereo(table: Table) -> tuple[Times, Tracks]:
    path = table.path
    table.leave_out_bad("id", *PIXELS, each_time_once=False)
    row_t_ns = table.times()
    frame_t_ns, frame = np.unique(row_t_ns, return_inverse=True)
    id = table.integers("id", ID_MAX)
    pixels = table.numbers(*PIXELS)
    tracks = Tracks.from_rows(len(frame_t_ns), frame.reshape(-1).astype(np.intp), id, pixels)
    tracks.check(path)
    if (k := tracks.twice()) is not None:
        t_ns = frame_t_ns[tracks.frame[k]]
        rows = table.rows[(row_t_ns == t_ns) & (id == tracks.id[k])]
        raise ForeignFileError(
            path,
            f"id {tracks.id[k]} stands twice in the frame at {t_ns} ns: "
            f"rows {rows[0]} and {rows[1]}",
        )
    return frame_t_ns, tracks


def truth_of(path: Path, columns: Columns) -> Trajectory:
    """Reads a truth: a CSV with named columns, a TUM file or EuRoC's."""
    lines = (line.lstrip() for line in foreign.text(path).splitlines())
    first = next((line for line in lines if line and not line.startswith("#")), "")
    if not _names_columns(first.split(",")):
        return trajectory.read_stamped(path)
    table = columns.read(path, "truth")
    if not all(map(table.has, POSITION)) and trajectory.names_poses(table.names):
        return trajectory.read_stamped(path)
    table.leave_out_bad(*QUATERNION, *POSITION)
    t_ns, p = table.ascending_times(), table.numbers(*POSITION)
    q = table.numbers(*QUATERNION)
    off = trajectory.off_unit(q)
    table.remarks += foreign.left_out(path, off, table.row, NO_ROTATION)
    return Trajectory(t_ns[~off], Poses.of_quaternions(q[~off], p[~off]))


def _names_columns(cells: Sequence[str]) -> bool:
    """Returns whether the first row after comments has column names; EuRoC's and TUM's has none."""
    words = [cell for cell in cells if cell.strip()[:1].isalpha()]
    return len(words) > NAMES_ITS_COLUMNS * len(cells)
