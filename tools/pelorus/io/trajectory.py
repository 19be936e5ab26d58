# SPDX-License-Identifier: MIT
"""Trajectories with times: of text files, recordings, KITTI poses.

A text file has a pose a row: time, position, quaternion. What differs from program to program is
told by its columns' names, where it has any, else by what their writers do:

TUM, evo, OpenVINS      s, blanks; x y z w; what stands behind (OpenVINS: covariance) is not used
ORB-SLAM3 (EuRoC)       ns, blanks; x y z w
EuRoC, VINS-Fusion      ns, commas; w x y z; velocity and biases stand behind
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from decimal import Decimal, DecimalException
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.io import arrays, foreign
from pelorus.io.foreign import ForeignFileError, Row
from pelorus.math import se3
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.wire import framing, packed_file
from pelorus.wire.frames import Header, Message, Pose, Stereo, Truth
from pelorus.wire.layout import Floats, stacked, unpack_symmetric

POSE_SIZE = 6
POSE_COLUMNS = 8  # t x y z, a quaternion
KITTI_COLUMNS = 12
EUROC_COLUMNS = 17  # velocity and biases follow; w is first, whatever the separator
QUATERNION_NORM_TOLERANCE = 1e-2
TRUTH_GAP_NS = 250_000_000  # no pose is interpolated across a longer gap
POSITION_NAME = r"(t|p|p_\w+)?_?[xyz]( \[m\])?"
QUATERNION_NAME = r"q\w*?_?([xyzw])( \[\])?"
CELL_SHOWN = 40  # characters of a bad one


class Trajectory(NamedTuple):
    """Body poses at ascending times; `remarks` are on what was read, and left out."""

    t_ns: Times
    poses: Poses
    remarks: tuple[str, ...] = ()


def filled(whole: Trajectory, wanted_t_ns: Times) -> Trajectory:
    """Returns the trajectory with a pose at each wanted time between close enough ones."""
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
    R = scipy.spatial.transform.Slerp(
        own, scipy.spatial.transform.Rotation.from_matrix(whole.poses.R)
    )(seconds).as_matrix()
    p = np.stack([np.interp(seconds, own, x) for x in whole.poses.p.T], axis=-1)
    together = np.concatenate((t_ns, lacking))
    order = np.argsort(together)
    poses = Poses(np.concatenate((whole.poses.R, R)), np.concatenate((whole.poses.p, p)))
    return Trajectory(together[order], poses.at(order), whole.remarks)


def read_stamped(path: Path, in_ns: bool | None = None) -> Trajectory:
    """Reads a text file of poses; by default the times' size and steps give their unit."""
    file = foreign.written(path)
    sound = foreign.sound(path, file.rows, used=POSE_COLUMNS)
    columns = sound.numbers.shape[1]
    if columns < POSE_COLUMNS:
        raise ForeignFileError(
            path,
            f"has {columns} numbers; {POSE_COLUMNS} are expected: t x y z qx qy qz qw",
            at=f"line {sound.rows[0].line}",
        )
    if in_ns is None:
        in_ns = arrays.are_ns(sound.numbers[:, 0])
    by_name = _order_named(path, file.names) if len(file.names) == columns else None
    usual = "wxyz" if in_ns and (file.by_commas or columns == EUROC_COLUMNS) else "xyzw"
    p_at, q_at, order = by_name or (1, 4, usual)
    remarks = list(sound.remarks)
    if in_ns and by_name is None and not file.by_commas and columns != EUROC_COLUMNS:
        remarks.append(f"{path}: times in ns, parted by blanks: the quaternion is read as x y z w")
    if columns > POSE_COLUMNS and columns != EUROC_COLUMNS:
        remarks.append(f"{path}: {columns - POSE_COLUMNS} numbers behind each pose are not used")
    t_ns = times_of(path, sound.rows, in_ns)
    q = sound.numbers[:, q_at : q_at + 4]
    q = np.roll(q, -1, axis=1) if order == "wxyz" else q
    once, repeats = ascending(path, sound.rows, t_ns)
    wrong = off_unit(q)
    what = "the quaternion's norm is not 1"
    turnless = foreign.left_out(path, wrong, lambda k: f"line {sound.rows[k].line}", what)
    good = once & ~wrong
    poses = Poses.of_quaternions(q[good], sound.numbers[good, p_at : p_at + 3])
    return Trajectory(t_ns[good], poses, (*remarks, *repeats, *turnless))


