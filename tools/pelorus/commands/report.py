# SPDX-License-Identifier: MIT
"""`pelorus report IN.plr --out DIR`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.markup import escape
from rich.table import Table

from pelorus.commands.choices import PROGRAMS, SETTINGS, replay_options
from pelorus.console import out, progress
from pelorus.errors import made
from pelorus.replay import find_programs
from pelorus.report import words
from pelorus.report.results import carry_out, plan_runs, read_subject

if TYPE_CHECKING:
    from pelorus.report.comparison import Comparison

PAGE = "report.html"


def register(parent: typer.Typer) -> None:
    """Add `report` to the command line."""
    parent.command(
        epilog="Example:  pelorus report drive.plr --out out --config robot.conf --set bias=on",
    )(report)


def report(
    recording: Path = typer.Argument(..., metavar="IN.plr", help="The recording to replay."),
    folder: Path = typer.Option(
        ..., "--out", metavar="DIR", help="Where report.html, the pictures and runs/ go."
    ),
    config: Path | None = typer.Option(
        None, metavar="FILE", help="Settings of all runs but course, as pelorus-replay takes them."
    ),
    settings: list[str] = SETTINGS,
    programs: Path | None = PROGRAMS,
) -> None:
    """Replay a recording four ways, and draw what came out.

    Dead reckoning and body in float32, the course's preset and world in float64.
    Without a depth limit in the settings, world gets one of 60 m.
    """
    subject = read_subject(recording)
    plans = plan_runs(find_programs(programs), recording, replay_options(config, settings))
    runs_folder = made(folder / "runs")
    runs = [carry_out(plan, subject, runs_folder) for plan in progress(plans, "replaying")]

    from pelorus.report.comparison import Comparison  # noqa: PLC0415 - matplotlib loads slowly

    _publish(Comparison(subject, runs), folder)


def _publish(compared: Comparison, folder: Path) -> None:
    from pelorus import style  # noqa: PLC0415 - as above
    from pelorus.report import page, pictures  # noqa: PLC0415 - as above

    for name in pictures.NAMES:  # of an earlier report: not every recording has all of them
        (folder / f"{name}.png").unlink(missing_ok=True)
    drawn = []
    for picture in progress(pictures.pictures(compared), "drawing"):
        path = folder / f"{picture.name}.png"
        style.save(picture.draw, path)
        drawn.append((picture, path))
    lines = words.verdicts(compared)
    page.write(folder / PAGE, compared, lines, drawn)
    _tell(compared, lines, folder / PAGE)


def _tell(compared: Comparison, lines: list[str], page: Path) -> None:
    table = Table(box=None, pad_edge=False)
    for title in words.titles(compared):
        name = title == "run"
        table.add_column(title, justify="left" if name else "right", no_wrap=name, overflow="fold")
    table.columns[0].min_width = max(len(run.name) for run in compared.runs)
    for run in compared.runs:
        table.add_row(*words.row(compared, run))
    out.print(table)
    for line in lines:
        out.print(f"[yellow]-[/] {escape(line)}")
    out.print(f"report: {escape(str(page))}")
