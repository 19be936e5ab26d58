# SPDX-License-Identifier: MIT
"""Reads a map of landmarks from CSV, in which to localise.

Columns: id, x_m, y_m, z_m in the world, and either sigma_m (the same along all axes) or the
covariance cov_xx_m2, cov_yx_m2, cov_yy_m2, cov_zx_m2, cov_zy_m2, cov_zz_m2; optional frame, which
must be world. The ids must be those under which the front end will see the landmarks again.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.io.foreign import ForeignFileError
from pelorus.io.recording import Recording
from pelorus.io.table import Table
from pelorus.io.tracks import Tracks
from pelorus.math.motion import Times
from pelorus.wire import framing
from pelorus.wire.frames import UNKNOWN_VARIANCE, Header, Landmark
from pelorus.wire.layout import Floats, pack_symmetric, unpack_symmetric

ID_MAX = 2**32 - 1
POSITION = ("x_m", "y_m", "z_m")
SIGMA = "sigma_m"
COVARIANCE = ("cov_xx_m2", "cov_yx_m2", "cov_yy_m2", "cov_zx_m2", "cov_zy_m2", "cov_zz_m2")
WORLD = "world"
ROUNDING = 1e-9  # of the largest variance: rounding that a negative variance may be


class MapPoints(NamedTuple):
    """Landmarks as the file has them; `row` is each one's row in it."""

    id: NDArray[np.int64]
    p_W_m: Floats  # (n, 3)
    covariance: Floats  # (n, 3, 3)
    row: NDArray[np.int64]


def convert(source: Path, like: Path) -> Recording:
    """Returns a recording without data: the HEADER of `like`, and the landmarks as known ones."""
    received, _ = framing.read_file(like)
    header = framing.header_of(received, like)
    points = _csv(source)
    _check(source, points)
    packed = pack_symmetric(points.covariance)
    known = [
        Landmark(int(id), p, P) for id, p, P in zip(points.id, points.p_W_m, packed, strict=True)
    ]
    return _without_data(header, known)


def _without_data(header: Header, known: list[Landmark]) -> Recording:
    never: Times = np.empty(0, np.int64)
    none = np.empty((0, 3))
    return Recording(header, never, none, none, never, Tracks.none(), known=known)


def _csv(path: Path) -> MapPoints:
    table = Table.read(path)
    p = table.numbers(*POSITION)
    if not len(p):
        raise ForeignFileError(path, "holds column names but no row")
    if table.has("frame"):
        _require_world(path, table)
    if table.has(SIGMA):
        sigma = table.numbers(SIGMA)[:, 0]
        _refuse_where(path, sigma < 0, np.arange(len(p)) + table.first_row, f"{SIGMA} is negative")
        P = sigma[:, None, None] ** 2 * np.eye(3)
    elif any(table.has(name) for name in COVARIANCE):
        P = unpack_symmetric(table.numbers(*COVARIANCE), 3)
    else:
        raise ForeignFileError(
            path,
            f"says nothing of how certain its landmarks are; a column {SIGMA}, or "
            f"{', '.join(COVARIANCE)}, is expected",
        )
    id = table.integers("id", ID_MAX)
    return MapPoints(id, p, P, np.arange(len(p)) + table.first_row)


def _require_world(path: Path, table: Table) -> None:
    for row, frame in enumerate(table.words("frame"), start=table.first_row):
        if frame != WORLD:
            raise ForeignFileError(
                path,
                f"the landmark is in the frame {frame!r}; landmarks in the world's are expected",
                at=f"row {row}",
            )


def _check(path: Path, points: MapPoints) -> None:
    """Refuses duplicate ids, and matrices that are no covariance."""
    _, first, count = np.unique(points.id, return_index=True, return_counts=True)
    if (count > 1).any():
        id = points.id[first[count > 1][0]]
        rows = points.row[points.id == id]
        raise ForeignFileError(
            path,
            f"the id {id} stands {len(rows)} times: rows {rows[0]} and {rows[1]}; which one is "
            "right cannot be told; one each is expected",
        )
    P = points.covariance
    variances = np.diagonal(P, axis1=1, axis2=2)
    where = points.row
    _refuse_where(path, variances.min(axis=1) < 0, where, "a variance is negative")
    _refuse_where(
        path,
        variances.max(axis=1) >= UNKNOWN_VARIANCE,
        where,
        "a variance says that nothing is known",
    )
    _refuse_where(
        path, variances.max(axis=1) <= 0, where, "the covariance is zero: nobody knows so well"
    )
    least = np.linalg.eigvalsh(P)[:, 0]
    _refuse_where(
        path,
        least < -ROUNDING * variances.max(axis=1),
        where,
        "the covariance is negative in a direction: a correlation is beyond 1",
    )


def _refuse_where(path: Path, wrong: Any, row: NDArray[np.int64], what: str) -> None:
    if wrong.any():
        raise ForeignFileError(path, what, at=f"row {row[np.argmax(wrong)]}")
