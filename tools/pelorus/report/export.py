# SPDX-License-Identifier: MIT
"""Writes what a filter estimated for other programs: landmarks as CSV or PLY, the path as TUM."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scipy

from pelorus.converters.landmark_map import COVARIANCE, POSITION, WORLD
from pelorus.errors import PelorusError, write_text
from pelorus.evaluate.evaluation import sigmas_m
from pelorus.io.trajectory import estimate_in
from pelorus.wire.frames import Landmark, Message

PLY_HEAD = """ply
format ascii 1.0
comment landmarks in the world, m; role 1: left the state, 2: held at the end
comment sigma: root of the mean variance of an axis, m
element vertex {count}
property double x
property double y
property double z
property uint id
property uchar role
property uint times_seen
property float sigma
end_header
"""


def write_map(path: Path, landmarks: Sequence[Landmark]) -> None:
    """Writes the landmarks in the format of the file's name."""
    if path.suffix not in (".csv", ".ply"):
        raise PelorusError(f"{path}: is neither .csv nor .ply")
    text = _csv(landmarks) if path.suffix == ".csv" else _ply(landmarks)
    write_text(path, text)


def write_tum(path: Path, messages: Sequence[Message]) -> None:
    """Writes the body's poses after each frame, to the nanosecond, for `evaluate` and evo."""
    found = estimate_in(messages)
    if found is None:
        raise PelorusError("there is no pose after a frame to write")
    t_ns, poses = found[0].t_ns, found[0].poses
    turns = scipy.spatial.transform.Rotation.from_matrix(poses.R).as_quat(canonical=True)
    rows = [
        f"{t // 10**9}.{t % 10**9:09d} {_numbers(p, ' ')} {_numbers(q, ' ')}\n"
        for t, p, q in zip(t_ns.tolist(), poses.p, turns, strict=True)
    ]
    write_text(path, "# t x y z qx qy qz qw\n" + "".join(rows))


def _csv(landmarks: Sequence[Landmark]) -> str:
    titles = ("id", *POSITION, *COVARIANCE, "frame")
    rows = [
        ",".join((str(m.id), _numbers((*m.p_W_m, *m.covariance), ","), WORLD)) for m in landmarks
    ]
    return "\n".join((",".join(titles), *rows)) + "\n"


def _ply(landmarks: Sequence[Landmark]) -> str:
    sigmas = sigmas_m(landmarks)
    rows = [
        f"{_numbers(m.p_W_m, ' ')} {m.id} {int(m.role)} {m.times_seen} {sigma:.6g}\n"
        for m, sigma in zip(landmarks, sigmas.tolist(), strict=True)
    ]
    return PLY_HEAD.format(count=len(landmarks)) + "".join(rows)


def _numbers(
    values: Sequence[float] | np.ndarray[tuple[int], np.dtype[np.float64]], by: str
) -> str:
    return by.join(f"{value:.9g}" for value in values)
