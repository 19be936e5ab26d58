# SPDX-License-Identifier: MIT
"""`pelorus explain LOG`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pelorus.commands.choices import (
    CALIBRATION,
    CONFIG,
    LOG,
    PICTURES,
    PROGRAMS,
    SETTINGS,
    replay_options,
)
from pelorus.commands.outputs import tell_verdict
from pelorus.native.replay import whole_log_of
from pelorus.program.console import out, print_json, waiting

if TYPE_CHECKING:
    from pelorus.explain import Explanation
    from pelorus.wire.frames import Message

app = typer.Typer()


@app.command(epilog="Example:  pelorus explain flight.plr")
def explain(
    source: Path = LOG,
    page: Path | None = typer.Option(
        None, "--page", metavar="OUT.html", help="The same with curves, way and map, to look into."
    ),
    pictures: Path | None = PICTURES,
    calibration: list[Path] = CALIBRATION,
    beside: Path | None = typer.Option(
        None,
        "--beside",
        metavar="LOG.plr",
        help="On the page: another log, each of its curves beside its like, and what differs.",
    ),
    beside_settings: list[str] = typer.Option(
        [],
        "--beside-set",
        metavar="NAME=VALUE",
        help="Of a recording: the same, or that of --beside, with another setting; repeatable.",
    ),
    as_json: bool = typer.Option(False, "--json", help="All of it as one JSON object."),
    config: Path | None = CONFIG,
    settings: list[str] = SETTINGS,
    programs: Path | None = PROGRAMS,
) -> None:
    """What went wrong, when, since when, and what was seen before it: in twenty lines at most.

    Stamps, readings, pictures and tracks are looked at by themselves. Where the supervisor doubted,
    the motion is measured anew from the stereo pairs and held against the odometry. What begins an
    episode is its first cause. It says as well what is wrong all along, such as settings.
    """
    from pelorus.explain import explain as explained  # noqa: PLC0415 - scipy loads slowly

    if page is None and (beside is not None or beside_settings or pictures is not None):
        where = "--beside / --beside-set / --pictures"
        raise typer.BadParameter("what they ask for is seen on a --page alone", param_hint=where)
    options = replay_options(config, settings)
    messages = whole_log_of(source, options, programs)
    with waiting(f"explaining {source.name}"):
        found = explained(messages)
        verdict = found.verdict
    if page is not None:
        other = None
        if beside is not None or beside_settings:
            changed = replay_options(None, beside_settings, "--beside-set")
            named = ", ".join(beside_settings) or str(beside)
            other = named, whole_log_of(beside or source, [*options, *changed], programs)
        _write(page, source.name, found, messages, other, pictures, calibration)
    if as_json:
        print_json({**verdict.json(), **found.json()})
        return
    tell_verdict(verdict)
    for line in found.lines():
        out.print(line, markup=False)


def _write(
    page: Path,
    name: str,
    found: Explanation,
    messages: list[Message],
    other: tuple[str, list[Message]] | None,
    pictures: Path | None,
    calibration: list[Path],
) -> None:
    from pelorus.explain import explain as explained  # noqa: PLC0415 - scipy loads slowly
    from pelorus.report import answers  # noqa: PLC0415
    from pelorus.report.beside import NamedLog, drift_table, side_by_side  # noqa: PLC0415
    from pelorus.report.curves import Curves  # noqa: PLC0415

    facts = ""
    if other is None:
        curves = Curves(messages)
        first = NamedLog(name, found, curves.accuracy, messages)
        tables = drift_table([first])
    else:
        there = Curves(other[1])
        curves = Curves(messages, beside=there)
        first = NamedLog(name, found, curves.accuracy, messages)
        second = NamedLog(other[0], explained(other[1]), there.accuracy, other[1])
        tables = [*side_by_side(first, second), *drift_table([first, second])]
        facts = f"Dashed curves are those of {other[0]}."
    answer = answers.of_explanation(found, name, tables, facts)
    answers.write_page(page, answer, curves, found, pictures, calibration)
