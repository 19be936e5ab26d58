# SPDX-License-Identifier: MIT
"""Puts readings and frames, which come from several sensors, into the order of their stamps.

A message's turn comes when nothing earlier is expected: both the motion sensor and the camera have
sent something at least as new, or something newer by `patience` has come, so that a dead sensor
stops nobody. There is no clock in here: time is what the stamps say, and whether they have
jumped says the motion sensor, which sends most: a camera far off is late, or has another clock.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from typing import NamedTuple

from pelorus.wire.frames import Imu, Reading, Stereo, Twist

Datum = Imu | Twist | Reading | Stereo

MOTION = 0
RANKS: dict[type[Datum], int] = {Imu: MOTION, Twist: MOTION, Reading: 1, Stereo: 2}
AGREEING = 3  # so many stamps in a row make a step of the clock; one or two are outliers
WAITING_MAX = 4096


class ClockStep(NamedTuple):
    """The stamps went on from another time: what follows has no known relation to what was."""

    from_ns: int
    to_ns: int


@dataclass
class Counts:
    """What was left out."""

    late: int = 0  # its turn was over, or it came twice
    off_clock: int = 0  # its stamp is far from all others
    steps: int = 0  # of the clock


@dataclass
class Sequencer:
    """`gap_ns` is the longest pause that the filter bridges; a larger jump of stamps is a step."""

    patience_ns: int
    gap_ns: int
    counts: Counts = field(default_factory=Counts)
    late_by_ns: int = 0  # how late the last late message was
    off_by_ns: int = 0  # how far off the last stamp was that is far from all others
    _waiting: list[tuple[int, int, int, Datum]] = field(default_factory=list)
    _newest: dict[bool, int] = field(default_factory=dict)  # by whether it is a camera's
    _released: tuple[int, int] = (-1, 0)
    _off: list[Datum] = field(default_factory=list)
    _number: int = 0

    def add(self, datum: Datum) -> list[Datum | ClockStep]:
        """Returns the messages whose turn has come, in order."""
        newest = self._newest.get(False, max(self._newest.values(), default=datum.t_ns))
        if abs(datum.t_ns - newest) > self.gap_ns:
            return self._far(datum, newest)
        if RANKS[type(datum)] == MOTION:
            self.counts.off_clock += len(self._off)
            self._off = []
        self._keep(datum)
        return list(self._due())

    def flush(self) -> list[Datum | ClockStep]:
        """Returns all that waits: nothing else will come."""
        rest = [datum for _, _, _, datum in sorted(self._waiting)]
        self._waiting = []
        return list(rest)

    def _far(self, datum: Datum, newest: int) -> list[Datum | ClockStep]:
        self.off_by_ns = datum.t_ns - newest
        if RANKS[type(datum)] != MOTION:
            self.counts.off_clock += 1
            return []
        if self._off and not 0 < datum.t_ns - self._off[-1].t_ns <= self.gap_ns:
            self.counts.off_clock += len(self._off)
            self._off = []
        self._off.append(datum)
        if len(self._off) < AGREEING:
            return []
        agreed, self._off = self._off, []
        out = self.flush()
        out.append(ClockStep(newest, agreed[0].t_ns))
        self.counts.steps += 1
        self._newest, self._released = {}, (-1, 0)
        for one in agreed:
            self._keep(one)
        return [*out, *self._due()]

    def _keep(self, datum: Datum) -> None:
        key = datum.t_ns, RANKS[type(datum)]
        twice = (
            any(key == (t, rank) for t, rank, _, _ in self._waiting) and key[1] != RANKS[Reading]
        )
        if key <= self._released or twice:
            self.counts.late += 1
            self.late_by_ns = self._released[0] - datum.t_ns
            return
        self._number += 1
        heapq.heappush(self._waiting, (*key, self._number, datum))
        if not isinstance(datum, Reading):
            camera = isinstance(datum, Stereo)
            self._newest[camera] = max(self._newest.get(camera, datum.t_ns), datum.t_ns)

    def _due(self) -> list[Datum]:
        newest = max(self._newest.values(), default=-1)
        certain = min(self._newest.values()) if len(self._newest) == 2 else -1
        until = max(certain, newest - self.patience_ns)
        out = []
        while self._waiting and (self._waiting[0][0] <= until or len(self._waiting) > WAITING_MAX):
            t_ns, rank, _, datum = heapq.heappop(self._waiting)
            self._released = t_ns, rank
            out.append(datum)
        return out
