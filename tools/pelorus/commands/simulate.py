# SPDX-License-Identifier: MIT
"""`pelorus simulate OUT.plr`. Its options are the settings of the simulation."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import typer
from rich.markup import escape

from pelorus.commands.choices import Timing
from pelorus.console import err, out
from pelorus.errors import PelorusError
from pelorus.frames import TwistTiming
from pelorus.recording import Recording
from pelorus.simulation.mishaps import Mishaps
from pelorus.simulation.settings import Span, option_name, settings_of
from pelorus.simulation.simulate import Options, blindness, simulate

TARGET = typer.Argument(..., metavar="OUT.plr", help="The recording to write.")


def register(parent: typer.Typer) -> None:
    """Add `simulate` to the command line."""
    run.__dict__["__signature__"] = inspect.Signature(
        [
            inspect.Parameter(
                "target", inspect.Parameter.KEYWORD_ONLY, default=TARGET, annotation=Path
            ),
            *_parameters(Options, None),
            *_parameters(Mishaps, "What goes wrong"),
        ]
    )
    parent.command(
        "simulate",
        epilog="Example:  pelorus simulate slip.plr --slip 0.5 --slip-from 20 --slip-for 5",
    )(run)


def run(target: Path, **given: Any) -> None:
    """Simulate a drive through a field of landmarks, with the truth.

    And what may go wrong on it: slipping wheels, a frozen camera, a moving scene. All times are
    counted from the beginning of the drive.
    """
    mishaps = Mishaps(**_values(Mishaps, given))
    recording = simulate(Options(**_values(Options, given), mishaps=mishaps)).recording
    _tell_blindness(recording)
    size = recording.write(target)
    out.print(
        f"{escape(str(target))}: {size} bytes, {len(recording.twist_t_ns)} twists, "
        f"{len(recording.frame_t_ns)} frames with {len(recording.tracks)} observations, "
        f"{len(recording.truth_t_ns)} truth poses, {len(recording.known)} known landmarks"
        f"{f', {len(recording.readings)} readings' if recording.readings else ''}"
    )


# --- settings as options --------------------------------------------------------------------------


def _parameters(settings: type, panel: str | None) -> Iterator[inspect.Parameter]:
    """The command's parameters for a dataclass of settings, in their order."""
    types, defaults = get_type_hints(settings), settings()
    for name, about in settings_of(settings).items():
        default, kind, option = getattr(defaults, name), types[name], option_name(name)
        if kind in (Span, Span | None):
            begins = default.from_s if default else None
            first = float if default else float | None
            ends = "It lasts so long; 0: to the end."
            yield _parameter(
                f"{name}_from", first, begins, f"{option}-from", "S", about.help, panel
            )
            yield _parameter(f"{name}_for", float, 0.0, f"{option}-for", "S", ends, panel)
        elif kind is TwistTiming:
            timing = Timing[default.name]
            yield _parameter(name, Timing, timing, option, about.unit, about.help, panel)
        else:
            yield _parameter(name, kind, default, option, about.unit, about.help, panel)


def _parameter(
    name: str, kind: Any, default: Any, option: str, unit: str | None, help: str, panel: str | None
) -> inspect.Parameter:
    shown = typer.Option(default, option, metavar=unit, help=help, rich_help_panel=panel)
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=shown, annotation=kind)


def _values(settings: type, given: dict[str, Any]) -> dict[str, Any]:
    """The fields of the dataclass from what was given on the command line."""
    return {name: _value(name, given) for name in settings_of(settings)}


def _value(name: str, given: dict[str, Any]) -> Any:
    if name not in given:
        return _span(name, given[f"{name}_from"], given[f"{name}_for"])
    value = given[name]
    return value.value_in_header if isinstance(value, Timing) else value


def _span(name: str, from_s: float | None, for_s: float) -> Span | None:
    if from_s is None:
        if for_s:
            option = option_name(name)
            raise PelorusError(f"{option}-for is {for_s}: it needs {option}-from")
        return None
    return Span(from_s, for_s)


def _tell_blindness(recording: Recording) -> None:
    """A recording of nothing is no recording; where a part of it is blind, say so."""
    trouble = blindness(recording)
    if trouble and not len(recording.tracks):
        raise PelorusError(trouble)
    if trouble:
        err.print(f"[bold yellow]warning:[/] {trouble}")
