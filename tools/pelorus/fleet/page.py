# SPDX-License-Identifier: MIT
"""The fleet as a page: what to look at first and why, causes, and what changed."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

from pelorus.fleet.ranking import Change, FigureChange, Ranking
from pelorus.fleet.row import BROKEN, Row
from pelorus.report.page import Answer, PageTable, write

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
