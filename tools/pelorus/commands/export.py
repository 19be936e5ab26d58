# SPDX-License-Identifier: MIT
"""`pelorus export RECORDING|RESULT --map OUT.ply`."""

from __future__ import annotations

from pathlib import Path

import typer

from pelorus import export as tables
from pelorus.commands.choices import PROGRAMS, SETTINGS, replay_options
from pelorus.evaluation import made_in
from pelorus.replay import result_of


def register(parent: typer.Typer) -> None:
    """Add `export` to the command line."""
    parent.command(epilog="Example:  pelorus export log.plr --map map.ply")(export)


def export(
    source: Path = typer.Argument(
        ..., metavar="RECORDING|RESULT", help="A recording, or what a filter left of it."
    ),
    map_file: Path | None = typer.Option(
        None,
        "--map",
        metavar="OUT.csv|OUT.ply",
        help="The landmarks that left the state, and those at the end: with covariance, for "
        "pelorus convert map; or to look at.",
    ),
    config: Path | None = typer.Option(
        None, metavar="FILE", help="For a recording: settings, as pelorus-replay takes them."
    ),
    settings: list[str] = SETTINGS,
    programs: Path | None = PROGRAMS,
) -> None:
    """Write what a filter found as tables for other programs. A recording is replayed first."""
    if map_file is None:
        raise typer.BadParameter("say what to write", param_hint="--map")
    messages = result_of(source, replay_options(config, settings), programs)
    if map_file is not None:
        tables.write_map(map_file, made_in(messages))
