# SPDX-License-Identifier: MIT
"""Trajectories with times: TUM files (`t x y z qx qy qz qw`), recordings, KITTI poses."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus import kitti, se3, wire
from pelorus.errors import PelorusError
from pelorus.frames import Header, Stereo, Truth
from pelorus.motion import Times
from pelorus.se3 import Poses
from pelorus.wire import Received

TUM_COLUMNS = 8
KITTI_COLUMNS = 12
QUATERNION_NORM_TOLERANCE = 1e-2


class Trajectory(NamedTuple):
    """Body poses at ascending times."""

    t_ns: Times
    poses: Poses


def read_tum(path: Path) -> Trajectory:
    """Times are read as decimals: a double would round today's clock to 0.2 microseconds."""
    rows = _rows(path)
    for number, row in rows:
        if len(row) != TUM_COLUMNS:
            raise PelorusError(
                f"{path}: line {number} has {len(row)} numbers, "
                f"{TUM_COLUMNS} are due: t x y z qx qy qz qw"
            )
    t_ns = np.array([_nanoseconds(path, number, row[0]) for number, row in rows], np.int64)
    back = np.nonzero(np.diff(t_ns) <= 0)[0]
    if len(back):
        raise PelorusError(f"{path}: line {rows[back[0] + 1][0]}: time does not ascend")
    numbers = _numbers(path, [(number, row[1:]) for number, row in rows])
    norms = np.linalg.norm(numbers[:, 3:], axis=1)
    wrong = np.nonzero(np.abs(norms - 1) > QUATERNION_NORM_TOLERANCE)[0]
    if len(wrong):
        raise PelorusError(f"{path}: line {rows[wrong[0]][0]}: the quaternion's norm is not 1")
    return Trajectory(t_ns, Poses(se3.from_quaternion(numbers[:, 3:]), numbers[:, :3]))


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Nine decimals of a second, so that times survive."""
    quaternions = se3.quaternion(trajectory.poses.R)
    lines = [
        f"{t // 10**9}.{t % 10**9:09d} " + " ".join(f"{x:.9f}" for x in (*p, *q))
        for t, p, q in zip(trajectory.t_ns.tolist(), trajectory.poses.p, quaternions, strict=True)
    ]
    try:
        path.write_text("\n".join(lines) + "\n", encoding="ascii")
    except OSError as error:
        raise PelorusError(f"{path}: cannot be written: {error.strerror}") from error


def read_truth(path: Path, times: Path | None = None, recording: Path | None = None) -> Trajectory:
    """A reference: a recording with TRUTH, a TUM file, or KITTI poses.

    KITTI poses need times: a file with one time in seconds a row, or the recording, whose frame k
    row k belongs to; with the recording they are brought from the camera to the body.
    """
    if not path.is_file():
        raise PelorusError(f"{path}: there is no such file")
    if _is_recording(path):
        return truth_of(path)
    columns = len(_rows(path)[0][1])
    if columns == TUM_COLUMNS:
        return read_tum(path)
    if columns == KITTI_COLUMNS:
        return _kitti(path, times, recording)
    raise PelorusError(
        f"{path}: rows of {columns} numbers; {TUM_COLUMNS} (TUM) or {KITTI_COLUMNS} (KITTI) are due"
    )


def truth_of(path: Path) -> Trajectory:
    """TRUTH at the times of STEREO, where the figures are evaluated."""
    received, _ = wire.read_file(path)
    truth = [frame.message for frame in received if isinstance(frame.message, Truth)]
    if not truth:
        raise PelorusError(f"{path}: holds no TRUTH frame")
    frames = _frame_times(received)
    used = {t.t_ns: t for t in truth if t.t_ns in frames}
    if not used:
        raise PelorusError(f"{path}: none of its {len(truth)} TRUTH frames has a STEREO's time")
    t_ns = np.array(sorted(used), np.int64)
    R = np.array([used[t].R_WB for t in t_ns.tolist()])
    return Trajectory(t_ns, Poses(R, np.array([used[t].p_WB_m for t in t_ns.tolist()])))


def _kitti(path: Path, times: Path | None, recording: Path | None) -> Trajectory:
    poses = kitti.read_poses(path)
    if recording is not None:
        received, _ = wire.read_file(recording)
        header: Header = wire.header_of(received, recording)
        t_ns = np.array(sorted(_frame_times(received)), np.int64)
        poses = kitti.body_poses(poses, Poses(header.R_CB, header.t_CB_m))
        whose = recording
    elif times is not None:
        rows = _rows(times)
        t_ns = np.array([_nanoseconds(times, number, row[0]) for number, row in rows], np.int64)
        whose = times
    else:
        raise PelorusError(f"{path}: KITTI poses carry no times: give --recording or --times")
    if len(poses.p) > len(t_ns):
        raise PelorusError(f"{path}: {len(poses.p)} poses, but {whose} has {len(t_ns)} times")
    return Trajectory(t_ns[: len(poses.p)], poses)


def _frame_times(received: list[Received]) -> set[int]:
    return {frame.message.t_ns for frame in received if isinstance(frame.message, Stereo)}


def _is_recording(path: Path) -> bool:
    """A text has no zero byte; a recording has one behind each frame."""
    with path.open("rb") as stream:
        return path.suffix == ".plr" or b"\0" in stream.read(1 << 17)


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line number and cells of each line that is neither blank nor a # comment."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise PelorusError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError:
        raise PelorusError(f"{path}: is no text") from None
    rows = [(n, line.replace(",", " ").split()) for n, line in enumerate(lines, 1)]
    rows = [(n, row) for n, row in rows if row and not row[0].startswith("#")]
    if not rows:
        raise PelorusError(f"{path}: holds no row of numbers")
    return rows


def _numbers(path: Path, rows: list[tuple[int, list[str]]]) -> NDArray[np.float64]:
    out = np.empty((len(rows), len(rows[0][1])))
    for k, (number, row) in enumerate(rows):
        try:
            out[k] = [float(cell) for cell in row]
        except ValueError:
            raise PelorusError(f"{path}: line {number} holds something that is no number") from None
        if not np.isfinite(out[k]).all():
            raise PelorusError(f"{path}: line {number} holds a number that is not finite")
    return out


def _nanoseconds(path: Path, number: int, cell: str) -> int:
    try:
        t_ns = int((Decimal(cell) * 10**9).to_integral_value())
    except (InvalidOperation, ValueError, OverflowError):
        raise PelorusError(f"{path}: line {number}: {cell!r} is no time in seconds") from None
    if not -(2**63) <= t_ns < 2**63:
        raise PelorusError(f"{path}: line {number}: time {cell} s is out of range")
    return t_ns
