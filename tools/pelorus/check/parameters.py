# SPDX-License-Identifier: MIT
"""The noises to search: their settings, limits and starting values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from pelorus.check.apart import Inflated
from pelorus.check.options import Settings
from pelorus.check.outcome import Bench, Outcome
from pelorus.check.tracks_noise import DRIFT, TrackNoise
from pelorus.wire.frames import Header
from pelorus.wire.schema import DEFAULTS

AXES = "xyz"
PAYS = 20.0  # -2 ln of the likelihood ratio that a further parameter, or another timing, must gain
FRAMES_FEW = 100  # with fewer frames the result may be chance


class Parameter(NamedTuple):
    """A setting with its default, its limits and the HEADER's suggestion."""

    setting: str
    default: float
    least: float
    most: float
    suggestion: str


PIXEL = {"pixel": Parameter("pixel-sigma", 2.0, 0.02, 100.0, "pixel_sigma_px")}
TWIST = PIXEL | {
    "velocity": Parameter("velocity-sigma", 0.1, 1e-4, 30.0, "velocity_sigma_mps"),
    "gyro": Parameter("gyro-sigma", 0.01, 1e-5, 3.0, "gyro_sigma_radps"),
}
IMU = PIXEL | {
    "gyro": Parameter("gyro-noise", 1e-3, 1e-6, 1.0, "gyro_noise"),
    "accel": Parameter("accel-noise", 1e-2, 1e-5, 10.0, "accel_noise"),
}
WALKS = {
    "gyro-walk": Parameter("gyro-walk", 1e-4, 1e-7, 0.1, "gyro_walk"),
    "accel-walk": Parameter("accel-walk", 1e-3, 1e-6, 1.0, "accel_walk"),
}
DENSITIES = ("gyro-noise", "accel-noise", "gyro-walk", "accel-walk")
BIASES = {
    name: Parameter(name, DEFAULTS[name], 0.0, most, suggestion)
    for name, most, suggestion in (
        ("bias-velocity-sigma", 100.0, "bias_velocity_sigma_mps"),
        ("bias-gyro-sigma", 10.0, "bias_gyro_sigma_radps"),
    )
}
AXIS_SUGGESTIONS = {
    "velocity": tuple(f"velocity_sigma_{axis}_mps" for axis in AXES),
    "gyro": tuple(f"gyro_sigma_{axis}_radps" for axis in AXES),
}


@dataclass(frozen=True)
class Tuned:
    """The settings to write, and why; `offset_s` is to be added to the frames' times."""

    settings: dict[str, str]
    before: Outcome
    after: Outcome
    noise: TrackNoise
    said: list[str] = field(default_factory=list)
    offset_s: float = 0.0
    of_clock: list[str] = field(default_factory=list)  # of what was said
    halves: Inflated | None = None  # None: not compared
    doubts: list[str] = field(default_factory=list)
    lasting: list[str] = field(default_factory=list)  # errors that last longer than a step


def unless_surer(bench: Bench, tuned: Tuned, settings: dict[str, str]) -> Tuned:
    """Returns `tuned` with these settings, unless they make the filter surer of its last pose."""
    after = bench.run(settings)
    if not after.pose_log_det > tuned.after.pose_log_det:
        return tuned
    return replace(tuned, settings=settings, after=after)


def of_process(by_imu: bool) -> dict[str, Parameter]:
    """Returns all parameters of a process whose changes are reported."""
    return IMU | WALKS if by_imu else TWIST


def starting(
    header: Header, given: Settings, parameters: Mapping[str, Parameter]
) -> dict[str, float]:
    """Returns the starting values: the given ones, else the recording's, else the defaults.

    Where axes differ the keys are name-x, -y and -z.
    """
    out = {}
    for name, parameter in parameters.items():
        axes = [_within(parameter, value) for value in _axes(header, given, name, parameter)]
        if len(set(axes)) == 1:
            out[name] = axes[0]
        else:
            out |= {f"{name}-{axis}": value for axis, value in zip(AXES, axes, strict=True)}
    return out


