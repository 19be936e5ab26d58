# SPDX-License-Identifier: MIT
"""Puts readings and frames, which come from several sensors, into the order of their stamps.

And finds what belongs together: pictures of two cameras, a gyro and an accelerometer.

A message's turn comes when nothing earlier is expected: both the motion sensor and the camera have
sent something at least as new, or something newer by `patience` has come, so that a dead sensor
stops nobody. There is no clock in here: time is what the stamps say, and whether they have
jumped says the motion sensor, which sends most: a camera far off is late, or has another clock.
"""

from __future__ import annotations

import heapq
from collections import deque
from dataclasses import dataclass, field
from statistics import median
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from pelorus.eyes.front_end import Seen
from pelorus.faults.sync import PictureDelay, apart
from pelorus.io.tracks import Tracks
from pelorus.wire.frames import Camera, Imu, Reading, Stereo, Twist
from pelorus.wire.layout import Floats

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


# --- what belongs together ------------------------------------------------------------------------


Item = TypeVar("Item")

PICTURES_WAITING = 6  # pictures of one camera that wait for the other's
GAPS_KEPT = 30


class Pair(NamedTuple, Generic[Item]):
    """At the time of the left one."""

    t_ns: int
    left: Item
    right: Item


@dataclass
class Pairing(Generic[Item]):
    """Finds for each left item the right one that was taken within `within_ns` of it."""

    within_ns: int
    alone: int = 0  # left and right ones that had no partner
    paired: int = 0
    _sides: tuple[list[tuple[int, Item]], list[tuple[int, Item]]] = field(
        default_factory=lambda: ([], [])
    )
    _stamps: tuple[deque[int], deque[int]] = field(
        default_factory=lambda: (deque(maxlen=GAPS_KEPT), deque(maxlen=GAPS_KEPT))
    )
    _gaps_ns: deque[int] = field(default_factory=lambda: deque(maxlen=GAPS_KEPT))

    def add(self, is_right: bool, t_ns: int, item: Item) -> Pair[Item] | None:
        """Returns the pair that this item completes; older ones without partner are let go."""
        own, other = self._sides[is_right], self._sides[not is_right]
        self._stamps[is_right].append(t_ns)
        nearest = min(other, key=lambda one: abs(one[0] - t_ns), default=None)
        if nearest is None or abs(nearest[0] - t_ns) > self.within_ns:
            own.append((t_ns, item))
            if len(own) > PICTURES_WAITING:
                self._let_go(is_right, own[0][0])
            return None
        for side in (False, True):
            self._let_go(side, min(t_ns, nearest[0]) - 1)
        other.remove(nearest)
        self.paired += 1
        left, right = (nearest, (t_ns, item)) if is_right else ((t_ns, item), nearest)
        return Pair(left[0], left[1], right[1])

    def _let_go(self, is_right: bool, until_ns: int) -> None:
        side = self._sides[is_right]
        gone = [t_ns for t_ns, _ in side if t_ns <= until_ns]
        side[:] = [one for one in side if one[0] > until_ns]
        self.alone += len(gone)
        others = self._stamps[not is_right]
        self._gaps_ns += [min(abs(t - t_ns) for t in others) for t_ns in gone if others]

    @property
    def usual_gap_ms(self) -> float | None:
        """Returns how far off the nearest one is, as a rule, of those without partner."""
        return median(self._gaps_ns) * 1e-6 if self._gaps_ns else None


@dataclass
class Joining:
    """Makes readings of an IMU of a gyro's and an accelerometer's, which have stamps of their own:
    at the gyro's times, the specific force interpolated between its neighbours.
    """

    _forces: list[tuple[int, Floats]] = field(default_factory=list)
    _rates: list[tuple[int, Floats]] = field(default_factory=list)

    def force(self, t_ns: int, a_B_mps2: Floats) -> list[Imu]:
        """Returns the readings that this specific force completes."""
        if not self._forces or t_ns > self._forces[-1][0]:
            self._forces.append((t_ns, a_B_mps2))
        return self._joined()

    def rate(self, t_ns: int, w_B_radps: Floats) -> list[Imu]:
        """Returns the readings that this turn rate completes."""
        if not self._rates or t_ns > self._rates[-1][0]:
            self._rates.append((t_ns, w_B_radps))
            del self._rates[: -10 * GAPS_KEPT]
        return self._joined()

    def _joined(self) -> list[Imu]:
        made = []
        while self._rates and self._forces and self._rates[0][0] <= self._forces[-1][0]:
            t_ns, w = self._rates.pop(0)
            while len(self._forces) > 1 and self._forces[1][0] <= t_ns:
                self._forces.pop(0)
            before, after = self._forces[0], self._forces[min(1, len(self._forces) - 1)]
            if t_ns < before[0]:
                continue  # nothing is known of the force before the first one
            share = (t_ns - before[0]) / max(after[0] - before[0], 1)
            a = before[1] + share * (after[1] - before[1])
            made.append(Imu(t_ns, np.array([a]), np.array([w])))
        return made


FRAMES, EVERY = 40, 20  # looked at together, and so often


class Together:
    """Judges the last frames now and then; `found` is what they show, None while they are right."""

    def __init__(self, camera: Camera) -> None:
        self.found: PictureDelay | None = None
        self._camera = camera
        self._frames: deque[tuple[int, Seen]] = deque(maxlen=FRAMES)
        self._count = 0

    def add(self, t_ns: int, seen: Seen) -> None:
        """The points of the next frame."""
        self._frames.append((t_ns, seen))
        self._count += 1
        if self._count % EVERY == 0:
            self._look()

    def _look(self) -> None:
        all_seen = [seen for _, seen in self._frames]
        t_ns = np.array([t_ns for t_ns, _ in self._frames], np.int64)
        tracks = Tracks.of_frames([s.ids for s in all_seen], [s.pixels for s in all_seen])
        found = apart(tracks, t_ns, self._camera)
        self.found = found if found is not None and found.found else None
