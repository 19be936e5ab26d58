# SPDX-License-Identifier: MIT
"""Finds readings of small sensors that contradict the filter: slipping wheels, a wrong position."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pelorus.explain.incident import Cause, Incident
from pelorus.explain.log import FilterLog, runs
from pelorus.io.small_sensors import name_of
from pelorus.wire.frames import Message, Reading
from pelorus.wire.schema import SENSORS, number

REJECTED = number("reason", "READINGS_REJECTED")
FRAMES_LEAST = 2  # frames: a single one is no event


def of_small(log: FilterLog, messages: Sequence[Message]) -> Iterator[Incident]:
    """Yields stretches of frames with rejected readings, with sensors and the wheels' error."""
    readings = [m for m in messages if isinstance(m, Reading)]
    for first, last in runs(log.said(REJECTED)):
        begin, end = int(log.t_ns[max(first - 1, 0)]), int(log.t_ns[last])
        meanwhile = [m for m in readings if begin <= m.t_ns <= end]
        if last - first + 1 < FRAMES_LEAST or not meanwhile:
            continue
        names = ", ".join(sorted({name_of(m.sensor) for m in meanwhile}))
        words = f"readings of {names} are rejected, or off by more than their sigma"
        yield Incident(Cause.READINGS_OFF, begin, end, words + _rolled(log, meanwhile))


def _rolled(log: FilterLog, readings: Sequence[Reading]) -> str:
    """Returns the forward speed by wheels and by the filter, in words."""
    ahead = [m for m in readings if m.sensor == SENSORS["wheel"] and m.axes & 1]
    poses = [pose for pose in log.poses if pose is not None]
    if not ahead or not poses:
        return ""
    at = np.searchsorted([pose.t_ns for pose in poses], [m.t_ns for m in ahead])
    known = [poses[k].v_B_mps[0] for k in np.minimum(at, len(poses) - 1)]
    wheels = float(np.median([m.value[0] for m in ahead]))
    return f": wheels {wheels:.2f} m/s ahead where the body goes {np.median(known):.2f} m/s"
