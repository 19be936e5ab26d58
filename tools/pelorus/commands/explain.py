# SPDX-License-Identifier: MIT
"""`pelorus explain LOG`."""

from __future__ import annotations

import json
from pathlib import Path

import typer

from pelorus.commands.choices import PROGRAMS, SETTINGS, replay_options
from pelorus.console import out
from pelorus.replay import result_of

app = typer.Typer()


@app.command(epilog="Example:  pelorus explain flight.plr")
def explain(
    source: Path = typer.Argument(
        ...,
        metavar="LOG.plr",
        help="What `pelorus-replay --out` or `pelorus stream --record` wrote; a recording is "
        "replayed first.",
    ),
    page: Path | None = typer.Option(
        None, "--page", metavar="FILE.html", help="The same with curves, way and map, to look into."
    ),
    as_json: bool = typer.Option(False, "--json", help="All of it as one JSON object."),
    config: Path | None = typer.Option(
        None, metavar="FILE", help="Settings for a recording, as pelorus-replay takes them."
    ),
    settings: list[str] = SETTINGS,
    programs: Path | None = PROGRAMS,
) -> None:
    """What went wrong, when, since when, and what was seen before it: in twenty lines at most.

    Stamps, readings, pictures and tracks are looked at by themselves. Where the supervisor doubted,
    the motion is measured anew from the stereo pairs and held against the odometry. What begins an
    episode is its first cause. It says as well what is wrong all along, such as settings.
    """
    from pelorus.explain import explain as explained  # noqa: PLC0415 - scipy loads slowly

    messages = result_of(source, replay_options(config, settings), programs)
    found = explained(messages)
    if page is not None:
        from pelorus.report import answers, curves  # noqa: PLC0415
        from pelorus.report.page import write  # noqa: PLC0415

        write(page, answers.of_explanation(found, source.name), curves.Curves(messages))
    if as_json:
        out.print(json.dumps(found.json(), indent=2), markup=False)
        return
    for line in found.lines():
        out.print(line, markup=False)
