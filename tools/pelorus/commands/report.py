# SPDX-License-Identifier: MIT
"""`pelorus report IN.plr --out DIR`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.markup import escape
from rich.table import Table

from pelorus.commands.choices import CALIBRATION, PICTURES, PROGRAMS, SETTINGS, replay_options
from pelorus.commands.outputs import tell_verdict
from pelorus.errors import Existing, PelorusError, made, whole_folder
from pelorus.io.trajectory import read_stamped
from pelorus.native.replay import find_programs
from pelorus.program.console import err, out, print_json, progress, step, steps, waiting
from pelorus.program.extras import figures_missing
from pelorus.report import words
from pelorus.report.comparison import carry_out, plan_runs, read_subject, require_twists

if TYPE_CHECKING:
    from pelorus.check.verdict import Verdict
    from pelorus.io.trajectory import Trajectory
    from pelorus.report.comparison import Comparison, Run
    from pelorus.report.curves import Other

PAGE = "report.html"
STEPS = 3
SAME_NS = 1_000_000  # times of another program's way that are a frame's
DRAWINGS = ("map", "covariance", "top-view", "hero")  # that a recording may have
OLDER = (  # pictures of earlier versions, which would be taken for this report's
    *("error-yours", "error-world", "error-course", "nees", "bias", "observations", "time"),
)


class Also(StrEnum):
    """Runs for comparison."""

    COURSE = "course"
    WORLD = "world"


app = typer.Typer()


@app.command(
    epilog="Example:  pelorus report drive.plr --out out --config robot.conf --set bias=on"
)
def report(
    recording: Path = typer.Argument(..., metavar="IN.plr", help="The recording to replay."),
    folder: Path = typer.Option(
        ..., "--out", metavar="DIR", help="Where report.html, the pictures and runs/ go."
    ),
    config: Path | None = typer.Option(
        None,
        metavar="FILE",
        help="Your settings, as pelorus-replay takes them; course has its own.",
    ),
    settings: list[str] = SETTINGS,
    also: list[Also] = typer.Option([], help="One run more, for comparison; repeatable."),
    beside: list[Path] = typer.Option(
        [],
        "--beside",
        metavar="FILE.tum",
        help="Another program's way of this drive, drawn and compared too; repeatable.",
    ),
    pictures: Path | None = PICTURES,
    calibration: list[Path] = CALIBRATION,
    as_json: bool = typer.Option(False, "--json", help="What it tells as one JSON object."),
    programs: Path | None = PROGRAMS,
) -> None:
    """Replay a recording with your settings and by dead reckoning, and show what came out.

    report.html opens from the file: verdict and events above, then one time cursor through health
    with its reasons, errors, innovations, biases and evidence, and the map beside.

    With --also course the course report's filter stands beside them, with --also world the
    textbook's, both in float64. Without a depth limit in the settings, world gets one of 60 m.
    """
    Existing.keep(folder / PAGE)
    subject = read_subject(recording)
    require_twists(subject, also)
    options = replay_options(config, settings)
    plans = plan_runs(find_programs(programs), recording, options, also)
    with steps(STEPS), whole_folder(folder) as part:
        step("replaying")
        runs_folder = made(part / "runs")
        runs = [carry_out(plan, subject, runs_folder) for plan in progress(plans, "replaying")]

        from pelorus.report.comparison import Comparison  # noqa: PLC0415 - scipy loads slowly

        compared = Comparison(subject, runs)
        ways = {path.stem: read_stamped(path) for path in beside}
        verdict, lines = _draw(compared, part, ways, pictures, calibration)
        _remove_pictures(folder)
    if as_json:
        print_json(_json(compared, verdict, lines, folder / PAGE))
    else:
        _tell(compared, verdict, lines, folder / PAGE)


def _remove_pictures(folder: Path) -> None:
    """Removes an earlier report's pictures, for not every recording has all of them."""
    for name in (*DRAWINGS, *OLDER):
        (folder / f"{name}.png").unlink(missing_ok=True)


