# SPDX-License-Identifier: MIT
"""KITTI's own folders.

raw        DATE_drive_NNNN_sync/image_00, image_01 (or 02, 03), oxts; calib_*.txt in DATE above it
odometry   sequences/NN/image_0, image_1 (or 2, 3), calib.txt, times.txt; poses/NN.txt beside them
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy

from pelorus.converters.streams import Asked, Pictures, Streams, Twists
from pelorus.errors import PelorusError, resolved
from pelorus.io import arrays, foreign, trajectory
from pelorus.io.foreign import ForeignFileError
from pelorus.io.trajectory import Trajectory
from pelorus.math import motion, se3
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.program.console import progress
from pelorus.rig import read as rig_files
from pelorus.rig.lens import Lens, LensModel, intrinsics_in
from pelorus.rig.read import Calibrated
from pelorus.rig.rig import Rig
from pelorus.tracking import images
from pelorus.wire.layout import Floats

EARTH_M = 6378137.0
OXTS_NUMBERS = 30
RAW_PAIRS = (("image_00", "image_01"), ("image_02", "image_03"))
ODOMETRY_PAIRS = (("image_0", "image_1"), ("image_2", "image_3"))
AHEAD = np.array([[0, -1.0, 0], [0, 0, -1], [1, 0, 0]])  # of a body x forward, y left, z up
# The truth's first attitude is known to 0.01 rad at best: a smaller sigma would spoil NEES.
OF_TRUTH = {"start-sigma": 0.01}
# Columns of an OXTS packet.
LAT, LON, ALT, ROLL, PITCH, YAW, VF, WX = 0, 1, 2, 3, 4, 5, 8, 17


class Made(NamedTuple):
    """White noise of twists that are made from the truth, for drives that have none."""

    velocity_sigma_mps: float = 0.5
    gyro_sigma_radps: float = 0.05
    seed: int = 1


def is_raw(folder: Path) -> bool:
    """Returns whether it is a raw drive: these have inertial measurements in oxts."""
    return (folder / "oxts").is_dir()


def read(folder: Path, asked: Asked, made: Made) -> Streams:
    """Reads a raw drive or a sequence of the odometry benchmark."""
    found = _raw(folder, asked) if is_raw(folder) else _odometry(folder, asked, made)
    own = found.truth is not None and asked.truth is None
    return replace(found, settings=OF_TRUTH) if own else found


# --- raw ------------------------------------------------------------------------------------------


def _raw(folder: Path, asked: Asked) -> Streams:
    cameras = _cameras(folder, RAW_PAIRS)
    rig = _raw_rig(resolved(folder).parent, cameras)
    pairs = images.pairs(cameras[0] / "data", cameras[1] / "data")
    t_ns = _stamps(cameras[0] / "timestamps.txt", len(pairs))
    packets, oxts_t_ns = _oxts(folder / "oxts")
    truth = asked.truth or Trajectory(oxts_t_ns, _oxts_poses(packets))
    motion = asked.motion or _oxts_twists(folder / "oxts", oxts_t_ns, packets)
    return Streams(_calibrated(folder, rig, asked), _pictures(pairs, t_ns), motion, truth)


def _raw_rig(date: Path, cameras: tuple[Path, Path]) -> Rig:
    """Returns the rig of the rectified pictures; the body is the OXTS unit: forward, left, up."""
    path = date / "calib_cam_to_cam.txt"
    cam = _KittiCalib(path)
    first, second = (int(camera.name[-1]) for camera in cameras)
    P = [cam.array(f"P_rect_{k:02d}", 3, 4) for k in (first, second)]
    size = cam.array(f"S_rect_{first:02d}", 2)
    R_rect = Poses(_near(path, "R_rect_00", cam.array("R_rect_00", 3, 3)), np.zeros(3))
    velo = _KittiCalib(date / "calib_velo_to_cam.txt").pose()
    imu = _KittiCalib(date / "calib_imu_to_velo.txt").pose()
    T_LB = se3.compose(se3.compose(se3.compose(_shift(P[0]), R_rect), velo), imu)
    return replace(_rectified(path, P, (int(size[0]), int(size[1]))), T_LB=T_LB)


def _oxts(folder: Path) -> tuple[Floats, Times]:
    """Returns (n, 30) numbers, and their times."""
    files = sorted((folder / "data").glob("*.txt"))
    if not files:
        raise PelorusError(f"{folder / 'data'}: holds no OXTS packet (0000000000.txt and so on)")
    packets = [
        foreign.numbers(path, foreign.rows(path)[:1], OXTS_NUMBERS)[0]
        for path in progress(files, "reading oxts", len(files))
    ]
    return np.array(packets), _stamps(folder / "timestamps.txt", len(files))


def _oxts_twists(where: Path, t_ns: Times, packets: Floats) -> Twists:
    """Returns body velocities: OXTS has them over level ground (forward, left, up)."""
    level = packets[:, VF : VF + 3]
    tilt = scipy.spatial.transform.Rotation.from_euler("YX", packets[:, [PITCH, ROLL]])
    return Twists(where, t_ns, tilt.inv().apply(level), packets[:, WX : WX + 3])


def _oxts_poses(packets: Floats) -> Poses:
    """Returns poses east, north, up of the first packet, by Mercator as KITTI's devkit."""
    scale = np.cos(np.radians(packets[0, LAT]))
    east = scale * EARTH_M * np.radians(packets[:, LON])
    north = scale * EARTH_M * np.log(np.tan(np.radians(90 + packets[:, LAT]) / 2))
    p = np.stack((east, north, packets[:, ALT]), axis=-1)
    R = scipy.spatial.transform.Rotation.from_euler(
        "ZYX", packets[:, [YAW, PITCH, ROLL]]
    ).as_matrix()
    return Poses(R, p - p[0])


