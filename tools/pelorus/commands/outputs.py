# SPDX-License-Identifier: MIT
"""What all commands that write a file have in common.

An existing file is kept unless --force is given, and as the name of a file - is the standard
output.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_type_hints

import typer
from typer.models import ParameterInfo

from pelorus.errors import STANDARD_OUTPUT, Existing, places
from pelorus.program.console import leave_standard_output

FOLDER = "DIR"  # the metavar of an output folder
FORCE = inspect.Parameter(
    "force",
    inspect.Parameter.KEYWORD_ONLY,
    default=typer.Option(False, "--force", help="Overwrite files that are there."),
    annotation=bool,
)


def guard_outputs(app: typer.Typer) -> None:
    """Guards the outputs of each command of the application, and of those below it."""
    for group in app.registered_groups:
        if group.typer_instance is not None:
            guard_outputs(group.typer_instance)
    for command in app.registered_commands:
        if command.callback is not None:
            command.callback = _guarded(command.callback)


def _guarded(function: Callable[..., Any]) -> Callable[..., Any]:
    parameters = inspect.signature(function).parameters.values()
    outputs = {one.name: one.default for one in parameters if _is_output(one.default)}
    files = [name for name, about in outputs.items() if about.metavar != FOLDER]
    if not outputs or hasattr(function, "__wrapped__"):
        return function

    @functools.wraps(function)
    def run(*, force: bool, **given: Any) -> Any:
        Existing.overwritten = force
        for name in files:
            if given[name] == STANDARD_OUTPUT:
                leave_standard_output()
            elif given[name] is not None:
                Existing.keep(Path(given[name]))
                places(Path(given[name]))  # before the minutes that it takes, not after
        return function(**given)

    hints = get_type_hints(function)
    keyword = inspect.Parameter.KEYWORD_ONLY
    own = [
        one.replace(kind=keyword, annotation=hints.get(one.name, one.annotation))
        for one in parameters
    ]
    run.__signature__ = inspect.Signature([*own, FORCE])  # type: ignore[attr-defined]
    run.__annotations__ = hints | {"force": bool}
    return run


def _is_output(about: object) -> bool:
    """Returns whether it is OUT.plr and the like, or --out; not what is in a folder."""
    return isinstance(about, ParameterInfo) and (
        (about.metavar or "").startswith("OUT") or "--out" in (about.param_decls or ())
    )
