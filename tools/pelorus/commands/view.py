# SPDX-License-Identifier: MIT
"""`pelorus view LOG.plr [--rrd FILE] [--mcap FILE] [--spawn] [--connect URL]`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.markup import escape

from pelorus.commands.choices import CONFIG, LOG, PROGRAMS, SETTINGS, replay_options
from pelorus.errors import PelorusError, whole, write_text
from pelorus.native.replay import whole_log_of
from pelorus.program.console import out

if TYPE_CHECKING:
    from pelorus.view.drive import Viewer

app = typer.Typer()


@app.command(epilog="Example:  pelorus view flight.plr --rrd flight.rrd")
def view(
    source: Path = LOG,
    rrd: Path | None = typer.Option(
        None, "--rrd", metavar="OUT.rrd", help="Keep it for Rerun: `rerun OUT.rrd` opens it."
    ),
    mcap: Path | None = typer.Option(
        None, "--mcap", metavar="OUT.mcap", help="Keep it as MCAP with Foxglove's schemas."
    ),
    layout_file: Path | None = typer.Option(
        None, "--layout", metavar="OUT.json", help="A layout for Foxglove that shows the MCAP."
    ),
    spawn: bool = typer.Option(False, "--spawn", help="Start Rerun's viewer, and show it there."),
    connect: str | None = typer.Option(
        None, "--connect", metavar="URL", help="Show it in a viewer that runs, on any machine."
    ),
    config: Path | None = CONFIG,
    settings: list[str] = SETTINGS,
    programs: Path | None = PROGRAMS,
) -> None:
    r"""A log in three dimensions and over time, in Rerun or Foxglove.

    Pose with its three-sigma ellipsoid, way, truth, landmarks with theirs, points in the picture
    with those that were rejected, health and why, innovations, biases, what the supervisor saw,
    computing time. It needs `pip install 'pelorus-slam\[view]'`. While a robot drives, `pelorus
    stream --view` shows the same.
    """
    if not (rrd or mcap or layout_file or spawn or connect):
        where = "--rrd / --mcap / --layout / --spawn / --connect"
        raise typer.BadParameter("say where to show it", param_hint=where)
    files = [path for path in (rrd, mcap) if path is not None]
    for path in files:
        if path.exists() and source.exists() and path.samefile(source):
            raise PelorusError(f"{path}: is the log itself; another name is expected")
    if layout_file is not None:
        from pelorus.view.in_foxglove import layout  # noqa: PLC0415 - it loads scipy

        write_text(layout_file, layout())
        files.append(layout_file)
    from pelorus.view.drive import show  # noqa: PLC0415 - scipy loads slowly
    from pelorus.view.in_foxglove import InFoxglove  # noqa: PLC0415
    from pelorus.view.in_rerun import InRerun  # noqa: PLC0415

    messages = whole_log_of(source, replay_options(config, settings), programs)
    with ExitStack() as stack:
        viewers: list[Viewer] = []
        if rrd is not None:
            viewers.append(InRerun(rrd=stack.enter_context(whole(rrd))[0]))
        if mcap is not None:
            viewers.append(InFoxglove(stack.enter_context(whole(mcap))[0]))
        if spawn or connect is not None:
            viewers.append(InRerun(connect=connect, spawn=spawn))
        show(messages, viewers)
    for path in files:
        out.print(f"written: {escape(str(path))}")