def _stamps(path: Path, count: int) -> Times:
    """Returns the times in a file with a row like 2011-09-30 12:40:25.069324302 each."""
    lines = [line.strip() for line in foreign.text(path).splitlines() if line.strip()]
    if len(lines) != count:
        raise ForeignFileError(
            path, f"has {len(lines)} times; {count} are expected, one for each file in data"
        )
    t_ns = np.array([_stamp(path, k, line) for k, line in enumerate(lines, 1)], np.int64)
    back = np.nonzero(np.diff(t_ns) <= 0)[0]
    if len(back):
        raise ForeignFileError(path, "time does not ascend", at=f"line {int(back[0]) + 2}")
    return t_ns


def _stamp(path: Path, line: int, words: str) -> int:
    whole, _, fraction = words.partition(".")
    try:
        seconds = datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC).timestamp()
        return int(seconds) * 10**9 + int(fraction.ljust(9, "0")[:9] or 0)
    except ValueError:
        what = f"{words[:40]!r} is no time; 2011-09-30 12:40:25.069324302 or such is expected"
        raise ForeignFileError(path, what, at=f"line {line}") from None


# --- odometry -------------------------------------------------------------------------------------


def _odometry(folder: Path, asked: Asked, made: Made) -> Streams:
    cameras = _cameras(folder, ODOMETRY_PAIRS)
    path = folder / "calib.txt"
    calib = _KittiCalib(path)
    P = [calib.array(f"P{camera.name[-1]}", 3, 4) for camera in cameras]
    rig = replace(_rectified(path, P, (0, 0)), T_LB=Poses(AHEAD, np.zeros(3)))
    pairs = images.pairs(*cameras)
    t_ns = images.times(pairs, folder / "times.txt", None)
    calibrated = _calibrated(folder, rig, asked)
    truth = asked.truth or _poses(folder, t_ns, P[0], calibrated)
    if asked.motion is not None:
        return Streams(calibrated, _pictures(pairs, t_ns), asked.motion, truth)
    if truth is None:
        raise PelorusError(
            f"{folder}: the benchmark has no twists, and there is no {_poses_file(folder)} to make "
            "some from; --twists FILE, --imu FILE or --truth FILE is expected"
        )
    noise = replace(
        calibrated.header.noise,
        velocity_sigma_mps=made.velocity_sigma_mps,
        gyro_sigma_radps=made.gyro_sigma_radps,
    )
    calibrated = replace(calibrated, header=replace(calibrated.header, noise=noise))
    said = (
        f"the twists are made from the truth, with white noise of {made.velocity_sigma_mps:g} m/s "
        f"and {made.gyro_sigma_radps:g} rad/s (seed {made.seed}): KITTI's benchmark has none"
    )
    motion = _made_twists(folder, truth, made)
    return Streams(calibrated, _pictures(pairs, t_ns), motion, truth, remarks=[said])


def _poses_file(folder: Path) -> Path:
    own = resolved(folder)
    return own.parents[1] / "poses" / f"{own.name}.txt"


def _poses(folder: Path, t_ns: Times, P: Floats, calibrated: Calibrated) -> Trajectory | None:
    """Returns the poses of camera 0, moved to the body; row k is frame k."""
    path = _poses_file(folder)
    if not path.is_file():
        return None
    poses = trajectory.read_kitti(path)
    if len(poses.p) > len(t_ns):
        raise ForeignFileError(path, f"{len(poses.p)} poses for {len(t_ns)} frames")
    T_0B = se3.compose(
        se3.inverse(_shift(P)), Poses(calibrated.header.R_CB, calibrated.header.t_CB_m)
    )
    return Trajectory(t_ns[: len(poses.p)], trajectory.body_poses(poses, T_0B))


