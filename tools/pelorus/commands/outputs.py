# SPDX-License-Identifier: MIT
"""What commands that write a file have in common; what several of them print.

An existing file is kept unless --force is given, and as the name of a file - is the standard
output.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_type_hints

import typer
from rich.markup import escape
from typer.models import ParameterInfo

from pelorus.errors import STANDARD_OUTPUT, Existing, places
from pelorus.program.console import leave_standard_output, out

if TYPE_CHECKING:
    from pelorus.check.verdict import Verdict
    from pelorus.faults.finding import Finding
    from pelorus.io.recording import Recording

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


# --- what commands print in common ----------------------------------------------------------------


def run_command(*words: str) -> int:
    """Another command, as the user could give it; returns its exit status."""
    from pelorus.commands.application import application  # noqa: PLC0415 - it imports the commands

    out.print(f"[bold]$ pelorus {escape(' '.join(words))}[/]")
    status = application(words[:1])(args=list(words), standalone_mode=False)
    return status if isinstance(status, int) else 0


VERDICT_COLOURS = {"good": "green", "care": "yellow", "bad": "red"}


def tell_verdict(verdict: Verdict) -> None:
    """Prints a verdict in its colour, with reasons and settings, before a command's result."""
    head, *why = verdict.lines()
    out.print(f"[bold {VERDICT_COLOURS[verdict.mark]}]{escape(head)}[/]")
    for words in why:
        out.print(escape(words))


def _finding_verdict(finding: Finding) -> str:
    if not finding.is_conclusive:
        return "[yellow]cannot tell[/]"
    if finding.measured:
        return "[green]measured[/]"
    return "[bold yellow]FOUND[/]" if finding.found else "[green]good[/]"


def write(recording: Recording, findings: list[Finding], target: Path) -> None:
    """Prints the findings, keeps them in the recording as TEXT, and writes the file."""
    from pelorus.wire.frames import TEXT_BYTES_MAX, Text  # noqa: PLC0415 - numpy loads slowly

    for finding in findings:
        out.print(f"{finding.subject}: {_finding_verdict(finding)}: {escape(finding.evidence)}")
        out.print(f"    -> {escape(finding.action)}")
    remarks = [
        Text(f"{f.subject}: {f.action}"[:TEXT_BYTES_MAX]) for f in findings if f.found or f.measured
    ]
    size = replace(recording, remarks=[*recording.remarks, *remarks]).write(target)
    tracks = recording.tracks
    out.print(
        f"{escape(str(target))}: {size} bytes, {recording.motion_words}, "
        + (
            f"{len(recording.frame_t_ns)} frames with {len(tracks)} observations, "
            if recording.pictures is None
            else f"{len(recording.pictures.t_ns)} pairs of pictures, "
        )
        + f"{len(recording.truth_t_ns)} truth poses, {len(recording.known)} known landmarks"
        + (f", {len(recording.readings)} readings" if recording.readings else "")
    )
