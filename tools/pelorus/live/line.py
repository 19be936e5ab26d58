# SPDX-License-Identifier: MIT
"""How it goes, on one line, and what has changed, once."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np

from pelorus.online.diagnosis import Status
from pelorus.online.odometry import Odom
from pelorus.wire import schema

RATE_OVER_NS = 2_000_000_000
NUMBERS = re.compile(r"[-+]?\d[\d.e+-]*")


class HealthLine:
    """`12.3 s  x 1.23  y 0.10  z 0.02 m +-0.012  yaw 12.3 deg +-0.2  good  42 points  20 Hz`."""

    def __init__(self) -> None:
        self._begin_ns: int | None = None
        self._frames: deque[int] = deque()

    def of(self, odom: Odom) -> str:
        """Returns the line after a pose."""
        self._begin_ns = odom.t_ns if self._begin_ns is None else self._begin_ns
        self._frames.append(odom.t_ns)
        while self._frames[-1] - self._frames[0] > RATE_OVER_NS:
            self._frames.popleft()
        span_s = (self._frames[-1] - self._frames[0]) * 1e-9
        rate = f"  {(len(self._frames) - 1) / span_s:.0f} Hz" if span_s > 0 else ""
        x, y, z = odom.T_OB.p
        yaw = np.degrees(np.arctan2(odom.T_OB.R[1, 0], odom.T_OB.R[0, 0]))
        place, turn = np.sqrt(np.diag(odom.covariance).reshape(2, 3).sum(axis=1))
        report = odom.estimate.report
        points = "no frame" if report is None else f"{report.used} points"
        health = schema.HEALTHS.get(odom.estimate.health, str(odom.estimate.health))
        return (
            f"{(odom.t_ns - self._begin_ns) * 1e-9:.1f} s  x {x:.3f}  y {y:.3f}  z {z:.3f} m "
            f"+-{place:.2g}  yaw {yaw:.1f} deg +-{np.degrees(turn):.2g}  {health}  {points}{rate}"
        )


class News:
    """What was not said before; numbers that change are no news."""

    def __init__(self) -> None:
        self._said: set[str] = set()

    def of(self, found: Sequence[Status]) -> Iterator[str]:
        """Returns a line for each thing that is new, and forgets what has passed."""
        now = {f"{one.name}: {NUMBERS.sub('#', one.message)}": one for one in found}
        fresh = [one for key, one in now.items() if key not in self._said]
        self._said = set(now)
        for one in fresh:
            yield f"{one.name}: {one.message}" + (f"; {one.do}" if one.do else "")
