# SPDX-License-Identifier: MIT
"""`pelorus simulate OUT.plr`. Its options are the settings of the simulation."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import typer

from pelorus.commands.choices import Timing
from pelorus.commands.outputs import write
from pelorus.errors import PelorusError
from pelorus.io.recording import Recording
from pelorus.io.small_sensors import SMALL_SENSORS, SmallSensor
from pelorus.program.console import err
from pelorus.simulate.imu import ImuFaults, SimulatedImu
from pelorus.simulate.mishaps import Mishaps
from pelorus.simulate.readings import Sensing, options_without_meaning
from pelorus.simulate.settings import Numbers, Span, option_name, settings_of
from pelorus.simulate.simulate import Options, blindness, simulate
from pelorus.wire.frames import TwistTiming

TARGET = typer.Argument(..., metavar="OUT.plr", help="The recording to write.")

app = typer.Typer()


@app.command(
    "simulate",
    epilog="Example:  pelorus simulate slip.plr --slip 0.5 --slip-from 20 --slip-for 5\n\n"
    "pelorus simulate gnss.plr --position-rate 5 --position-sigma 0.05 --position-at 0.2,0,1.1"
    "\n\npelorus simulate carried.plr --imu-rate 400 --rest 2 --start none",
)
def run(target: Path, **given: Any) -> None:
    """Simulate a drive through a field of landmarks, with the truth.

    And what may go wrong on it: slipping wheels, a frozen camera, a moving scene. And small sensors
    beside twists and camera, whose noise is as their readings say. With --imu-rate an IMU stands
    in place of the twists. All times are counted from the beginning of the drive.
    """
    mishaps = Mishaps(**_values(Mishaps, given))
    readings = {sensor.name: Sensing(**_sensing(sensor, given)) for sensor in SMALL_SENSORS}
    options = Options(
        **_values(Options, given),
        mishaps=mishaps,
        readings=readings,
        imu=SimulatedImu(**_values(SimulatedImu, given)),
        imu_faults=ImuFaults(**_values(ImuFaults, given)),
    )
    recording = simulate(options).recording
    _tell_blindness(recording)
    write(recording, [], target)


# --- settings as options --------------------------------------------------------------------------


def _parameters(settings: type, panel: str | None) -> Iterator[inspect.Parameter]:
    """Yields the command's parameters for a dataclass of settings, in their order."""
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


def _of_sensor(sensor: SmallSensor) -> Iterator[inspect.Parameter]:
    """Yields the parameters of Sensing, with this sensor's defaults."""
    units = dict.fromkeys(sensor.unit(letter) for letter in sensor.letters)
    shown = {"sigma": ",".join(units).replace("ps", "/s").upper(), "axes": f"[{sensor.letters}]"}
    usual = {
        "sigma": ",".join(f"{x:g}" for x in dict.fromkeys(sensor.sigma)),
        "axes": sensor.usual or sensor.letters,
        "at_m": "0,0,0",
    }
    defaults, types = Sensing(), get_type_hints(Sensing)
    for name, about in settings_of(Sensing).items():
        if name in options_without_meaning(sensor):
            continue
        own = f"{sensor.name}_{name}"
        text = name in usual
        yield _parameter(
            own,
            str if text else types[name],
            usual[name] if text else getattr(defaults, name),
            option_name(own),
            shown.get(name, about.unit),
            about.help,
            f"Small sensor: {sensor.name}",
        )


def _sensing(sensor: SmallSensor, given: dict[str, Any]) -> dict[str, Any]:
    """Returns the fields of Sensing; those with the table's values stay empty."""
    usual = {p.name: p.default.default for p in _of_sensor(sensor)}
    types = get_type_hints(Sensing)
    found = {}
    for name in set(settings_of(Sensing)) - options_without_meaning(sensor):
        own = f"{sensor.name}_{name}"
        if given[own] != usual[own]:
            found[name] = _numbers(own, given[own]) if types[name] == Numbers else given[own]
    return found


def _numbers(name: str, text: str) -> Numbers:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        expected = "a number, or several parted by commas,"
        raise PelorusError(f"{option_name(name)} is {text!r}: {expected} is expected") from None


def _parameter(
    name: str, kind: Any, default: Any, option: str, unit: str | None, help: str, panel: str | None
) -> inspect.Parameter:
    shown = typer.Option(default, option, metavar=unit, help=help, rich_help_panel=panel)
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=shown, annotation=kind)


def _values(settings: type, given: dict[str, Any]) -> dict[str, Any]:
    """Returns the fields of the dataclass from the command line's values."""
    values = {
        name: given[name] if name in given else _span(name, given) for name in settings_of(settings)
    }
    return {k: x.value_in_header if isinstance(x, Timing) else x for k, x in values.items()}


def _span(name: str, given: dict[str, Any]) -> Span | None:
    from_s, for_s = given[f"{name}_from"], given[f"{name}_for"]
    if from_s is not None:
        return Span(from_s, for_s)
    if for_s:
        option = option_name(name)
        raise PelorusError(f"{option}-for is {for_s}: it needs {option}-from")
    return None


def _tell_blindness(recording: Recording) -> None:
    """Prints which part of a recording has no observations; refuses one that has none at all."""
    trouble = blindness(recording)
    if trouble and not len(recording.tracks):
        raise PelorusError(trouble)
    if trouble:
        err.print(f"[bold yellow]warning:[/] {trouble}")


run.__dict__["__signature__"] = inspect.Signature(
    [
        inspect.Parameter(
            "target", inspect.Parameter.KEYWORD_ONLY, default=TARGET, annotation=Path
        ),
        *_parameters(Options, None),
        *_parameters(SimulatedImu, "IMU in place of twists"),
        *_parameters(Mishaps, "What goes wrong"),
        *_parameters(ImuFaults, "What goes wrong with an IMU"),
        *(p for sensor in SMALL_SENSORS for p in _of_sensor(sensor)),
    ]
)
