# SPDX-License-Identifier: MIT
"""Folders of the EuRoC MAV data set (ASL format), and others of the same layout.

mav0/cam0, cam1    data.csv (time in ns, file), data/ with the pictures, sensor.yaml
mav0/imu0          data.csv (ns, gyro rad/s, specific force m/s^2), sensor.yaml
mav0/state_groundtruth_estimate0, mocap0, gt0 or vicon0    data.csv (ns, position, quaternion
                   w x y z), sensor.yaml; the first that is there

Public copies lack some of the pictures that data.csv lists. These are left out, with a count; where
they are many, the folder is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pelorus.converters.streams import Asked, Pictures, Readings, Streams
from pelorus.errors import PelorusError, resolved
from pelorus.io import arrays, foreign, trajectory
from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.io.trajectory import Trajectory
from pelorus.math import motion, se3
from pelorus.math.inertial import Inertial
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.rig import read as rig_files
from pelorus.rig.read import Calibrated
from pelorus.tracking import images
from pelorus.tracking.images import Pair

CAMERAS = ("cam0", "cam1")
IMU = "imu0"
TRUTHS = ("state_groundtruth_estimate0", "mocap0", "gt0", "vicon0")
TUM_VI = "dso"  # Kalibr's files beside mav0, where the cameras have no sensor.yaml
TUM_VI_FILES = ("camchain.yaml", "imu_config.yaml")
POSITIONS = "leica0"  # of a prism, without attitude
IMU_COLUMNS = 7
NS_MAX = 2**63


def read(folder: Path, asked: Asked) -> Streams:
    """Reads a folder."""
    top = _top(folder)
    body = _of_body(top / IMU)
    given, name = asked.calibration, resolved(folder).name
    of_imu = rig_files.are_of_imu(given)  # in addition to the folder's own cameras
    paths = given if given and not of_imu else _calibrations(top, given)
    calibrated = rig_files.read(paths, name, asked.extrinsic, asked.lens, asked.cameras)
    if (not given or of_imu) and asked.extrinsic is None and body is not None:
        calibrated = _on_imu(calibrated, body)
    rig = calibrated.rig
    ordered = tuple(reversed(CAMERAS)) if rig is not None and rig.swapped else CAMERAS
    remarks: list[str] = []
    pictures = _pictures(top, ordered, remarks)
    motion = asked.motion or Readings(top / IMU / "data.csv", _imu(top / IMU / "data.csv", remarks))
    truth = asked.truth or _truth(top, body, remarks)
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


def _calibrations(top: Path, of_imu: tuple[Path, ...]) -> tuple[Path, ...]:
    """Returns the folder's calibration files; the user's files of an IMU replace its own."""
    beside = top.parent / TUM_VI
    if not (top / CAMERAS[0] / "sensor.yaml").is_file() and (beside / "camchain.yaml").is_file():
        camchain, imu = map(beside.joinpath, TUM_VI_FILES)
        return (camchain, *(of_imu or [path for path in (imu,) if path.is_file()]))
    cameras = [top / name / "sensor.yaml" for name in CAMERAS]
    lacking = [path for path in cameras if not path.is_file()]
    if lacking:
        raise PelorusError(
            f"{lacking[0]}: there is no such file; it or --calibration FILE is expected (Kalibr's "
            "camchain YAML, OpenCV's stereo YAML)"
        )
    imu = top / IMU / "sensor.yaml"
    return (*cameras, *(of_imu or [path for path in (imu,) if path.is_file()]))


def _of_body(folder: Path) -> Poses | None:
    """Returns T_BS of a sensor.yaml, sensor to the folder's body; None where there is none."""
    path = folder / "sensor.yaml"
    if not path.is_file():
        return None
    content = Named(path, foreign.yaml_object(path))
    return content.pose("T_BS") if "T_BS" in content else None


def _on_imu(calibrated: Calibrated, body_of_imu: Poses) -> Calibrated:
    """Moves the recording's body to the IMU, which need not be the folder's body."""
    T_CB = Poses(calibrated.header.R_CB, calibrated.header.t_CB_m)
    T = se3.compose(T_CB, body_of_imu)
    rig = calibrated.rig
    if rig is not None and rig.T_LB is not None:
        rig = rig.on_body(se3.compose(rig.T_LB, body_of_imu))
    return replace(calibrated, header=replace(calibrated.header, R_CB=T.R, t_CB_m=T.p), rig=rig)


# --- pictures -------------------------------------------------------------------------------------