def _axes(header: Header, given: Settings, name: str, parameter: Parameter) -> list[float]:
    if parameter.setting in given:
        values = [float(part) for part in given[parameter.setting].split(",")]
        values = values * len(AXES) if len(values) == 1 else values
        keys = (f"{parameter.setting}-{axis}" for axis in AXES)  # y and z have settings, too
        return [float(given.get(key, v)) for key, v in zip(keys, values, strict=False)]
    suggested = vars(header.noise)
    value = suggested[parameter.suggestion]
    usual = value if value > 0 else parameter.default
    if parameter.setting in DENSITIES:  # a HEADER raises them, as in a session
        usual = max(value, parameter.default)
    if parameter not in (TWIST.get(name),):
        return [usual]
    of_axes = [suggested[key] for key in AXIS_SUGGESTIONS.get(name, ())]
    return [value if value > 0 else usual for value in of_axes] or [usual]


def _within(parameter: Parameter, value: float) -> float:
    return min(max(value, parameter.least), parameter.most)


def limits(
    values: Mapping[str, float], parameters: Mapping[str, Parameter]
) -> dict[str, tuple[float, float]]:
    """Returns the limits (least, most) of each searched value."""
    found = {}
    for name in values:
        parameter = parameters.get(name) or parameters[name.rpartition("-")[0]]
        found[name] = (parameter.least, parameter.most)
    return found


def written(values: Mapping[str, float], parameters: Mapping[str, Parameter]) -> dict[str, str]:
    """Returns the values as settings: velocity, or velocity-x, -y, -z."""
    out = {}
    for name, parameter in parameters.items():
        if name in values:
            out[parameter.setting] = f"{values[name]:.4g}"
        elif f"{name}-x" in values:
            out[parameter.setting] = ",".join(f"{values[f'{name}-{axis}']:.4g}" for axis in AXES)
    return out


def no_narrower(
    header: Header, given: Settings, found: Settings, parameters: Mapping[str, Parameter]
) -> dict[str, str]:
    """Returns the noises that were found, but on each axis none below the given one."""
    out = {}
    for name, parameter in parameters.items():
        either = [_axes(header, settings, name, parameter) for settings in (given, found)]
        count = max(map(len, either))
        pairs = zip(*(some * (count // len(some)) for some in either), strict=True)
        larger = [f"{max(pair):.4g}" for pair in pairs]
        out[parameter.setting] = larger[0] if len(set(larger)) == 1 else ",".join(larger)
    return out


def larger(header: Header, settings: Settings, by_imu: bool, times: float) -> dict[str, str]:
    """Returns the settings with all noises enlarged, and with them the priors of a twist's biases.

    The estimate depends on their ratios. The biases of an IMU are soon known from its data.
    """
    if times == 1:
        return dict(settings)
    parameters = of_process(by_imu) | ({} if by_imu else BIASES)
    noises = starting(header, settings, parameters)
    most = limits(noises, parameters)
    wider = {name: min(value * times, most[name][1]) for name, value in noises.items()}
    drift = float(settings.get(DRIFT, "0")) * times
    by_axis = tuple(f"{parameter.setting}-" for parameter in parameters.values())
    kept = {k: v for k, v in settings.items() if not k.startswith(by_axis)}
    told = {DRIFT: f"{drift:.3g}"} if drift > 0 else {}
    return {**kept, **written(wider, parameters), **told}


def pooled(values: Mapping[str, float], name: str) -> float:
    """Returns one value for all axes."""
    if name in values:
        return values[name]
    return float(np.exp(np.mean([np.log(values[f"{name}-{axis}"]) for axis in AXES])))


def merged(settings: Settings) -> dict[str, str]:
    """Returns the settings without the keys of `Bench`."""
    return {k: v for k, v in settings.items() if not k.startswith("@")}


def offset_settings(offset_s: float) -> dict[str, str]:
    """Returns the clock offset as a robot's settings."""
    return {"camera-offset": f"{offset_s:.4g}"} if offset_s else {}