def names_poses(names: list[str]) -> bool:
    """Returns whether columns are named as in such files: tx, p_RS_R_y [m], z, qw and the like."""
    bare = [name.lower() for name in names]
    positions = [name for name in bare if re.fullmatch(POSITION_NAME, name)]
    quaternions = [name for name in bare if re.fullmatch(QUATERNION_NAME, name)]
    return len(positions) == 3 and len(quaternions) == 4


def _order_named(path: Path, names: list[str]) -> tuple[int, int, str] | None:
    """Returns where position and quaternion begin, and its order: q_RS_w [], qx, q_z and such."""
    at: dict[str, int] = {}
    for k, name in enumerate(names):
        found = re.fullmatch(QUATERNION_NAME, name.lower())
        if found:
            at.setdefault(found[1], k)
    if len(at) != 4:
        return None
    order = "".join(sorted(at, key=lambda letter: at[letter]))
    begin = min(at.values())
    if order not in ("xyzw", "wxyz") or max(at.values()) != begin + 3 or begin not in (1, 4):
        raise ForeignFileError(
            path,
            f"names the columns {', '.join(names[:POSE_COLUMNS])}; time, position and quaternion "
            "(x y z w, or w first) are expected, in that order or the quaternion before the "
            "position",
        )
    return (1, 4, order) if begin == 4 else (5, 1, order)


def ascending(
    path: Path, rows: list[Row], t_ns: Times
) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Returns which rows have a time of their own, and remarks on the others."""

    def at(k: int) -> str:
        return f"line {rows[k].line}"

    unset = arrays.never_set(t_ns)
    remarks = foreign.left_out(path, unset, at, arrays.NEVER_SET)
    kept = np.nonzero(~unset)[0]
    step = np.diff(t_ns[kept])
    if (step < 0).any():
        k = int(kept[int((step < 0).argmax()) + 1])
        raise ForeignFileError(path, "time does not ascend", at=at(k))
    again = np.zeros(len(t_ns), np.bool_)
    again[kept[1:][step == 0]] = True
    remarks += foreign.left_out(path, again, at, "time does not ascend but repeats")
    return ~(unset | again), remarks


def off_unit(q: Floats) -> NDArray[np.bool_]:
    """Returns which quaternions (n, 4) are no rotations."""
    return np.asarray(np.abs(np.linalg.norm(q, axis=1) - 1) > QUATERNION_NORM_TOLERANCE, np.bool_)


def read_truth(path: Path, times: Path | None = None, recording: Path | None = None) -> Trajectory:
    """Reads a reference: a recording with TRUTH, a TUM file, EuRoC's, or KITTI poses.

    KITTI poses need times: a file with one time in seconds a row, or the recording, whose frame k
    row k belongs to; with the recording they are moved from the camera to the body.
    """
    if not path.is_file():
        raise ForeignFileError(path, "there is no such file")
    if is_recording(path):
        return truth_of(path)
    columns = len(foreign.written(path).rows[0].cells)
    if columns == KITTI_COLUMNS:
        return _kitti(path, times, recording)
    if columns < POSE_COLUMNS:
        raise ForeignFileError(
            path,
            f"rows of {columns} numbers; {POSE_COLUMNS} or more (TUM, EuRoC) or {KITTI_COLUMNS} "
            "(KITTI) are expected",
        )
    return read_stamped(path)


def truth_of(path: Path) -> Trajectory:
    """Returns the TRUTH at the times of STEREO, where the figures are evaluated."""
    messages = framing.messages_of(path)
    found = truth_in(messages)
    if found is not None:
        return found
    has = any(isinstance(m, Truth) for m in messages)
    what = "no TRUTH frame that is finite" if has else "no TRUTH"
    raise PelorusError(f"{path}: holds {what}; a file of poses can be given in its place")


def truth_in(messages: Sequence[Message]) -> Trajectory | None:
    """Returns the TRUTH at the times of STEREO; of two at one time the later, and finite ones only.

    All of it where none has such a time: then the camera has a clock of its own, and the filter's
    poses are on the other one (setting camera-offset).
    """
    frames = _frame_times(messages)
    whole = {m.t_ns: m for m in messages if isinstance(m, Truth)}
    used = {t: m for t, m in whole.items() if t in frames} or whole
    sound = [m for m in used.values() if is_finite(m)]
    return _ordered(sound) if sound else None


def is_finite(pose: Pose | Truth) -> bool:
    """Returns whether all its numbers are finite."""
    return bool(np.isfinite(pose.R_WB).all() and np.isfinite(pose.p_WB_m).all())


def estimate_in(messages: Sequence[Message]) -> tuple[Trajectory, Floats] | None:
    """Returns a filter's finite poses after STEREO, and covariances (n, 6, 6), NaN if unknown."""
    found = (m for m in messages if isinstance(m, Pose) and m.after_stereo)
    poses = {m.t_ns: m for m in found if is_finite(m)}
    if not poses:
        return None
    estimate = _ordered(list(poses.values()))
    size = POSE_SIZE * (POSE_SIZE + 1) // 2
    unknown = np.full(size, np.nan)
    ordered = [poses[t] for t in estimate.t_ns.tolist()]
    packed = stacked((m.covariance if m.knows_covariance else unknown for m in ordered), size)
    return estimate, unpack_symmetric(packed, POSE_SIZE)


