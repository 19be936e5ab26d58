# SPDX-License-Identifier: MIT
"""Reads which landmark was seen from where, in a result or a log of a filter."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.io.tracks import Indices
from pelorus.math import se3
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.wire.frames import BodyAxes, Header, Landmark, Message, Pose, Role, Stereo
from pelorus.wire.layout import Floats, unpack_symmetric

# no point is known better: frames round, and the corner of a house is no point
SIGMA_LEAST_M = 0.01
POSE_SIZE, POINT_SIZE = 6, 3
Kind = TypeVar("Kind", bound=Message)


@dataclass(frozen=True)
class Sightings:
    """n frames, m landmarks, k sightings.

    `camera_W` (n, 3) is the left camera's centre. `spread` (m, 3, 3) is a landmark's covariance in
    the world as seen from the camera that saw it last: without the uncertainty of where that camera
    was, which moves the whole neighbourhood and blurs nothing in it.
    """

    path: Path
    name: str
    body_axes: BodyAxes
    t_ns: Times
    poses: Poses
    camera_W: Floats
    landmarks_W: Floats
    spread: Floats
    last_frame: Indices
    times_seen: NDArray[np.int64]
    frame: Indices  # of each sighting
    landmark: Indices


def sightings(path: Path, messages: list[Message]) -> Sightings:
    """Returns landmarks, poses and sightings; raises PelorusError where there is no landmark."""
    header = _all(messages, Header)[0]
    poses = [m for m in _all(messages, Pose) if m.after_stereo and m.knows_covariance]
    poses = list({pose.t_ns: pose for pose in poses}.values())
    landmarks = [m for m in _all(messages, Landmark) if m.role != Role.KNOWN]
    if not landmarks:
        raise PelorusError(
            f"{path}: holds no landmark of a filter (LANDMARK evicted or final), so there is no "
            "map in it: dead reckoning and localization make none"
        )
    poses.sort(key=lambda pose: pose.t_ns)
    t_ns = np.array([pose.t_ns for pose in poses], np.int64)
    placed = [m for m in landmarks if _index(t_ns, np.array([m.t_ns]))[1][0]]
    if not placed:
        raise PelorusError(
            f"{path}: none of its {len(landmarks)} landmarks was last seen at the time of one of "
            f"its {len(t_ns)} poses after a stereo frame"
        )
    placed.sort(key=lambda m: (m.id, m.t_ns))
    where = Poses(np.array([m.R_WB for m in poses]), np.array([m.p_WB_m for m in poses]))
    T_BC = se3.inverse(Poses(np.asarray(header.R_CB), np.asarray(header.t_CB_m)))
    last, _ = _index(t_ns, np.array([m.t_ns for m in placed], np.int64))
    points = np.array([m.p_W_m for m in placed])
    P = unpack_symmetric(np.array([pose.covariance for pose in poses]), POSE_SIZE)
    S = unpack_symmetric(np.array([m.covariance for m in placed]), POINT_SIZE)
    frame, landmark = _who_saw_whom(_all(messages, Stereo), t_ns, placed)
    return Sightings(
        path=path,
        name=header.name or path.name,
        body_axes=header.body_axes,
        t_ns=t_ns,
        poses=where,
        camera_W=se3.apply(where, np.broadcast_to(T_BC.p, where.p.shape)),
        landmarks_W=points,
        spread=_without_pose(S, P[last], where.at(last), points),
        last_frame=last,
        times_seen=np.array([m.times_seen for m in placed], np.int64),
        frame=frame,
        landmark=landmark,
    )


def _all(messages: list[Message], kind: type[Kind]) -> list[Kind]:
    return [m for m in messages if isinstance(m, kind)]


def _index(t_ns: Times, wanted: Times) -> tuple[Indices, NDArray[np.bool_]]:
    """Returns the wanted times' places among the ascending ones, and whether they are there."""
    at = np.searchsorted(t_ns, wanted)
    found = at < len(t_ns)
    found[found] = t_ns[at[found]] == wanted[found]
    return at, found


def _without_pose(S: Floats, P: Floats, T: Poses, points: Floats) -> Floats:
    """Returns S - J P J^T, J = R [I, -[s]x], s the point in the body (docs/MATH.md, the pose's
    error).

    Pose and landmark are correlated, so the difference may be negative in a direction: there the
    landmark has no variance.
    """
    s = se3.apply(se3.inverse(T), points)
    J = np.concatenate((T.R, -T.R @ se3.skew(s)), axis=-1)
    values, axes = np.linalg.eigh(S - J @ P @ np.swapaxes(J, 1, 2))
    values = np.maximum(values, SIGMA_LEAST_M**2)
    return np.asarray((axes * values[:, None]) @ np.swapaxes(axes, 1, 2))


def _who_saw_whom(
    stereos: list[Stereo], t_ns: Times, placed: list[Landmark]
) -> tuple[Indices, Indices]:
    """Returns frame and landmark of each observation.

    An id may come back after its landmark was evicted: a sighting belongs to the first landmark of
    its id that was last seen at that time or later. `placed` is sorted by id, then time.
    """
    seen = [(frame.t_ns, id) for frame in stereos for id in frame.ids.tolist()]
    if not seen:
        none = np.empty(0, np.intp)
        return none, none
    at, id = np.array(seen, np.int64).T
    owners = np.array([(m.id, m.t_ns) for m in placed], np.int64)
    # Times as indices among all times, so that id and time fit one number.
    times = np.unique(np.concatenate((at, owners[:, 1])))
    key = owners[:, 0] * len(times) + np.searchsorted(times, owners[:, 1])
    owner = np.searchsorted(key, id * len(times) + np.searchsorted(times, at))
    frame, good = _index(t_ns, at)
    good &= owner < len(owners)
    good[good] &= owners[owner[good], 0] == id[good]
    return frame[good], owner[good]
