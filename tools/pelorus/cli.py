# SPDX-License-Identifier: MIT
"""The command `pelorus`. Each command lives in its own file under pelorus/commands.

To add one: write commands/NAME.py with an `app` that has it, and name it in COMMANDS. Only
the command that is called is imported: plotting takes longer to load than most of them to run.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from importlib import import_module

import typer
from rich.markup import escape

from pelorus import __version__
from pelorus.console import err, out
from pelorus.errors import PelorusError

COMMANDS = (
    "convert",
    "track",
    "info",
    "check",
    "evaluate",
    "export",
    "simulate",
    "report",
    "map",
    "course",
    "stream",
    "compare",
)


def _app(commands: Iterable[str]) -> typer.Typer:
    app = typer.Typer(
        name="pelorus",
        help="Convert, inspect, simulate and evaluate recordings of the Pelorus SLAM filter.",
        epilog="Example:  pelorus simulate drive.plr  &&  pelorus info drive.plr",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        callback=_options,
    )
    for command in commands:
        app.add_typer(import_module(f"pelorus.commands.{command}").app)
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0, or 1 after an error that was told, or 2 if the call makes no sense."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    app = _app(words[:1] if words[:1] and words[0] in COMMANDS else COMMANDS)
    try:
        app(args=words, prog_name="pelorus")
    except PelorusError as error:
        err.print(f"[bold red]error:[/] {escape(str(error))}")
        return 1
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else 1
    return 0
