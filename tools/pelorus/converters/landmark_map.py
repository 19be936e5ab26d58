# SPDX-License-Identifier: MIT
"""A map of landmarks, to be localised in: from CSV, or from the PLY of pelorus-replay --map.

CSV  id, x_m, y_m, z_m in the world, and either sigma_m (the same along all axes) or the covariance
     cov_xx_m2, cov_yx_m2, cov_yy_m2, cov_zx_m2, cov_zy_m2, cov_zz_m2; optional frame, which must
     say world
PLY  ASCII, x y z id role times_seen sigma: of the covariance only its mean is left

The ids must be those under which the front end will see the landmarks again.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus import foreign, wire
from pelorus.foreign import ForeignFileError
from pelorus.frames import UNKNOWN_VARIANCE, Header, Landmark, Role
from pelorus.layout import Floats, pack_symmetric, unpack_symmetric
from pelorus.motion import Times
from pelorus.recording import Recording
from pelorus.table import Table
from pelorus.tracks import Tracks

ID_MAX = 2**32 - 1
POSITION = ("x_m", "y_m", "z_m")
SIGMA = "sigma_m"
COVARIANCE = ("cov_xx_m2", "cov_yx_m2", "cov_yy_m2", "cov_zx_m2", "cov_zy_m2", "cov_zz_m2")
WORLD = "world"
PLY_MAGIC, PLY_END, PLY_FRAME = "ply", "end_header", "landmarks in the world, m"
PLY_PROPERTIES = ["x", "y", "z", "id", "role", "times_seen", "sigma"]
ROUNDING = 1e-9  # of the largest variance: so much below zero may a direction be


class Points(NamedTuple):
    """Landmarks as the file has them: `row` is where each stands in it."""

    id: NDArray[np.int64]
    p_W_m: Floats  # (n, 3)
    covariance: Floats  # (n, 3, 3)
    times_seen: NDArray[np.int64]
    row: NDArray[np.int64]
    unit: str  # what a row is called


def convert(source: Path, like: Path) -> Recording:
    """A recording without data: the HEADER of `like`, and the landmarks as known ones."""
    received, _ = wire.read_file(like)
    header = wire.header_of(received, like)
    points = _ply(source) if foreign.beginning(source).startswith(b"ply") else _csv(source)
    _check(source, points)
    known = [
        Landmark(int(id), p, P, Role.KNOWN, 0, int(seen))
        for id, p, P, seen in zip(
            points.id, points.p_W_m, pack_symmetric(points.covariance), points.times_seen,
            strict=True,
        )
    ]  # fmt: skip
    return _without_data(header, known)


def _without_data(header: Header, known: list[Landmark]) -> Recording:
    never: Times = np.empty(0, np.int64)
    nothing = Tracks(0, np.empty(0, np.intp), never, np.empty((0, 4)))
    none = np.empty((0, 3))
    return Recording(header, never, none, none, never, nothing, known=known)


def _csv(path: Path) -> Points:
    table = Table.read(path)
    p = table.numbers(*POSITION)
    if not len(p):
        raise ForeignFileError(path, "holds column names but no row")
    if table.has("frame"):
        _require_world(path, table)
    if table.has(SIGMA):
        sigma = table.numbers(SIGMA)[:, 0]
        _refuse_where(path, sigma < 0, np.arange(len(p)) + 2, "row", f"{SIGMA} is negative")
        P = sigma[:, None, None] ** 2 * np.eye(3)
    elif any(table.has(name) for name in COVARIANCE):
        P = unpack_symmetric(table.numbers(*COVARIANCE), 3)
    else:
        raise ForeignFileError(
            path,
            "says nothing of how certain its landmarks are",
            due=f"a column {SIGMA}, or {', '.join(COVARIANCE)}, is due",
        )
    id = table.integers("id", ID_MAX)
    return Points(id, p, P, np.zeros(len(p), np.int64), np.arange(len(p)) + 2, "row")


def _require_world(path: Path, table: Table) -> None:
    for row, frame in enumerate(table.words("frame"), start=2):
        if frame != WORLD:
            raise ForeignFileError(
                path,
                f"the landmark is in the frame {frame!r}",
                at=f"row {row}",
                due="landmarks in the world's are due",
            )


def _ply(path: Path) -> Points:
    lines = foreign.text(path).splitlines()
    if PLY_END not in lines:
        raise ForeignFileError(path, f"has no {PLY_END}", due="an ASCII PLY is due")
    end = lines.index(PLY_END)
    head = lines[:end]
    properties = [line.split()[-1] for line in head if line.startswith("property ")]
    if "format ascii 1.0" not in head or properties != PLY_PROPERTIES:
        raise ForeignFileError(
            path,
            f"is another PLY, with the properties {' '.join(properties) or 'none'}",
            due=f"one that pelorus-replay --map wrote is due: ASCII, {' '.join(PLY_PROPERTIES)}",
        )
    if not any(PLY_FRAME in line for line in head if line.startswith("comment ")):
        raise ForeignFileError(
            path, "does not say in which frame it is", due=f"a comment '{PLY_FRAME}' is due"
        )
    rows = [
        foreign.Row(number, line.split())
        for number, line in enumerate(lines[end + 1 :], end + 2)
        if line.strip()
    ]
    if not rows:
        raise ForeignFileError(path, "holds no landmark")
    numbers = foreign.numbers(path, rows, len(PLY_PROPERTIES))
    line = np.array([row.line for row in rows], np.int64)
    id, seen, sigma = numbers[:, 3], numbers[:, 5], numbers[:, 6]
    wrong = (id < 0) | (id > ID_MAX) | (id != np.floor(id))
    _refuse_where(path, wrong, line, "line", f"the id is no whole number from 0 to {ID_MAX}")
    wrong = (seen < 0) | (seen > ID_MAX) | (seen != np.floor(seen))
    _refuse_where(path, wrong, line, "line", "times_seen is no count")
    _refuse_where(path, sigma < 0, line, "line", "sigma is negative")
    P = sigma[:, None, None] ** 2 * np.eye(3)
    return Points(id.astype(np.int64), numbers[:, :3], P, seen.astype(np.int64), line, "line")


def _check(path: Path, points: Points) -> None:
    """Refuse ids that stand twice, and what is no covariance."""
    _, first, count = np.unique(points.id, return_index=True, return_counts=True)
    if (count > 1).any():
        id = points.id[first[count > 1][0]]
        rows = points.row[points.id == id]
        raise ForeignFileError(
            path,
            f"the id {id} stands {len(rows)} times: {points.unit}s {rows[0]} and {rows[1]}",
            due="which one is right cannot be told; one each is due",
        )
    P = points.covariance
    variances = np.diagonal(P, axis1=1, axis2=2)
    where = points.row, points.unit
    _refuse_where(path, variances.min(axis=1) < 0, *where, "a variance is negative")
    _refuse_where(
        path,
        variances.max(axis=1) >= UNKNOWN_VARIANCE,
        *where,
        "a variance says that nothing is known",
    )
    _refuse_where(
        path, variances.max(axis=1) <= 0, *where, "the covariance is zero: nobody knows so well"
    )
    least = np.linalg.eigvalsh(P)[:, 0]
    _refuse_where(
        path,
        least < -ROUNDING * variances.max(axis=1),
        *where,
        "the covariance is negative in a direction: a correlation is beyond 1",
    )


def _refuse_where(path: Path, wrong: Any, row: NDArray[np.int64], unit: str, what: str) -> None:
    if wrong.any():
        raise ForeignFileError(path, what, at=f"{unit} {row[np.argmax(wrong)]}")
