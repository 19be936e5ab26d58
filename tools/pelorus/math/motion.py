# SPDX-License-Identifier: MIT
"""Dead reckoning: the path by the twists alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.wire.frames import TwistTiming
from pelorus.wire.layout import Floats

Times = NDArray[np.int64]


def held(readings: Floats, timing: TwistTiming) -> Floats:
    """Returns (n-1, k) what holds on each interval between two of (n, k) readings."""
    if timing is TwistTiming.START:
        return readings[:-1]
    if timing is TwistTiming.END:
        return readings[1:]
    return 0.5 * (readings[:-1] + readings[1:])


def steps(t_ns: Times, v: Floats, w: Floats, timing: TwistTiming) -> Poses:
    """Returns (n-1) motions D_j = T_j^-1 T_j+1 = Exp(tau u) between the times of the readings."""
    tau = (np.diff(t_ns.astype(np.int64)) * 1e-9)[:, None]
    return se3.exp(tau * held(v, timing), tau * held(w, timing))


def rates(t_ns: Times, poses: Poses) -> Floats:
    """Returns (n-1, 6) twists (v, w) in body axes that move each of n poses to the next one."""
    before, after = poses.at(slice(None, -1)), poses.at(slice(1, None))
    tau = np.diff(t_ns)[:, None] * 1e-9
    return np.asarray(se3.log(se3.compose(se3.inverse(before), after)) / tau)


def nearest(t_ns: Times, wanted_t_ns: Times) -> NDArray[np.intp]:
    """Returns the index of the nearest ascending time to each wanted one; of two the earlier."""
    at = np.clip(np.searchsorted(t_ns, wanted_t_ns), 1, max(len(t_ns) - 1, 1))
    before, after = at - 1, np.minimum(at, len(t_ns) - 1)
    earlier = wanted_t_ns - t_ns[before] <= t_ns[after] - wanted_t_ns
    return np.where(earlier, before, after)


def chain(motions: Poses, first: Poses | None = None) -> Poses:
    """Returns T_0, T_0 D_0, T_0 D_0 D_1, ...: n motions give n + 1 poses. T_0 is identity by
    default.

    It uses plain numbers in a fixed order of operations: numpy takes ten times as long over so few.
    """
    count = len(motions.p) + 1
    R, p = np.empty((count, 3, 3)), np.empty((count, 3))
    R[0], p[0] = (np.eye(3), np.zeros(3)) if first is None else first
    rows, place = R[0].tolist(), p[0].tolist()
    for k in range(count - 1):
        u, v, w = motions.p[k].tolist()
        columns = motions.R[k].T.tolist()
        place = [at + (a * u + b * v + c * w) for at, (a, b, c) in zip(place, rows, strict=True)]
        rows = [[a * x + b * y + c * z for x, y, z in columns] for a, b, c in rows]
        R[k + 1], p[k + 1] = rows, place
    return Poses(R, p)


def dead_reckoning(
    t_ns: Times, v: Floats, w: Floats, timing: TwistTiming, first: Poses | None = None
) -> Poses:
    """Returns the n poses at n readings' times, v in m/s and w in rad/s, both in body axes."""
    return chain(steps(t_ns, v, w, timing), first)


def path_at(t_ns: Times, reading_t_ns: Times, v: Floats, w: Floats, timing: TwistTiming) -> Poses:
    """Returns poses at any times from the readings; the pose at the first reading is the origin.

    Between two readings, and after the last one, the latest reading holds; before the first one the
    body rests.
    """
    nodes = dead_reckoning(reading_t_ns, v, w, timing)
    latest = np.maximum(np.searchsorted(reading_t_ns, t_ns, side="right") - 1, 0)
    tau = np.maximum(t_ns.astype(np.int64) - reading_t_ns[latest].astype(np.int64), 0) * 1e-9
    return se3.compose(
        nodes.at(latest), se3.exp(tau[:, None] * v[latest], tau[:, None] * w[latest])
    )


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Returns first and last index of each stretch of True."""
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    begins, ends = np.nonzero(edges == 1)[0], np.nonzero(edges == -1)[0] - 1
    return list(zip(begins.tolist(), ends.tolist(), strict=True))
