# SPDX-License-Identifier: MIT
"""Folders of the EuRoC MAV data set (ASL format), and those that are laid out like them.

mav0/cam0, cam1    data.csv (time in ns, file), data/ with the pictures, sensor.yaml
mav0/imu0          data.csv (ns, gyro rad/s, specific force m/s^2), sensor.yaml
mav0/state_groundtruth_estimate0 or mocap0    data.csv (ns, position, quaternion w x y z)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pelorus import foreign, se3, trajectory
from pelorus.converters.streams import Asked, Pictures, Readings, Streams
from pelorus.errors import PelorusError
from pelorus.foreign import ForeignFileError, Row
from pelorus.inertial import Inertial
from pelorus.motion import Times
from pelorus.named import Named
from pelorus.rig import kalibr
from pelorus.rig import read as rig_files
from pelorus.rig.read import Calibrated
from pelorus.rig.rig import rigid
from pelorus.se3 import Poses
from pelorus.tracking import images
from pelorus.tracking.images import Pair
from pelorus.trajectory import Trajectory

CAMERAS = ("cam0", "cam1")
IMU = "imu0"
TRUTHS = ("state_groundtruth_estimate0", "mocap0", "gt0")
IMU_COLUMNS = 7
NS_MAX = 2**63


def read(folder: Path, asked: Asked) -> Streams:
    """What the folder holds."""
    top = _top(folder)
    body = _of_body(top / IMU)
    paths = asked.calibration or _calibrations(top)
    calibrated = rig_files.read(paths, folder.resolve().name, asked.extrinsic, asked.lens)
    if not asked.calibration and asked.extrinsic is None and body is not None:
        calibrated = _on_imu(calibrated, body)
    rig = calibrated.rig
    ordered = tuple(reversed(CAMERAS)) if rig is not None and rig.swapped else CAMERAS
    pictures, alone = _pictures(top, ordered)
    motion = asked.motion or Readings(top / IMU / "data.csv", _imu(top / IMU / "data.csv"))
    remarks = []
    if alone:
        remarks.append(f"{len(alone)} pictures have no partner and are left out, {alone[0]} first")
    truth = asked.truth or _truth(top, body)
    return Streams(calibrated, pictures, motion, truth, remarks=remarks)


def _top(folder: Path) -> Path:
    for top in (folder, folder / "mav0"):
        if all((top / name).is_dir() for name in CAMERAS):
            return top
    try:
        there = sorted(path.name for path in folder.iterdir())
    except OSError as error:
        raise PelorusError(f"{folder}: cannot be read as a folder: {error.strerror}") from error
    raise PelorusError(
        f"{folder}: has no folders cam0 and cam1, nor mav0 with them; there are: "
        f"{', '.join(there[:10]) or 'none'}"
    )


# --- calibration ----------------------------------------------------------------------------------


def _calibrations(top: Path) -> tuple[Path, ...]:
    cameras = [top / name / "sensor.yaml" for name in CAMERAS]
    lacking = [path for path in cameras if not path.is_file()]
    if lacking:
        raise PelorusError(
            f"{lacking[0]}: there is no such file; it or --calibration FILE is due (Kalibr's "
            "camchain YAML, OpenCV's stereo YAML)"
        )
    imu = top / IMU / "sensor.yaml"
    return (*cameras, imu) if imu.is_file() else tuple(cameras)


def _of_body(folder: Path) -> Poses | None:
    """T_BS of a sensor.yaml: the sensor's points in the folder's body; None where none is told."""
    path = folder / "sensor.yaml"
    if not path.is_file():
        return None
    content = Named(path, foreign.yaml_object(path))
    if "T_BS" not in content:
        return None
    return rigid(path, "T_BS", kalibr.matrix(content, "T_BS", 4, 4))


def _on_imu(calibrated: Calibrated, body_of_imu: Poses) -> Calibrated:
    """The recording's body is the IMU, which need not be the folder's body."""
    T_CB = Poses(calibrated.header.R_CB, calibrated.header.t_CB_m)
    T = se3.compose(T_CB, body_of_imu)
    rig = calibrated.rig
    if rig is not None and rig.T_LB is not None:
        rig = rig.on_body(se3.compose(rig.T_LB, body_of_imu))
    return replace(calibrated, header=replace(calibrated.header, R_CB=T.R, t_CB_m=T.p), rig=rig)


# --- pictures -------------------------------------------------------------------------------------


def _pictures(top: Path, ordered: Sequence[str]) -> tuple[Pictures, list[str]]:
    """Pairs of one time, and the names of pictures that have no partner."""
    left, right = (_listed(top / name) for name in ordered)
    both = sorted(left.keys() & right.keys())
    alone = sorted(left.keys() ^ right.keys())
    where = top / ordered[0], top / ordered[1]
    if images.too_many_alone(len(both), len(alone)):
        raise PelorusError(
            f"{where[0]} and {where[1]}: {len(both)} pairs have equal times, {len(alone)} pictures "
            f"are alone ({alone[0]} ns first); the cameras' times should be the same"
        )
    if len(both) < images.PAIRS_MIN:
        raise PelorusError(f"{top}: {len(both)} pairs; at least {images.PAIRS_MIN} are due")
    pairs = [Pair(left[t], right[t]) for t in both]
    t_ns = np.array(both, np.int64)
    return Pictures(where, t_ns, lambda: images.in_order(pairs)), [str(t) for t in alone]


def _listed(camera: Path) -> dict[int, Path]:
    """By time: of data.csv where there is one, else the names in data/."""
    listing, data = camera / "data.csv", camera / "data"
    if not listing.is_file():
        found = images.pictures(data)
        named = [name for name in found if not (name.isdecimal() and int(name) < NS_MAX)]
        if named:
            raise PelorusError(
                f"{data}: the name {named[0]} is no time in ns, and there is no data.csv beside it"
            )
        return {int(name): path for name, path in found.items()}
    listed: dict[int, Path] = {}
    for line, cells in foreign.rows(listing):
        at = f"line {line}"
        if len(cells) != 2 or not cells[0].isdecimal() or int(cells[0][:20]) >= NS_MAX:
            raise ForeignFileError(
                listing,
                f"holds {' '.join(cells)[:60]!r}",
                at=at,
                due="a time in ns, a file are due",
            )
        path = data / cells[1]
        if not path.is_file():
            raise ForeignFileError(listing, f"names {path}, which is not there", at=at)
        listed[int(cells[0])] = path
    return listed


# --- IMU and truth --------------------------------------------------------------------------------


def _imu(path: Path) -> Inertial:
    if not path.is_file():
        raise PelorusError(
            f"{path}: there is no such file; it, or --twists FILE, or --imu FILE is due"
        )
    rows = foreign.rows(path)
    numbers = foreign.numbers(path, rows, IMU_COLUMNS)
    t_ns = _times(path, rows)
    return Inertial(t_ns, numbers[:, 4:7], numbers[:, 1:4])


def _times(path: Path, rows: list[Row]) -> Times:
    t_ns = np.array([trajectory.whole_ns(path, row) for row in rows], np.int64)
    back = np.nonzero(np.diff(t_ns) <= 0)[0]
    if len(back):
        at = f"line {rows[int(back[0]) + 1].line}"
        raise ForeignFileError(path, "time does not ascend", at=at)
    return t_ns


def _truth(top: Path, body_of_imu: Poses | None) -> Trajectory | None:
    """The IMU's poses: those of the sensor, times where the IMU sits in it."""
    folder = next((top / name for name in TRUTHS if (top / name / "data.csv").is_file()), None)
    if folder is None:
        return None
    t_ns, poses = trajectory.read_stamped(folder / "data.csv")
    T_BS, T_BI = _of_body(folder), body_of_imu
    T_SI = se3.compose(se3.inverse(T_BS or se3.IDENTITY), T_BI or se3.IDENTITY)
    return Trajectory(t_ns, se3.compose(poses, T_SI))
