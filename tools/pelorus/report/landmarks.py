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


def landmarks_json(
    messages: Sequence[Message],
    origin_ns: int,
    way: Trajectory | None,
    packer: Packer,
    left_out: list[str],
) -> dict[str, Any]:
    """Returns the landmarks that the filter left behind, and the history of each id in the log.

    Without the columns, which are in the packer; adds to `left_out` what is missing.
    """
    made = {m.id: m for m in made_in(messages) if np.isfinite(m.p_W_m).all()}
    kept = sorted(made.values(), key=lambda m: -m.times_seen)[:LANDMARKS_MOST]
    if len(made) > len(kept):
        left_out.append(f"{len(made) - len(kept)} of {len(made)} landmarks, those seen least often")
    ids = np.array([m.id for m in kept], np.int64)
    first, last, seen = _sightings(messages, origin_ns, ids)
    p = np.array([m.p_W_m for m in kept]).reshape(-1, 3)
    exactly = packer.add_exactly
    return {
        "id": exactly(ids, "u4"),
        "p": [exactly(p[:, k], "f4") for k in range(3)],
        "sigma": exactly(sigmas_m(kept), "f4"),
        "first": exactly(first, "u4"),
        "last": exactly(last, "u4"),
        "seen": exactly(seen, "u4"),
        "rejected": _rejections(messages, origin_ns, packer, left_out),
        **packed(of_landmarks(kept, _nearest(way, p)), packer),
    }


def _nearest(way: Trajectory | None, p_W_m: Floats) -> Floats:
    """Returns (n, 3) the nearest point of the path for each."""
    points = np.zeros((1, 3)) if way is None else way.poses.p
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points) or not len(p_W_m):
        return np.zeros((len(p_W_m), 3))
    return np.asarray(points[scipy.spatial.cKDTree(points).query(p_W_m)[1]])


def _ms(t_ns: int, origin_ns: int) -> int:
    return max(t_ns - origin_ns, 0) // 1_000_000


def _sightings(messages: Sequence[Message], origin_ns: int, ids: Any) -> tuple[Any, Any, Any]:
    """Returns first and last frame in which each was seen, ms, and in how many."""
    order = np.argsort(ids)
    first = np.full(len(ids), np.iinfo(np.int64).max)
    last, seen = np.zeros(len(ids), np.int64), np.zeros(len(ids), np.int64)
    for m in messages:
        if isinstance(m, Stereo) and len(m.ids) and len(ids):
            found = np.unique(m.ids).astype(np.int64)
            at = order[np.minimum(np.searchsorted(ids, found, sorter=order), len(ids) - 1)]
            at = at[ids[at] == found]
            t_ms = _ms(m.t_ns, origin_ns)
            first[at] = np.minimum(first[at], t_ms)
            last[at] = np.maximum(last[at], t_ms)
            seen[at] += 1
    return np.where(seen > 0, first, 0), last, seen


def _rejections(
    messages: Sequence[Message], origin_ns: int, packer: Packer, left_out: list[str]
) -> dict[str, Any]:
    told = [m for m in messages if isinstance(m, Evidence) and len(m.rejected)]
    times, counts = [_ms(m.t_ns, origin_ns) for m in told], [len(m.rejected) for m in told]
    when = np.repeat(times, counts).astype(np.int64)
    kinds = {"id": "u4", "why": "u1", "in_succession": "u2", "mean2": "f4"}
    every = -(-len(when) // REJECTIONS_MOST) or 1
    if every > 1:
        left_out.append(
            f"{len(when) - REJECTIONS_MOST} of {len(when)} rejections, all but every {every}th"
        )
    found = {}
    for name, kind in kinds.items():
        column = np.concatenate([m.rejected[name] for m in told]) if told else np.zeros(0)
        found[name] = packer.add_exactly(column[::every], kind)
    return found | {"t": packer.add_exactly(when[::every], "u4")}
