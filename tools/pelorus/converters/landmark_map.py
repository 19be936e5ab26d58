# SPDX-License-Identifier: MIT
"""Reads a map of landmarks from CSV, in which to localise.

Columns: id, x_m, y_m, z_m in the world, and either sigma_m (the same along all axes) or the
covariance cov_xx_m2, cov_yx_m2, cov_yy_m2, cov_zx_m2, cov_zy_m2, cov_zz_m2; optional frame, which
must be world. The ids must be those under which the front end will see the landmarks again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pelorus.io.foreign import ForeignFileError
from pelorus.io.recording import Recording
from pelorus.io.table import Table
from pelorus.io.tracks import Tracks
from pelorus.math.motion import Times
from pelorus.wire import framing
from pelorus.wire.frames import UNKNOWN_VARIANCE, Landmark
from pelorus.wire.layout import Floats, pack_symmetric, unpack_symmetric

ID_MAX = 2**32 - 1
POSITION = ("x_m", "y_m", "z_m")
SIGMA = "sigma_m"
COVARIANCE = ("cov_xx_m2", "cov_yx_m2", "cov_yy_m2", "cov_zx_m2", "cov_zy_m2", "cov_zz_m2")
WORLD = "world"
ROUNDING = 1e-9  # of the largest variance: rounding that a negative variance may be


def convert(source: Path, like: Path) -> Recording:
    """Returns a recording without data: the HEADER of `like`, and the landmarks as known ones."""
    received, _ = framing.read_file(like)
    header = framing.header_of(received, like)
    table = Table.read(source)
    p = table.numbers(*POSITION)
    if not len(p):
        raise ForeignFileError(source, "holds column names but no row")
    frames = table.words("frame") if table.has("frame") else [WORLD] * len(p)
    table.refuse(
        np.array([frame != WORLD for frame in frames]),
        lambda k: (
            f"the landmark is in the frame {frames[k]!r}; landmarks in the world's are expected"
        ),
    )
    P, ids = _covariances(table), table.integers("id", ID_MAX)
    _check(table, ids, P)
    rows = zip(ids.tolist(), p, pack_symmetric(P), strict=True)
    never: Times = np.empty(0, np.int64)
    none = np.empty((0, 3))
    known = [Landmark(id, place, packed) for id, place, packed in rows]
    return Recording(header, never, none, none, never, Tracks.none(), known=known)


def _covariances(table: Table) -> Floats:
    """Returns (n, 3, 3)."""
    if table.has(SIGMA):
        sigma = table.numbers(SIGMA)[:, 0]
        table.refuse(sigma < 0, f"{SIGMA} is negative")
        return np.asarray(sigma[:, None, None] ** 2 * np.eye(3))
    if any(map(table.has, COVARIANCE)):
        return unpack_symmetric(table.numbers(*COVARIANCE), 3)
    raise ForeignFileError(
        table.path,
        f"says nothing of how certain its landmarks are; a column {SIGMA}, or "
        f"{', '.join(COVARIANCE)}, is expected",
    )


def _check(table: Table, ids: NDArray[np.int64], P: Floats) -> None:
    """Refuses duplicate ids, and matrices that are no covariance."""
    _, first, count = np.unique(ids, return_index=True, return_counts=True)
    if (count > 1).any():
        id = ids[first[count > 1][0]]
        rows = table.rows[ids == id]
        raise ForeignFileError(
            table.path,
            f"the id {id} stands {len(rows)} times: rows {rows[0]} and {rows[1]}; which one is "
            "right cannot be told; one each is expected",
        )
    variances = np.diagonal(P, axis1=1, axis2=2)
    most, least = variances.max(axis=1), np.linalg.eigvalsh(P)[:, 0]
    table.refuse(variances.min(axis=1) < 0, "a variance is negative")
    table.refuse(most >= UNKNOWN_VARIANCE, "a variance says that nothing is known")
    table.refuse(most <= 0, "the covariance is zero: nobody knows so well")
    table.refuse(
        least < -ROUNDING * most,
        "the covariance is negative in a direction: a correlation is beyond 1",
    )