def _draw(
    compared: Comparison,
    folder: Path,
    ways: dict[str, Trajectory],
    source: Path | None,
    calibration: list[Path],
) -> tuple[Verdict, list[str]]:
    """Writes pictures and page; returns the page's verdict, and further remarks."""
    from pelorus.explain import explain  # noqa: PLC0415 - as above
    from pelorus.report import answers  # noqa: PLC0415 - as above
    from pelorus.report.beside import NamedLog, drift_table  # noqa: PLC0415 - as above
    from pelorus.report.curves import Curves, Other  # noqa: PLC0415 - as above

    step("pictures")
    shown = _draw_pictures(compared, folder)
    lines = words.remarks(compared)
    main = compared.main
    others = {
        run.name: Other(run.trajectory, compared.accuracy.get(run.name))
        for run in compared.runs
        if run is not main
    }
    for name, way in ways.items():
        others[name] = _other(name, way, main, compared.subject.truth)
    curves = Curves(main.messages, compared.subject.truth, others)
    step("the verdict")
    found = explain(main.messages)
    with waiting("judging"):
        verdict = found.verdict
    drift = drift_table([NamedLog(main.name, found, curves.accuracy, main.messages)])
    answer = answers.of_comparison(compared, lines, found, shown, drift)
    answers.write_page(folder / PAGE, answer, curves, found, source, calibration)
    return verdict, lines


def _other(name: str, way: Trajectory, main: Run, truth: Trajectory | None) -> Other:
    """Returns another program's path, moved to the first common pose; PelorusError without one."""
    from pelorus.evaluate.evaluation import assess, beside  # noqa: PLC0415 - scipy loads slowly
    from pelorus.report.curves import Other  # noqa: PLC0415 - as above

    brought = beside(way, main.trajectory, SAME_NS)
    if brought is None:
        raise PelorusError(f"--beside {name}: none of its times is that of a frame")
    return Other(brought, None if truth is None else assess(brought, truth))


def _draw_pictures(compared: Comparison, folder: Path) -> list[tuple[str, str, Path]]:
    """Returns title, caption and file of the page's pictures; the page works without them."""
    if missing := figures_missing():
        err.print(escape(f"the report has no {', '.join(DRAWINGS)}: {missing}"))
        return []
    from pelorus.program import style  # noqa: PLC0415 - an extra
    from pelorus.report import pictures  # noqa: PLC0415 - as above

    shown = []
    for picture in progress(pictures.pictures(compared), "drawing"):
        path = folder / f"{picture.name}.png"
        style.save(picture.draw, path)
        if picture.caption:
            shown.append((picture.title, picture.caption, path))
    return shown


def _json(compared: Comparison, verdict: Verdict, lines: list[str], page: Path) -> dict[str, Any]:
    """Returns the same as `_tell`, and all figures of each run."""
    return {
        "report": str(page),
        "recording": str(compared.subject.path),
        **verdict.json(),
        "remarks": lines,
        "health": compared.main.health.lines(compared.origin_ns),
        "runs": {run.name: run.summary for run in compared.runs},
    }


def _tell(compared: Comparison, verdict: Verdict, lines: list[str], page: Path) -> None:
    tell_verdict(verdict)
    rows = (words.titles(compared), *(words.row(compared, run) for run in compared.runs))
    head, *figures = zip(*rows, strict=True)
    table = Table(box=None, pad_edge=False)  # a column a run: that fits on the narrowest terminal
    for k, title in enumerate(head):
        table.add_column(title if k else "", justify="right" if k else "left", no_wrap=True)
    for row in figures:
        table.add_row(*row)
    out.print(table)
    for line in lines:
        out.print(f"[yellow]-[/] {escape(line)}")
    summary, *spells = compared.main.health.lines(compared.origin_ns)
    out.print(f"health: {summary}")
    for spell in spells:
        out.print(f"  {escape(spell)}")
    out.print(f"report: {escape(str(page))}")
