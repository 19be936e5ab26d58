# SPDX-License-Identifier: MIT
"""The commands' application: the options of `pelorus` itself, and the commands that are needed."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path

import typer

from pelorus import __version__
from pelorus.commands.outputs import guard_outputs
from pelorus.program.console import out

MODULES = {"try": "first_try"}  # commands whose file has another name


def application(commands: Iterable[str], others: bool = False) -> typer.Typer:
    """Returns the application with these commands, which are imported here; with `others`, also
    those of other packages.
    """
    app = typer.Typer(
        name="pelorus",
        help="Convert, inspect, simulate and evaluate recordings of the Pelorus SLAM filter.",
        epilog="Example:  pelorus simulate drive.plr  &&  pelorus info drive.plr",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        callback=_options,
    )
    names = (MODULES.get(command, command) for command in commands)
    apps = [import_module(f"pelorus.commands.{name}").app for name in names]
    apps += [entry.load() for entry in entry_points(group="pelorus.commands") if others]
    for added in apps:
        guard_outputs(added)
        app.add_typer(added)
    return app


def _show_version(wanted: bool) -> None:
    if wanted:
        out.print(f"pelorus {__version__}")
        raise typer.Exit


def _write_man_pages(context: typer.Context, folder: Path | None) -> None:
    if folder is not None:
        from pelorus.commands import man  # noqa: PLC0415 - hardly ever wanted

        pages = man.write(context.command, folder)
        out.print(f"{len(pages)} man pages: {pages[0].parent}", markup=False)
        raise typer.Exit


def _options(
    version: bool = typer.Option(
        False, "--version", help="Print the version.", callback=_show_version, is_eager=True
    ),
    man_pages: Path | None = typer.Option(
        None,
        "--man-pages",
        metavar="DIR",
        help="Write the man pages into DIR/man1, such as ~/.local/share/man.",
        callback=_write_man_pages,
        is_eager=True,
    ),
) -> None:
    del version, man_pages  # their callbacks have done the work