def _ordered(poses: Sequence[Truth | Pose]) -> Trajectory:
    poses = sorted(poses, key=lambda pose: pose.t_ns)
    t_ns = np.array([pose.t_ns for pose in poses], np.int64)
    R = stacked((pose.R_WB for pose in poses), 3, 3)
    p = stacked((pose.p_WB_m for pose in poses), 3)
    return Trajectory(t_ns, Poses(R, p))


def read_kitti(path: Path) -> Poses:
    """Reads C_k, left camera k to world: a row of 12 numbers each, [R | p] row by row.

    Rotations are re-orthonormalised: the files hold 7 digits.
    """
    rows = foreign.rows(path)
    if len(rows[0].cells) != KITTI_COLUMNS:
        raise ForeignFileError(
            path,
            f"has {len(rows[0].cells)} cells; {KITTI_COLUMNS} numbers are expected ([R | p])",
            at=f"line {rows[0].line}",
        )
    numbers = foreign.numbers(path, rows, KITTI_COLUMNS)
    matrices = numbers.reshape(-1, 3, 4)
    R = matrices[:, :, :3]
    off = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    if off.max() > 1e-2:
        at = f"line {rows[int(off.argmax())].line}"
        raise ForeignFileError(path, "holds no rotation; [R | p] is expected, row by row", at=at)
    return Poses(se3.nearest_rotation(R), matrices[:, :, 3])


def body_poses(camera_poses: Poses, T_CB: Poses) -> Poses:
    """Returns T_k = T_CB^-1 C_0^-1 C_k T_CB: the body's poses, the first one is the origin."""
    from_first = se3.compose(se3.inverse(camera_poses.at(0)), camera_poses)
    return se3.compose(se3.compose(se3.inverse(T_CB), from_first), T_CB)


def _kitti(path: Path, times: Path | None, recording: Path | None) -> Trajectory:
    poses = read_kitti(path)
    if recording is not None:
        received, _ = framing.read_file(recording)
        header: Header = framing.header_of(received, recording)
        t_ns = np.array(sorted(_frame_times([frame.message for frame in received])), np.int64)
        poses = body_poses(poses, Poses(header.R_CB, header.t_CB_m))
        whose = recording
    elif times is not None:
        t_ns = times_of(times, foreign.rows(times))
        whose = times
    else:
        raise ForeignFileError(path, "KITTI poses carry no times; give --recording or --times")
    if len(poses.p) > len(t_ns):
        raise ForeignFileError(path, f"{len(poses.p)} poses, but {whose} has {len(t_ns)} times")
    return Trajectory(t_ns[: len(poses.p)], poses)


def _frame_times(messages: Sequence[Message]) -> set[int]:
    return {m.t_ns for m in messages if isinstance(m, Stereo)}


def is_recording(path: Path) -> bool:
    """Returns whether it has a zero byte: a recording has one after each frame, a text none."""
    beginning = foreign.beginning(path)
    return path.suffix == ".plr" or beginning.startswith(packed_file.MAGIC) or b"\0" in beginning


def times_of(path: Path, rows: list[Row], in_ns: bool = False) -> Times:
    """Returns the first cells, s or ns, parsed as decimals: a double would round today's clock."""
    return np.array([_nanoseconds(path, line, cells[0], in_ns) for line, cells in rows], np.int64)


def _nanoseconds(path: Path, line: int, cell: str, in_ns: bool) -> int:
    at, unit = f"line {line}", "ns" if in_ns else "s"
    try:
        t_ns = Decimal(cell).scaleb(0 if in_ns else 9)
        in_range = -(2**63) <= t_ns < 2**63 - 1  # half a nanosecond below the end
    except DecimalException:
        raise ForeignFileError(path, f"{cell[:CELL_SHOWN]!r} is no time in {unit}", at=at) from None
    if not in_range:
        raise ForeignFileError(path, f"time {cell[:CELL_SHOWN]} {unit} is out of range", at=at)
    return int(t_ns.to_integral_value())
