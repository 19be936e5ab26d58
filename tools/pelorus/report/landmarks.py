# SPDX-License-Identifier: MIT
"""The page's data on each landmark: place and covariance, when seen, when and why rejected.

There may be too many for a page: those seen least often are left out, and all but every nth of the
rejections.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from pelorus.evaluate.evaluation import made_in, sigmas_m
from pelorus.io.trajectory import Trajectory
from pelorus.math.ellipsoids import Ellipsoids, of_landmarks
from pelorus.report.packed import Packer
from pelorus.wire.evidence import Evidence
from pelorus.wire.frames import Message, Stereo
from pelorus.wire.layout import Floats

LANDMARKS_MOST = 20_000
REJECTIONS_MOST = 60_000
WHY = {1: "rejected by the gate", 2: "far off", 4: "it moves"}  # EVIDENCE's `why`


def packed(shapes: Ellipsoids, packer: Packer) -> dict[str, Any]:
    """Packs ellipsoids: logarithms of the half axes, and x, y, z of a quaternion whose w is
    positive.

    Logarithms, for the axes range from millimetres to kilometres.
    """
    with np.errstate(divide="ignore"):  # -inf means unknown
        half = np.log10(shapes.half_m)
    return {
        "half": [packer.add(half[:, k]) for k in range(3)],
        "turn": [packer.add(shapes.turn[:, k]) for k in range(3)],
    }


class Landmarks:
    """The landmarks that the filter left behind, and the history of each id in the log."""

    def __init__(
        self, messages: Sequence[Message], origin_ns: int, way: Trajectory | None, packer: Packer
    ) -> None:
        self._messages = messages
        self._origin_ns = origin_ns
        self._way = way
        self._packer = packer

    def json(self, left_out: list[str]) -> dict[str, Any]:
        """Returns the data without the columns; adds to `left_out` what is missing."""
        made = {m.id: m for m in made_in(self._messages) if np.isfinite(m.p_W_m).all()}
        kept = sorted(made.values(), key=lambda m: -m.times_seen)[:LANDMARKS_MOST]
        if len(made) > len(kept):
            left_out.append(
                f"{len(made) - len(kept)} of {len(made)} landmarks, those seen least often"
            )
        ids = np.array([m.id for m in kept], np.int64)
        first, last, seen = self._sightings(ids)
        p = np.array([m.p_W_m for m in kept]).reshape(-1, 3)
        exactly = self._packer.add_exactly
        return {
            "id": exactly(ids, "u4"),
            "p": [exactly(p[:, k], "f4") for k in range(3)],
            "sigma": exactly(sigmas_m(kept), "f4"),
            "first": exactly(first, "u4"),
            "last": exactly(last, "u4"),
            "seen": exactly(seen, "u4"),
            "rejected": self._rejections(left_out),
            **packed(of_landmarks(kept, self._nearest(p)), self._packer),
        }

    def _nearest(self, p_W_m: Floats) -> Floats:
        """Returns (n, 3) the nearest point of the path for each."""
        way = np.zeros((1, 3)) if self._way is None else self._way.poses.p
        way = way[np.isfinite(way).all(axis=1)]
        if not len(way) or not len(p_W_m):
            return np.zeros((len(p_W_m), 3))
        return np.asarray(way[scipy.spatial.cKDTree(way).query(p_W_m)[1]])

    def _sightings(self, ids: Any) -> tuple[Any, Any, Any]:
        """Returns first and last frame in which each was seen, ms, and in how many."""
        order = np.argsort(ids)
        first = np.full(len(ids), np.iinfo(np.int64).max)
        last, seen = np.zeros(len(ids), np.int64), np.zeros(len(ids), np.int64)
        for m in self._messages:
            if isinstance(m, Stereo) and len(m.ids) and len(ids):
                found = np.unique(m.ids).astype(np.int64)
                at = order[np.minimum(np.searchsorted(ids, found, sorter=order), len(ids) - 1)]
                at = at[ids[at] == found]
                t_ms = max(m.t_ns - self._origin_ns, 0) // 1_000_000
                first[at] = np.minimum(first[at], t_ms)
                last[at] = np.maximum(last[at], t_ms)
                seen[at] += 1
        return np.where(seen > 0, first, 0), last, seen

    def _rejections(self, left_out: list[str]) -> dict[str, Any]:
        rows = [
            (max(m.t_ns - self._origin_ns, 0) // 1_000_000, m.rejected)
            for m in self._messages
            if isinstance(m, Evidence) and len(m.rejected)
        ]
        when = np.repeat([t for t, _ in rows], [len(r) for _, r in rows]).astype(np.int64)
        names = ("id", "why", "in_succession", "mean2")
        columns = [
            np.concatenate([r[name] for _, r in rows]) if rows else np.zeros(0) for name in names
        ]
        count = len(when)
        if count > REJECTIONS_MOST:
            left_out.append(
                f"{count - REJECTIONS_MOST} of {count} rejections, all but every "
                f"{-(-count // REJECTIONS_MOST)}th"
            )
            every = slice(None, None, -(-count // REJECTIONS_MOST))
            when, columns = when[every], [x[every] for x in columns]
        exactly = self._packer.add_exactly
        kinds = ("u4", "u1", "u2", "f4")
        found = {
            name: exactly(x, kind) for name, x, kind in zip(names, columns, kinds, strict=True)
        }
        return found | {"t": exactly(when, "u4")}
