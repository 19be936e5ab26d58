# SPDX-License-Identifier: MIT
"""Makes the page's answer from what `report`, `explain` and `check` found."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pelorus.check.verdict import NOISES, Verdict
from pelorus.explain.explanation import Episode, Explanation
from pelorus.explain.log import log_of
from pelorus.report.beside import tables_of
from pelorus.report.curves import Curves
from pelorus.report.footage import CAPTION, footage
from pelorus.report.page import Answer, Event, PageTable, write
from pelorus.report.spectra import drawings

if TYPE_CHECKING:
    from pelorus.check.checked import Checked
    from pelorus.report.comparison import Comparison

UNEXPLAINED_MOST = 20  # spells that the page lists
MEANING = (
    "err0: RMS position error, first poses aligned. ATE: RMS position error after the best rigid "
    "fit. Rotation: RMS angle, first poses aligned. NEES/6: mean over the frames, 1 is expected. "
    "Used and gated: observations. Map, where it has columns: RMS distance of the landmarks from "
    "where the recording knows them to be, with its NEES an axis. Poses that were given, in mode "
    "mapping, have no error. The last column: time of the recording over time of the computing. "
    "Yours is the filter with the settings that were given, in float32 like dead reckoning, which "
    "is the twists, or the IMU, alone."
)
ALSO = (
    " World is the textbook's EKF with landmarks in world coordinates; course is the same with the "
    "settings of the course report that Pelorus grew from, whatever settings the others have; both "
    "in float64."
)


def write_page(
    path: Path,
    answer: Answer,
    curves: Curves,
    found: Explanation,
    pictures: Path | None,
    calibration: Sequence[Path],
) -> None:
    """Writes the answer with all that is seen in the log of the curves, which `found` explains.

    Settings, calibration and remarks, drawings without a time axis, and `pictures` if given.
    """
    tables, drawn = tables_of(curves.messages), tuple(drawings(log_of(curves.messages)))
    answer = replace(answer, tables=[*answer.tables, *tables], drawings=drawn)
    if pictures is not None:
        shown = footage(curves.messages, found, pictures, calibration)
        words = (
            f"{len(shown.moments)} of {shown.frames} frames are shown: events, and some all along."
        )
        answer = replace(answer, moments=shown.moments, about_moments=f"{words} {CAPTION}")
    write(path, answer, curves)


def of_explanation(
    found: Explanation, title: str, tables: Sequence[PageTable] = (), facts: str = ""
) -> Answer:
    """Returns the answer to an explanation of a log."""
    verdict = found.verdict
    return Answer(
        title,
        verdict.mark,
        _sentence(verdict.words),
        facts,
        lines=[*_why(verdict), _sentence(found.lines()[0]), *found.remarks, *found.setup],
        changes=_settings(verdict),
        events=_events(found),
        tables=tables,
    )


def _sentence(words: str) -> str:
    return words[0].upper() + words[1:]


def _why(verdict: Verdict) -> list[str]:
    return [*verdict.doubts, *([NOISES] if verdict.noises else [])]


def _settings(verdict: Verdict) -> list[str]:
    return [f"{name} = {value}" for name, value in verdict.settings.items()]


def _events(found: Explanation) -> list[Event]:
    """Returns the events in the order of time, with unexplained spells among them."""
    events = [_event(found, episode) for episode in found.episodes]
    for spell in found.unexplained[:UNEXPLAINED_MOST]:
        begin, end = (found.seconds(t) for t in (spell.from_ns, spell.to_ns))
        events.append(Event(begin, end, (f"not explained: {spell.words(found.origin_ns)}",)))
    return sorted(events, key=lambda event: event.from_s)


def _event(found: Explanation, episode: Episode) -> Event:
    lines = tuple(found.told_of(episode))
    return Event(found.seconds(episode.from_ns), found.seconds(episode.to_ns), lines)


def of_comparison(
    compared: Comparison,
    lines: Sequence[str],
    found: Explanation,
    pictures: Sequence[tuple[str, str, Path]],
    tables: Sequence[PageTable] = (),
) -> Answer:
    """Returns the answer of a report.

    `lines` are its remarks; `tables` come below that of the runs.
    """
    from pelorus.report import words  # noqa: PLC0415 - it looks at runs, which load slowly

    meaning = MEANING + (ALSO if len(compared.runs) > 2 else "")
    rows = [words.titles(compared), *(words.row(compared, run) for run in compared.runs)]
    commands = [
        shlex.join((run.plan.program.name, "IN.plr", *run.plan.options)) for run in compared.runs
    ]
    return Answer(
        f"Pelorus report: {compared.subject.title}",
        found.verdict.mark,
        _sentence(found.verdict.words),
        _facts(compared),
        [*_why(found.verdict), _sentence(found.lines()[0]), *lines, *found.setup],
        changes=_settings(found.verdict),
        events=_events(found),
        tables=[PageTable("Runs", rows, meaning), *tables],
        pictures=pictures,
        commands=commands,
        lists=[("Health", compared.main.health.lines(compared.origin_ns))],
    )


def _facts(compared: Comparison) -> str:
    summary = compared.main.summary
    header = compared.subject.header
    readings = summary.get("imu_readings", 0)  # told where there is an IMU
    moved = f"{readings} IMU readings" if readings else f"{summary['twists']} twists"
    return (
        f"{compared.subject.path.name}: {summary['duration_s']:.1f} s, "
        f"{summary['frames'] + summary['frames_refused']} stereo frames with "
        f"{summary['observations']} observations, {moved}; "
        f"path {summary['path_m']:.1f} m; body axes "
        f"{header.body_axes.name.lower().replace('_', '-')}."
    )


def _remarks(found: Checked) -> list[str]:
    return [f"{remark.mark}: {remark.text}" for remark in found.remarks]


def of_check(found: Checked, title: str, found_in: Explanation | None) -> Answer:
    """Returns the answer of a check; `found_in` explains the log with the proposed settings."""
    tuned = {} if found.tuned is None else found.tuned.settings
    settings = [f"{name} = {value}" for name, value in tuned.items()]
    rows = [("", "before", "after"), *found.rows]
    return Answer(
        f"Pelorus check: {title}",
        found.verdict.mark,
        _sentence(found.verdict.words),
        found.was,
        lines=[*found.verdict.doubts, *found.changes],
        changes=settings,
        events=[] if found_in is None else _events(found_in),
        tables=[PageTable("Before and after", rows)] if found.rows else [],
        lists=[
            *([("Health", ["with these settings", *found.spells])] if found.spells else []),
            ("All remarks", ["what was looked at", *_remarks(found)]),
        ],
    )
