# SPDX-License-Identifier: MIT
"""Trajectories with times: TUM files (`t x y z qx qy qz qw`), EuRoC's, recordings, KITTI poses."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal, DecimalException
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from pelorus import foreign, packed_file, se3, wire
from pelorus.errors import PelorusError
from pelorus.foreign import ForeignFileError, Row
from pelorus.frames import Header, Message, Pose, Stereo, Truth
from pelorus.layout import Floats, unpack_symmetric
from pelorus.motion import Times
from pelorus.se3 import Poses

POSE_SIZE = 6
TUM_COLUMNS = 8
KITTI_COLUMNS = 12
EUROC_COLUMNS = (8, 17)  # t x y z qw qx qy qz, and velocity and biases behind them
NS_DIGITS = (16, 19)  # of today's time in ns; seconds have 10 before the point
QUATERNION_NORM_TOLERANCE = 1e-2
TRUTH_GAP_NS = 250_000_000  # between poses so far apart none is made up
CELL_SHOWN = 40  # characters of a bad one


class Trajectory(NamedTuple):
    """Body poses at ascending times."""

    t_ns: Times
    poses: Poses


def filled(whole: Trajectory, wanted_t_ns: Times) -> Trajectory:
    """The same, and one at each wanted time between poses that are near enough in time."""
    t_ns = whole.t_ns
    lacking = np.setdiff1d(wanted_t_ns, t_ns)
    lacking = lacking[(lacking > t_ns[0]) & (lacking < t_ns[-1])]
    after = np.searchsorted(t_ns, lacking)
    near = t_ns[after] - t_ns[after - 1] <= TRUTH_GAP_NS
    lacking, after = lacking[near], after[near]
    if not len(lacking):
        return whole
    first = t_ns[0]
    seconds, own = (lacking - first) * 1e-9, (t_ns - first) * 1e-9
    R = Slerp(own, Rotation.from_matrix(whole.poses.R))(seconds).as_matrix()
    p = np.stack([np.interp(seconds, own, x) for x in whole.poses.p.T], axis=-1)
    together = np.concatenate((t_ns, lacking))
    order = np.argsort(together)
    poses = Poses(np.concatenate((whole.poses.R, R)), np.concatenate((whole.poses.p, p)))
    return Trajectory(together[order], poses.at(order))


def read_tum(path: Path) -> Trajectory:
    """Times are read as decimals: a double would round today's clock to 0.2 microseconds."""
    rows = foreign.rows(path)
    for line, cells in rows:
        if len(cells) != TUM_COLUMNS:
            raise ForeignFileError(
                path,
                f"has {len(cells)} numbers",
                at=f"line {line}",
                due=f"{TUM_COLUMNS} are due: t x y z qx qy qz qw",
            )
    t_ns = _times(path, rows)
    numbers = foreign.numbers(path, [Row(line, cells[1:]) for line, cells in rows])
    return _checked(path, rows, t_ns, numbers[:, :3], numbers[:, 3:])


def read_stamped(path: Path) -> Trajectory:
    """A TUM file, or EuRoC's: its times are whole ns, and the quaternion begins with w."""
    rows = foreign.rows(path)
    cells = rows[0].cells
    stamp = cells[0].isdecimal() and NS_DIGITS[0] <= len(cells[0]) <= NS_DIGITS[1]
    if not (stamp and len(cells) in EUROC_COLUMNS):
        return read_tum(path)
    numbers = foreign.numbers(path, rows)
    t_ns = np.array([whole_ns(path, row) for row in rows], np.int64)
    return _checked(path, rows, t_ns, numbers[:, 1:4], np.roll(numbers[:, 4:8], -1, axis=1))


def whole_ns(path: Path, row: Row) -> int:
    """The time that the row begins with."""
    cell = row.cells[0]
    if not cell.isdecimal() or len(cell) > NS_DIGITS[1] or int(cell) >= 2**63:
        at = f"line {row.line}"
        raise ForeignFileError(path, f"{cell[:CELL_SHOWN]!r} is no time in ns", at=at)
    return int(cell)


def _checked(path: Path, rows: list[Row], t_ns: Times, p: Floats, q: Floats) -> Trajectory:
    """Ascending times, and quaternions x y z w."""
    back = np.nonzero(np.diff(t_ns) <= 0)[0]
    if len(back):
        raise ForeignFileError(path, "time does not ascend", at=f"line {rows[back[0] + 1].line}")
    norms = np.linalg.norm(q, axis=1)
    wrong = np.nonzero(np.abs(norms - 1) > QUATERNION_NORM_TOLERANCE)[0]
    if len(wrong):
        raise ForeignFileError(
            path, "the quaternion's norm is not 1", at=f"line {rows[wrong[0]].line}"
        )
    return Trajectory(t_ns, Poses(Rotation.from_quat(q).as_matrix(), p))


def read_truth(path: Path, times: Path | None = None, recording: Path | None = None) -> Trajectory:
    """A reference: a recording with TRUTH, a TUM file, EuRoC's, or KITTI poses.

    KITTI poses need times: a file with one time in seconds a row, or the recording, whose frame k
    row k belongs to; with the recording they are brought from the camera to the body.
    """
    if not path.is_file():
        raise ForeignFileError(path, "there is no such file")
    if is_recording(path):
        return truth_of(path)
    columns = len(foreign.rows(path)[0].cells)
    if columns in EUROC_COLUMNS:  # as many as TUM's
        return read_stamped(path)
    if columns == KITTI_COLUMNS:
        return _kitti(path, times, recording)
    raise ForeignFileError(
        path,
        f"rows of {columns} numbers",
        due=f"{TUM_COLUMNS} or {EUROC_COLUMNS[1]} (TUM, EuRoC) or {KITTI_COLUMNS} (KITTI) are due",
    )


