# SPDX-License-Identifier: MIT
"""`pelorus check RECORDING`."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.markup import escape
from rich.table import Table

from pelorus.commands.choices import CALIBRATION, PICTURES, PROGRAMS, SETTINGS, settings_given
from pelorus.commands.outputs import VERDICT_COLOURS
from pelorus.errors import write_text
from pelorus.native.replay import find_programs
from pelorus.program.console import out, print_json, steps

if TYPE_CHECKING:
    from pelorus.check.checked import Checked

COLOURS = {**VERDICT_COLOURS, "note": "dim"}

app = typer.Typer()


@app.command(epilog="Example:  pelorus check drive.plr --out tuned.conf")
def check(
    recording: Path = typer.Argument(
        ..., metavar="RECORDING", help="A .plr file; no truth needed."
    ),
    tuned: Path = typer.Option(
        Path("tuned.conf"), "--out", metavar="FILE", help="The settings to write."
    ),
    config: Path | None = typer.Option(
        None, metavar="FILE", help="Your settings, which the search begins with."
    ),
    settings: list[str] = SETTINGS,
    page: Path | None = typer.Option(
        None, "--page", metavar="OUT.html", help="The verdict with curves, way and map of the run."
    ),
    pictures: Path | None = PICTURES,
    calibration: list[Path] = CALIBRATION,
    as_json: bool = typer.Option(False, "--json", help="The verdict as one JSON object."),
    programs: Path | None = PROGRAMS,
) -> None:
    """Can a recording be trusted, what is wrong with it, and which settings suit it?

    Replays it some hundred times: noise, twist timing, the camera's clock and the biases are those
    that make what was seen likeliest. Writes the settings, and shows what
    the filter says of itself before and after. Where a fault stands in the way of that, no
    settings are written, and the exit status is 1. The search does not look at truth; the verdict
    does where the recording has one, and is that of `report` and `explain` with these settings.
    """
    from pelorus.check import checked  # noqa: PLC0415 - scipy loads slowly

    if pictures is not None and page is None:
        raise typer.BadParameter("are seen on a --page alone", param_hint="--pictures")
    given = settings_given(config, settings)
    program = find_programs(programs).float32
    with steps(checked.STEPS), tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        found = checked.check(program, recording, given, Path(folder))
        if page is not None:
            _write(page, found, recording, program, Path(folder), pictures, calibration)
    if found.tuned is not None:
        write_text(tuned, checked.config_text(found, recording))
    if as_json:
        print_json(_json(found, tuned))
    else:
        _tell(found, tuned)
    if found.tuned is None:
        raise typer.Exit(1)


def _write(
    page: Path,
    found: Checked,
    recording: Path,
    program: Path,
    folder: Path,
    pictures: Path | None,
    calibration: list[Path],
) -> None:
    """Writes the page, with curves of a run with the found settings, if there are any."""
    from pelorus.check.options import options_of  # noqa: PLC0415
    from pelorus.explain import explain  # noqa: PLC0415
    from pelorus.native.replay import Outputs, replay  # noqa: PLC0415
    from pelorus.report import answers  # noqa: PLC0415
    from pelorus.report.curves import Curves  # noqa: PLC0415
    from pelorus.report.page import write  # noqa: PLC0415
    from pelorus.wire import framing  # noqa: PLC0415

    if found.tuned is None:
        write(page, answers.of_check(found, recording.name, None))
        return
    outputs = Outputs.named(folder, "page")
    replay(program, recording, options_of(found.tuned.settings), outputs)
    messages = framing.messages_of(outputs.log)
    explained = explain(messages)
    answer = answers.of_check(found, recording.name, explained)
    answers.write_page(page, answer, Curves(messages), explained, pictures, calibration)


def _tell(found: Checked, tuned: Path) -> None:
    out.print(f"[bold {COLOURS[found.verdict.mark]}]{escape(found.verdict.words)}[/]")
    if found.was:
        out.print(escape(found.was))
    out.print(f"[bold]next[/]  {escape(found.next_step(tuned))}")
    for remark in found.remarks:
        out.print(f"  [{COLOURS[remark.mark]}]{remark.mark}[/]  {escape(remark.text)}")
    if found.tuned is None:
        out.print("nothing was tuned, and no settings were written")
        return
    for spell in found.spells:
        out.print(f"        {escape(spell)}")
    for change in found.changes:
        out.print(f"[bold]{escape(change)}[/]")
    table = Table(box=None, pad_edge=False)
    for title in ("", "before", "after"):
        table.add_column(title, justify="right" if title else "left", no_wrap=True)
    for row in found.rows:
        table.add_row(*row)
    out.print(table)
    out.print(f"settings: {escape(str(tuned))}")


def _json(found: Checked, tuned: Path) -> dict[str, Any]:
    return {
        **found.verdict.json(),
        "as_given": None if found.as_given is None else found.as_given.words,
        "next": found.next_step(tuned),
        "remarks": [
            {"grade": r.grade.name.lower(), "text": r.text, "note": r.is_note}
            for r in found.remarks
        ],
        "health": found.spells,
        "changes": found.changes,
        "figures": {title: {"before": a, "after": b} for title, a, b in found.rows},
        "settings": found.tuned.settings if found.tuned else None,
        "camera_offset_s": found.tuned.offset_s if found.tuned else None,
        "file": str(tuned) if found.tuned else None,
    }