def _made_twists(where: Path, truth: Trajectory, made: Made) -> Twists:
    """Returns noisy twists that move each pose to the next; a reading holds from its time on."""
    if min(made.velocity_sigma_mps, made.gyro_sigma_radps) < 0 or made.seed < 0:
        raise PelorusError("--velocity-sigma, --gyro-sigma and --seed: none may be negative")
    rate = motion.rates(truth.t_ns, truth.poses)
    rate = np.concatenate((rate, rate[-1:]))
    noise = np.random.Generator(np.random.PCG64(made.seed)).standard_normal(rate.shape)
    noise *= np.repeat([made.velocity_sigma_mps, made.gyro_sigma_radps], 3)
    rate += noise
    return Twists(where, truth.t_ns, rate[:, :3], rate[:, 3:])


# --- both -----------------------------------------------------------------------------------------


def _cameras(folder: Path, known: Sequence[tuple[str, str]]) -> tuple[Path, Path]:
    """Returns the two cameras' folders, whose names end with their numbers."""
    for left, right in known:
        if (folder / left).is_dir() and (folder / right).is_dir():
            return folder / left, folder / right
    words = " or ".join(" and ".join(pair) for pair in known)
    try:
        there = ", ".join(sorted(path.name for path in folder.iterdir())[:10]) or "none"
    except OSError as error:
        raise PelorusError(f"{folder}: cannot be read as a folder: {error.strerror}") from error
    raise PelorusError(
        f"{folder}: has no {words}; a raw drive (..._sync, with oxts) or a sequence of the "
        f"odometry benchmark is expected; there are: {there}"
    )


def _calibrated(folder: Path, rig: Rig, asked: Asked) -> Calibrated:
    name = resolved(folder).name
    if asked.calibration:
        return rig_files.read(asked.calibration, name, asked.extrinsic, asked.lens, asked.cameras)
    return rig_files.of_rig(rig, name, asked.extrinsic)


def _pictures(pairs: list[images.Pair], t_ns: Times) -> Pictures:
    where = pairs[0].left.parent, pairs[0].right.parent
    return Pictures(where, t_ns, lambda: images.in_order(pairs))


def _shift(P: Floats) -> Poses:
    """Returns the pose of the camera of this projection beside rectified camera 0."""
    return Poses(np.eye(3), np.array([P[0, 3] / P[0, 0], P[1, 3] / P[1, 1], P[2, 3]]))


def _rectified(path: Path, P: list[Floats], size: tuple[int, int]) -> Rig:
    lenses = [Lens(LensModel.NONE, intrinsics_in(p), (), *size) for p in P]
    baseline = P[0][0, 3] / P[0][0, 0] - P[1][0, 3] / P[1][0, 0]
    if min(P[0][0, 0], P[0][1, 1], baseline) <= 0:
        raise ForeignFileError(path, "has no positive focal length and baseline")
    # the second camera's offset in y and z is less than a tenth of a pixel
    T_RL = Poses(np.eye(3), np.array([-float(baseline), 0.0, 0.0]))
    return Rig.of_cameras(path, lenses[0], replace(lenses[0]), T_RL)


def _near(path: Path, name: str, R: Floats) -> Floats:
    return se3.nearest_rotation(arrays.rotation(path, name, R))


class _KittiCalib:
    """A file with lines of NAME: numbers."""

    def __init__(self, path: Path) -> None:
        self.path = path
        lines = (line.partition(":") for line in foreign.text(path).splitlines())
        self._lines = {name.strip(): words.split() for name, colon, words in lines if colon}

    def array(self, name: str, *shape: int) -> Floats:
        if name not in self._lines:
            there = ", ".join(self._lines) or "none"
            raise ForeignFileError(self.path, f"lacks {name}; there are: {there}")
        try:
            numbers = np.array(self._lines[name], np.float64)
        except ValueError:
            raise ForeignFileError(self.path, f"{name} holds something that is no number") from None
        if numbers.size != int(np.prod(shape)) or not np.isfinite(numbers).all():
            raise ForeignFileError(
                self.path,
                f"{name} has {numbers.size} numbers; {int(np.prod(shape))} finite ones are "
                "expected",
            )
        return numbers.reshape(shape)

    def pose(self) -> Poses:
        """Returns the pose of R and T."""
        return Poses(_near(self.path, "R", self.array("R", 3, 3)), self.array("T", 3))