def truth_of(path: Path) -> Trajectory:
    """TRUTH at the times of STEREO, where the figures are evaluated."""
    messages = wire.messages_of(path)
    found = truth_in(messages)
    if found is not None:
        return found
    raise PelorusError(f"{path}: holds no TRUTH frame that is finite")


def truth_in(messages: Sequence[Message]) -> Trajectory | None:
    """TRUTH at the times of STEREO; of two at one time the later, and none that is not finite.

    All of it where none has such a time: then the camera has a clock of its own, and the filter's
    poses have the other one (setting camera-offset).
    """
    frames = _frame_times(messages)
    whole = {m.t_ns: m for m in messages if isinstance(m, Truth)}
    used = {t: m for t, m in whole.items() if t in frames} or whole
    sound = [m for m in used.values() if np.isfinite(m.R_WB).all() and np.isfinite(m.p_WB_m).all()]
    return _ordered(sound) if sound else None


def estimate_in(messages: Sequence[Message]) -> tuple[Trajectory, Floats] | None:
    """A filter's poses after STEREO with their covariance (n, 6, 6), NaN where it knows none."""
    poses = {m.t_ns: m for m in messages if isinstance(m, Pose) and m.after_stereo}
    if not poses:
        return None
    estimate = _ordered(list(poses.values()))
    unknown = np.full(POSE_SIZE * (POSE_SIZE + 1) // 2, np.nan)
    ordered = [poses[t] for t in estimate.t_ns.tolist()]
    packed = np.array([m.covariance if m.knows_covariance else unknown for m in ordered])
    return estimate, unpack_symmetric(packed, POSE_SIZE)


def _ordered(poses: Sequence[Truth | Pose]) -> Trajectory:
    poses = sorted(poses, key=lambda pose: pose.t_ns)
    t_ns = np.array([pose.t_ns for pose in poses], np.int64)
    R, p = np.array([pose.R_WB for pose in poses]), np.array([pose.p_WB_m for pose in poses])
    return Trajectory(t_ns, Poses(R, p))


def read_kitti(path: Path) -> Poses:
    """C_k, left camera k to world: a row of 12 numbers each, [R | p] row by row.

    Rotations are re-orthonormalised: the files hold 7 digits.
    """
    rows = foreign.rows(path)
    if len(rows[0].cells) != KITTI_COLUMNS:
        raise ForeignFileError(
            path,
            f"has {len(rows[0].cells)} cells",
            at=f"line {rows[0].line}",
            due=f"{KITTI_COLUMNS} numbers are due ([R | p])",
        )
    numbers = foreign.numbers(path, rows, KITTI_COLUMNS)
    matrices = numbers.reshape(-1, 3, 4)
    R = matrices[:, :, :3]
    off = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    if off.max() > 1e-2:
        at = f"line {rows[int(off.argmax())].line}"
        raise ForeignFileError(path, "holds no rotation", at=at, due="[R | p] is due, row by row")
    return Poses(se3.nearest_rotation(R), matrices[:, :, 3])


def body_poses(camera_poses: Poses, T_CB: Poses) -> Poses:
    """T_k = T_CB^-1 C_0^-1 C_k T_CB: the body's poses, the first one is the origin."""
    from_first = se3.compose(se3.inverse(camera_poses.at(0)), camera_poses)
    return se3.compose(se3.compose(se3.inverse(T_CB), from_first), T_CB)


def _kitti(path: Path, times: Path | None, recording: Path | None) -> Trajectory:
    poses = read_kitti(path)
    if recording is not None:
        received, _ = wire.read_file(recording)
        header: Header = wire.header_of(received, recording)
        t_ns = np.array(sorted(_frame_times([frame.message for frame in received])), np.int64)
        poses = body_poses(poses, Poses(header.R_CB, header.t_CB_m))
        whose = recording
    elif times is not None:
        t_ns = _times(times, foreign.rows(times))
        whose = times
    else:
        raise ForeignFileError(
            path, "KITTI poses carry no times", due="give --recording or --times"
        )
    if len(poses.p) > len(t_ns):
        raise ForeignFileError(path, f"{len(poses.p)} poses, but {whose} has {len(t_ns)} times")
    return Trajectory(t_ns[: len(poses.p)], poses)


def _frame_times(messages: Sequence[Message]) -> set[int]:
    return {m.t_ns for m in messages if isinstance(m, Stereo)}


def is_recording(path: Path) -> bool:
    """A text has no zero byte; a recording has one behind each frame."""
    beginning = foreign.beginning(path)
    return path.suffix == ".plr" or beginning.startswith(packed_file.MAGIC) or b"\0" in beginning


def _times(path: Path, rows: list[Row]) -> Times:
    return np.array([_nanoseconds(path, line, cells[0]) for line, cells in rows], np.int64)


def _nanoseconds(path: Path, line: int, cell: str) -> int:
    at = f"line {line}"
    try:
        t_ns = Decimal(cell) * 10**9
        in_range = -(2**63) <= t_ns < 2**63 - 1  # half a nanosecond below the end
    except DecimalException:
        raise ForeignFileError(
            path, f"{cell[:CELL_SHOWN]!r} is no time in seconds", at=at
        ) from None
    if not in_range:
        raise ForeignFileError(path, f"time {cell[:CELL_SHOWN]} s is out of range", at=at)
    return int(t_ns.to_integral_value())
