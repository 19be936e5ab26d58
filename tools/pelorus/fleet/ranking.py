# SPDX-License-Identifier: MIT
"""Which recordings to look at first and why, and what changed since an earlier run.

The worst grade comes first. Within a grade the worst recording of each cause comes before the
second of any: forty logs with one cable in common are one thing to look at. Among those of one
cause a divergence comes first, then what became worse, then the smallest share of good frames.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from statistics import median

from pelorus.fleet.row import BROKEN, Row

GRADES = ("bad", BROKEN, "care", "good")  # as they are looked at
SEVERITY = {"good": 0, "care": 1, "bad": 2, BROKEN: 3}
FIGURES = {  # that are compared with an earlier run: smaller is better
    "ate_m": "ATE, m",
    "err0_m": "error from the start, m",
    "rot_deg": "rotation, degrees",
    "map_rms_m": "map, m",
}


@dataclass(frozen=True)
class Change:
    """A recording whose result differs from that of an earlier run."""

    before: Row
    now: Row

    @property
    def worse(self) -> int:
        """Returns by how much its grade, divergences and events are worse, -1, 0 or 1."""
        then, now = _state(self.before), _state(self.now)
        return (now > then) - (now < then)

    @property
    def is_other_recording(self) -> bool:
        a, b = self.before, self.now
        return (a.bytes, a.modified_ns) != (b.bytes, b.modified_ns)

    def words(self) -> str:
        """Returns what changed, in words."""
        said = [
            f"{name} {was} -> {now}"
            for name, was, now in (
                ("grade", self.before.grade, self.now.grade),
                ("divergences", self.before.diverged, self.now.diverged),
                ("events", self.before.events, self.now.events),
                ("cause", self.before.cause or "none", self.now.cause or "none"),
            )
            if was != now
        ]
        said += ["the recording itself is another one"] * self.is_other_recording
        return ", ".join(said)


def _state(row: Row) -> tuple[int, int, int]:
    return SEVERITY[row.grade], row.diverged or 0, row.events or 0


@dataclass(frozen=True)
class FigureChange:
    """A figure of all recordings that have it in both runs."""

    title: str
    count: int
    before: float  # medians
    now: float
    larger: int
    smaller: int
    most: str  # the recording where it grew most
    most_before: float
    most_now: float


@dataclass(frozen=True)
class Cause:
    """A cause, and the recordings that have it, the first to look at first."""

    name: str
    rows: list[Row]


@dataclass(frozen=True)
class Ranking:
    """The fleet's recordings, the first to look at first."""

    rows: list[Row]
    changes: dict[str, Change] = field(default_factory=dict)
    before: Sequence[Row] = ()

    @property
    def counts(self) -> Counter[str]:
        return Counter(row.grade for row in self.rows)

    @property
    def worse(self) -> list[Change]:
        return [self.changes[row.recording] for row in self.rows if self._worse(row) > 0]

    @property
    def better(self) -> list[Change]:
        return [self.changes[row.recording] for row in self.rows if self._worse(row) < 0]

    def _worse(self, row: Row) -> int:
        change = self.changes.get(row.recording)
        return 0 if change is None else change.worse

    @property
    def new(self) -> int:
        """Returns how many recordings the earlier run did not have."""
        return len(self.rows) - len(self.changes)

    @property
    def gone(self) -> list[str]:
        """Returns the recordings that only the earlier run has."""
        return sorted({row.recording for row in self.before} - {r.recording for r in self.rows})

    @property
    def causes(self) -> list[Cause]:
        """Returns the causes, the most frequent first."""
        found: dict[str, list[Row]] = {}
        for row in self.rows:
            if row.cause is not None:
                found.setdefault(row.cause, []).append(row)
        causes = [Cause(name, rows) for name, rows in found.items()]
        return sorted(causes, key=lambda cause: -len(cause.rows))

    @property
    def figures(self) -> list[FigureChange]:
        """Returns what became of the figures since the earlier run, where the truth is known."""
        made = (self._figure(name, title) for name, title in FIGURES.items())
        return [one for one in made if one is not None]

    def _figure(self, name: str, title: str) -> FigureChange | None:
        pairs = [
            (getattr(change.before, name), getattr(change.now, name), recording)
            for recording, change in self.changes.items()
            if not change.is_other_recording
        ]
        known = [(a, b, r) for a, b, r in pairs if a is not None and b is not None]
        if not known:
            return None
        a, b, recording = max(known, key=lambda pair: pair[1] - pair[0])
        return FigureChange(
            title, len(known), median(x for x, _, _ in known), median(x for _, x, _ in known),
            sum(y > x for x, y, _ in known), sum(y < x for x, y, _ in known), recording, a, b,
        )  # fmt: skip

    def summary(self) -> str:
        """Returns the result in a sentence."""
        count = self.counts
        said = [
            f"{count['bad']} of {len(self.rows)} recordings cannot be trusted",
            f"{count['care']} with care",
            f"{count['good']} can",
        ]
        said += [f"{count[BROKEN]} could not be judged"] * bool(count[BROKEN])
        words = ", ".join(said)
        if self.before:
            words += f"; since the earlier run {len(self.worse)} became worse and "
            words += f"{len(self.better)} better"
        return words


def rank(rows: Iterable[Row], before: Sequence[Row] = ()) -> Ranking:
    """Ranks the rows; `before` are those of an earlier run."""
    earlier = {row.recording: row for row in before}
    rows = list(rows)
    changes = {
        row.recording: Change(earlier[row.recording], row)
        for row in rows
        if row.recording in earlier
    }

    def urgency(row: Row) -> tuple[int, int, int, float, int, str]:
        change = changes.get(row.recording)
        worse = 0 if change is None else change.worse
        good = 0.0 if row.good_share is None else row.good_share
        return (
            GRADES.index(row.grade), -(row.diverged or 0), -worse, good, -(row.events or 0),
            row.recording,
        )  # fmt: skip

    met: Counter[tuple[str, str | None]] = Counter()
    placed = []
    for row in sorted(rows, key=urgency):
        placed.append((GRADES.index(row.grade), met[row.grade, row.cause], row))
        met[row.grade, row.cause] += 1
    placed.sort(key=lambda one: one[:2])  # stable: within a round by urgency
    return Ranking([row for _, _, row in placed], changes, before)