def _pictures(top: Path, ordered: Sequence[str], remarks: list[str]) -> Pictures:
    """Returns the pairs of pictures that were taken together."""
    where = top / ordered[0], top / ordered[1]
    (left, lost_left), (right, lost_right) = (_listed(camera, remarks) for camera in where)
    of_left, of_right = _times(left, remarks), _times(right, remarks)
    found = images.together(of_left, of_right, images.APART_NS)
    both, alone = found
    t_ns, partner_ns = of_left[both[:, 0]], of_right[both[:, 1]]
    lost = [*lost_left, *lost_right]
    if images.too_many_alone(len(both), max(alone, len(lost))):
        raise PelorusError(
            f"{where[0]} and {where[1]}: {len(both)} pairs, taken within "
            f"{images.APART_NS * 1e-6:g} ms; {alone} pictures have no partner"
            + (f", {len(lost)} are not there or cut off, {lost[0]} first" if lost else "")
            + ("" if lost else _apart_words(of_left, of_right))
        )
    if len(both) < images.PAIRS_MIN:
        raise PelorusError(f"{top}: {len(both)} pairs; at least {images.PAIRS_MIN} are expected")
    remarks += found.remarks
    if (t_ns != partner_ns).any():
        apart_ms = float(np.abs(t_ns - partner_ns).max()) * 1e-6
        remarks.append(
            f"the two cameras' times differ by up to {apart_ms:.3g} ms: {ordered[0]}'s are taken"
        )
    times = zip(t_ns.tolist(), partner_ns.tolist(), strict=True)
    pairs = [Pair(left[mine], right[theirs]) for mine, theirs in times]
    bits = images.bits_of(pairs, remarks)
    return Pictures(where, t_ns, lambda: images.in_order(pairs, bits))


def _times(listed: dict[int, Path], remarks: list[str]) -> Times:
    """Returns the times in order, without one that was never set."""
    t_ns = np.array(sorted(listed), np.int64)
    unset = arrays.never_set(t_ns)
    if unset.any():
        remarks.append(f"{listed[0]} is left out: {arrays.NEVER_SET}")
    return t_ns[~unset]


def _apart_words(left_ns: Times, right_ns: Times) -> str:
    """Returns in words how far apart the times of cameras without a common trigger are."""
    if not len(left_ns) or not len(right_ns):
        return ""
    apart_ns = np.abs(right_ns[motion.nearest(right_ns, left_ns)] - left_ns)
    return (
        f"; the nearest times are {np.median(apart_ns) * 1e-6:.3g} ms apart in the median, "
        f"{apart_ns.max() * 1e-6:.3g} ms at most: cameras that are triggered together are expected"
    )


def _listed(camera: Path, remarks: list[str]) -> tuple[dict[int, Path], list[Path]]:
    """Returns the existing pictures by time, and the missing ones.

    They are those of data.csv, else the names in data/.
    """
    listing, data = camera / "data.csv", camera / "data"
    there = images.pictures(data)
    if not listing.is_file():
        named = [name for name in there if not (name.isdecimal() and int(name) < NS_MAX)]
        if named:
            raise PelorusError(
                f"{data}: the name {named[0]} is no time in ns, and there is no data.csv beside it"
            )
        return {int(name): path for name, path in there.items()}, []
    named_there: dict[int, Path] = {}
    lost: list[Path] = []
    for line, cells in foreign.rows(listing):
        if len(cells) != 2 or not cells[0].isdecimal() or int(cells[0][:20]) >= NS_MAX:
            raise ForeignFileError(
                listing,
                f"holds {' '.join(cells)[:60]!r}; a time in ns, a file are expected",
                at=f"line {line}",
            )
        path = data / cells[1]
        found = there.pop(path.stem, None)  # a picture may be another kind of file
        if found is not None and images.is_whole(found):
            named_there[int(cells[0])] = found
        elif int(cells[0]) not in named_there:  # a line may stand twice
            lost.append(path)
    if lost:
        remarks.append(
            f"{listing}: {len(lost)} pictures are not there or cut off, {lost[0].name} first"
        )
    if there:
        first = next(iter(there.values()))
        remarks.append(f"{listing}: does not list {len(there)} pictures, {first.name} first")
    return named_there, lost


# --- IMU and truth --------------------------------------------------------------------------------


def _imu(path: Path, remarks: list[str]) -> Inertial:
    if not path.is_file():
        raise PelorusError(
            f"{path}: there is no such file; it, or --twists FILE, or --imu FILE is expected"
        )
    sound = foreign.sound(path, foreign.rows(path), IMU_COLUMNS)
    t_ns = trajectory.times_of(path, sound.rows, in_ns=True)
    good, more = trajectory.ascending(path, sound.rows, t_ns)
    remarks += [*sound.remarks, *more]
    return Inertial(t_ns[good], sound.numbers[good, 4:7], sound.numbers[good, 1:4])


def _truth(top: Path, body_of_imu: Poses | None, remarks: list[str]) -> Trajectory | None:
    """Returns the IMU's poses: those of the sensor, composed with the IMU's place in it."""
    folder = next((top / name for name in TRUTHS if (top / name / "data.csv").is_file()), None)
    if folder is None:
        if (top / POSITIONS / "data.csv").is_file():
            remarks.append(f"{top / POSITIONS}: positions without attitude: not read as the truth")
        return None
    found = trajectory.read_stamped(folder / "data.csv", in_ns=True)
    T_BS, T_BI = _of_body(folder), body_of_imu
    T_SI = se3.compose(se3.inverse(T_BS or se3.IDENTITY), T_BI or se3.IDENTITY)
    return found._replace(poses=se3.compose(found.poses, T_SI))
