# SPDX-License-Identifier: MIT
"""`pelorus course RECORDING... --out DIR`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from pelorus.commands.choices import PROGRAMS, SETTINGS, replay_options
from pelorus.errors import Existing, PelorusError, made, write_text
from pelorus.evaluate import road
from pelorus.io.trajectory import read_truth
from pelorus.native.replay import find_programs
from pelorus.program.console import err, out
from pelorus.program.extras import figures_missing
from pelorus.report.comparison import Subject, read_subject
from pelorus.wire.packed_file import bare_name
from rich.markup import escape
from rich.table import Table

if TYPE_CHECKING:
    from pelorus_course.trial import Reference, Trial

FIGURE_1, FIGURE_2, TABLE = "figure1.png", "figure2.png", "table.md"

app = typer.Typer()


@app.command(
    epilog="Example:  pelorus course 03.plr 0027.plr --config tools/config/03.conf "
    "--config tools/config/0027.conf --road road.csv --out out/course",
)
def course(
    recordings: list[Path] = typer.Argument(
        ..., metavar="RECORDING...", help="A column of the figures each."
    ),
    folder: Path = typer.Option(
        ..., "--out", metavar="DIR", help="Where figure1.png, figure2.png, table.md and runs/ go."
    ),
    truth: Path | None = typer.Option(
        None, metavar="FILE", help="For the recording without TRUTH: TUM file or KITTI poses."
    ),
    road_file: Path | None = typer.Option(
        None, "--road", metavar="FILE.csv", help="Or a digitised road: rows arc_m,x_m,y_m."
    ),
    configs: list[Path] = typer.Option(
        [],
        "--config",
        metavar="FILE",
        help="Settings of dead reckoning and of Pelorus, not of the course's filter; once for all "
        "recordings, or once for each, in their order.",
    ),
    settings: list[str] = SETTINGS,
    changes: list[str] = typer.Option(
        [],
        "--course",
        metavar="NAME=VALUE",
        help="Change the course's filter, to try its claims: gate=off, landmark-sigma=0.1, "
        "max-depth=60; repeatable.",
    ),
    programs: Path | None = PROGRAMS,
) -> None:
    """Make the course report's figures and its comparison, from the recordings alone.

    Figure 1: dead reckoning, the course's filter (--preset course of the replay) and Pelorus over
    truth or road, with the landmarks. Figure 2: the trace of the covariance, of the whole map and
    of the state. docs/COURSE.md says what they show.
    """
    from pelorus_course import trial  # noqa: PLC0415 - scipy loads slowly

    Existing.keep(folder / TABLE)
    options = _options(configs, settings, recordings)
    changed = replay_options(None, changes, "--course")
    pairs = _references([read_subject(path) for path in recordings], truth, road_file)
    found_programs = find_programs(programs)
    trials = [
        trial.carry_out_trial(
            subject,
            reference,
            found_programs,
            trial.TrialOptions(ours, changed),
            made(folder / "runs" / bare_name(subject.path)),
        )
        for (subject, reference), ours in zip(pairs, options, strict=True)
    ]
    _publish(trials, folder)


def _options(configs: list[Path], settings: list[str], recordings: list[Path]) -> list[list[str]]:
    if len(configs) not in (0, 1, len(recordings)):
        raise typer.BadParameter(
            f"{len(configs)} config files for {len(recordings)} recordings: one for all, or one "
            "for each",
            param_hint="--config",
        )
    names = {bare_name(path) for path in recordings}
    if len(names) < len(recordings):
        raise typer.BadParameter(
            "two of them have the same name, and so would their runs", param_hint="RECORDING..."
        )
    several = len(configs) > 1
    return [
        replay_options(configs[k if several else 0] if configs else None, settings)
        for k in range(len(recordings))
    ]


def _references(
    subjects: list[Subject], truth: Path | None, road_file: Path | None
) -> list[tuple[Subject, Reference]]:
    """Returns each recording with its reference."""
    from pelorus_course.trial import Reference  # noqa: PLC0415 - as above

    if truth is not None and road_file is not None:
        raise typer.BadParameter("one of them, not both", param_hint="--truth / --road")
    bare = [subject for subject in subjects if subject.truth is None]
    given = truth or road_file
    if given is not None and len(bare) != 1:
        raise PelorusError(
            f"{given}: {len(bare)} of the {len(subjects)} recordings lack a TRUTH; it is for "
            "exactly one"
        )
    way = None if road_file is None else road.read_road(road_file)
    out_pairs = []
    for subject in subjects:
        if given is None or subject is not bare[0]:
            out_pairs.append((subject, Reference()))
        elif truth is not None:
            known = read_truth(truth, recording=subject.path)
            for remark in known.remarks:
                err.print(escape(remark))
            out_pairs.append((replace(subject, truth=known), Reference()))
        else:
            out_pairs.append((subject, Reference(way)))
    return out_pairs


def _publish(trials: list[Trial], folder: Path) -> None:
    from pelorus_course import table  # noqa: PLC0415 - as above

    text = table.markdown(trials)
    names = _draw(trials, folder)
    write_text(folder / TABLE, text)
    shown = Table(box=None, pad_edge=False)
    for k, title in enumerate(table.TITLES[: -table.TRACES]):
        if k < 2:
            shown.add_column(title, min_width=9)
        else:
            shown.add_column(title, justify="right", overflow="fold")
    for row in table.rows(trials):
        shown.add_row(*row[: -table.TRACES])
    out.print(shown)
    for trial in trials:
        out.print(escape(table.summary(trial)))
    out.print(escape(f"{folder}: {', '.join((*names, TABLE))}"))


def _draw(trials: list[Trial], folder: Path) -> tuple[str, ...]:
    """Returns the files of the figures."""
    if missing := figures_missing():
        err.print(escape(f"the table comes without figures: {missing}"))
        return ()
    from pelorus.program import style  # noqa: PLC0415 - an extra

    from pelorus_course import pictures  # noqa: PLC0415 - as above

    style.save(lambda: pictures.figure_1(trials), folder / FIGURE_1)
    style.save(lambda: pictures.figure_2(trials), folder / FIGURE_2)
    return FIGURE_1, FIGURE_2
