# SPDX-License-Identifier: MIT
"""The commands' application: what `pelorus` itself says, and the commands that are wanted."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

import typer

from pelorus import __version__
from pelorus.console import out
from pelorus.outputs import guard_outputs

MODULES = {"try": "first_try"}  # whose file cannot be called as the command is


def application(commands: Iterable[str]) -> typer.Typer:
    """With these commands, which are imported here."""
    app = typer.Typer(
        name="pelorus",
        help="Convert, inspect, simulate and evaluate recordings of the Pelorus SLAM filter.",
        epilog="Example:  pelorus simulate drive.plr  &&  pelorus info drive.plr",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        callback=_options,
    )
    for command in commands:
        added = import_module(f"pelorus.commands.{MODULES.get(command, command)}").app
        guard_outputs(added)
        app.add_typer(added)
    return app


def _show_version(wanted: bool) -> None:
    if wanted:
        out.print(f"pelorus {__version__}")
        raise typer.Exit


def _options(
    version: bool = typer.Option(
        False, "--version", help="Print the version.", callback=_show_version, is_eager=True
    ),
) -> None:
    del version  # its callback has done the work
