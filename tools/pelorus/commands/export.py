# SPDX-License-Identifier: MIT
"""`pelorus export RECORDING|RESULT [--frames OUT.csv] [--map OUT.ply] [--tum OUT.tum]`."""

from __future__ import annotations

from pathlib import Path

import typer

from pelorus.commands.choices import CONFIG, PROGRAMS, SETTINGS, replay_options
from pelorus.evaluate.evaluation import made_in
from pelorus.evaluate.frame_table import frame_table, write_csv
from pelorus.native.replay import result_of
from pelorus.report import export as tables

app = typer.Typer()


@app.command(
    epilog="Example:  pelorus export log.plr --frames frames.csv --map map.ply --tum way.tum"
)
def export(
    source: Path = typer.Argument(
        ..., metavar="RECORDING|RESULT", help="A recording, or what a filter left of it."
    ),
    frames_file: Path | None = typer.Option(
        None,
        "--frames",
        metavar="OUT.csv",
        help="A row a frame: pose, variances, counts, NIS, time.",
    ),
    map_file: Path | None = typer.Option(
        None,
        "--map",
        metavar="OUT.csv|OUT.ply",
        help="The landmarks that left the state, and those at the end: with covariance, for "
        "pelorus convert map; or to look at.",
    ),
    tum_file: Path | None = typer.Option(
        None, "--tum", metavar="OUT.tum", help="The trajectory: t x y z qx qy qz qw, as evo reads."
    ),
    config: Path | None = CONFIG,
    settings: list[str] = SETTINGS,
    programs: Path | None = PROGRAMS,
) -> None:
    """Write what a filter found as tables for other programs. A recording is replayed first."""
    if frames_file is None and map_file is None and tum_file is None:
        raise typer.BadParameter("say what to write", param_hint="--frames / --map / --tum")
    messages = result_of(source, replay_options(config, settings), programs)
    if frames_file is not None:
        write_csv(frames_file, frame_table(messages))
    if tum_file is not None:
        tables.write_tum(tum_file, messages)
    if map_file is not None:
        tables.write_map(map_file, made_in(messages))
