# SPDX-License-Identifier: MIT
"""Which recordings to look at first and why, what changed since an earlier run; as a page.

The worst grade comes first. Within a grade the worst recording of each cause comes before the
second of any: forty logs with one cable in common are one thing to look at. Among those of one
cause a divergence comes first, then what became worse, then the smallest share of good frames.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from pelorus.fleet.table import BROKEN, Row
from pelorus.report.page import Answer, PageTable, write

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


FIRST_MOST = 20  # recordings of the first table
COMMANDS_MOST = 5
ORDER = (
    "The worst grade comes first, and within a grade the worst recording of each cause before the "
    "second of any. Among those of one cause: divergences, what became worse, the smallest share "
    "of good frames. Good: share of the frames whose health is good. ATE: RMS position error after "
    "the best rigid fit, where the recording knows the truth. NIS: innovations a degree of "
    "freedom, NEES/6: errors; 1 is expected of both. A log longer than ten minutes or so is "
    "explained in pieces; its grade is that of the worst."
)
TITLES = ("recording", "grade", "cause", "why", "what to do", "good", "ATE m", "NEES/6", "since")


def write_page(
    path: Path, ranking: Ranking, name: str, earlier: str | None, folder: Path | None
) -> None:
    """Writes the page; `folder` is where the recordings are, if that is known."""
    grade = "bad" if ranking.counts["bad"] + ranking.counts[BROKEN] else "care"
    if len(ranking.rows) == ranking.counts["good"]:
        grade = "good"
    write(
        path,
        Answer(
            f"Pelorus fleet: {name}",
            grade,
            f"{ranking.summary()}.",
            _facts(ranking, earlier),
            lines=_lines(ranking),
            tables=list(_tables(ranking, earlier)),
            commands=_commands(ranking, folder),
        ),
    )


def _facts(ranking: Ranking, earlier: str | None) -> str:
    rows = ranking.rows
    hours = sum(row.duration_s or 0 for row in rows) / 3600
    way = sum(row.path_m or 0 for row in rows) / 1000
    size = sum(row.bytes for row in rows) / 1e6
    words = f"{len(rows)} recordings, {hours:.1f} h, {way:.1f} km, {size:.0f} MB."
    if earlier is not None:
        words += f" Compared with {earlier}, which lacks {ranking.new} of them"
        words += f"; {len(ranking.gone)} of its recordings are gone." if ranking.gone else "."
    return words


def _lines(ranking: Ranking) -> list[str]:
    return [
        f"{cause.name}: {len(cause.rows)} recording{'s' * (len(cause.rows) > 1)}, first "
        f"{cause.rows[0].recording}"
        for cause in ranking.causes[:COMMANDS_MOST]
    ]


def _tables(ranking: Ranking, earlier: str | None) -> Iterator[PageTable]:
    wanting = [row for row in ranking.rows if row.grade != "good"]
    if wanting:
        yield PageTable("Look at these first", _listed(ranking, wanting[:FIRST_MOST]), ORDER)
    if ranking.causes:
        rows = [
            (cause.name, str(len(cause.rows)), ", ".join(r.recording for r in cause.rows[:3]))
            for cause in ranking.causes
        ]
        yield PageTable("What is wrong, and how often", [("cause", "recordings", "first"), *rows])
    if earlier is not None:
        for title, changes in (
            (f"Worse than in {earlier}", ranking.worse),
            (f"Better than in {earlier}", ranking.better),
        ):
            if changes:
                rows = [(c.now.recording, c.words(), why(c.now)) for c in changes]
                yield PageTable(title, [("recording", "what changed", "why"), *rows])
        if ranking.figures:
            head = (
                "figure",
                "recordings",
                "median before",
                "now",
                "larger in",
                "smaller in",
                "most",
            )
            yield PageTable(f"Errors beside {earlier}", [head, *map(_figure, ranking.figures)])
    broken = [(row.recording, row.error or "") for row in ranking.rows if row.grade == BROKEN]
    if broken:
        yield PageTable("Could not be judged", [("recording", "error"), *broken])
    if ranking.rows:
        yield PageTable("All recordings", _listed(ranking, ranking.rows), ORDER, folded=True)


def _listed(ranking: Ranking, rows: Sequence[Row]) -> list[tuple[str, ...]]:
    has_earlier = bool(ranking.before)
    head = ("", *TITLES)[: None if has_earlier else -1]
    out = [head]
    for number, row in enumerate(rows, 1):
        cells = (
            str(number), row.recording, row.grade, row.cause or "-", why(row),
            row.what_to_do or "-", _share(row.good_share), _figured(row.ate_m),
            _figured(row.nees_per_dof), _since(ranking.changes.get(row.recording)),
        )  # fmt: skip
        out.append(cells[: len(head)])
    return out


def why(row: Row) -> str:
    """Returns the first reason, and when it began."""
    if row.error is not None:
        return row.error
    if row.faults and row.why:
        return row.why[0]
    if row.first_words is not None:
        return f"from {row.first_s:.1f} s: {row.first_words}"
    return next(iter([*(row.setup or ()), *(row.why or ())]), "-")


def _since(change: Change | None) -> str:
    if change is None:
        return "new"
    return {1: "worse", 0: "same", -1: "better"}[change.worse]


def _figure(change: FigureChange) -> tuple[str, ...]:
    most = "-"
    if change.most_now > change.most_before:
        most = f"{change.most}: {_figured(change.most_before)} -> {_figured(change.most_now)}"
    return (
        change.title, str(change.count), _figured(change.before), _figured(change.now),
        str(change.larger), str(change.smaller), most,
    )  # fmt: skip


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.1%}"


def _figured(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _commands(ranking: Ranking, folder: Path | None) -> list[str]:
    """Returns how to look into the first ones."""
    wanting = [row for row in ranking.rows if row.grade not in ("good", BROKEN)]
    there = folder or Path()
    return [
        shlex.join(
            ("pelorus", "explain", str(there / row.recording), "--page", f"look-{number}.html")
        )
        for number, row in enumerate(wanting[:COMMANDS_MOST], 1)
    ]
