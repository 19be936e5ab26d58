# SPDX-License-Identifier: MIT
"""A small sensor's CSV file: t_s or t_ns; its numbers, or those of them that it measures; their
sigmas, one column for all of one unit or one each; where it sits, if not at the body's origin.

wheel        vx_mps, vy_mps, vz_mps; sigma_mps or sigma_vx_mps, ...; at_x_m, at_y_m, at_z_m
standstill   one row for each time at which the body rests: sigma_mps, sigma_radps
position     px_m, py_m, pz_m in the world; sigma_m or sigma_px_m, ...; at_x_m, at_y_m, at_z_m
"""

from __future__ import annotations

import numpy as np

from pelorus.io.foreign import ForeignFileError
from pelorus.io.small_sensors import SmallSensor
from pelorus.io.table import Table
from pelorus.wire.frames import Reading
from pelorus.wire.layout import Floats
from pelorus.wire.schema import PLAUSIBLE

ARM = ("at_x_m", "at_y_m", "at_z_m")
# Beyond these the filter refuses a reading (plr_filter_measure).
VALUE_MAX, SIGMA_MAX, ARM_MAX_M = PLAUSIBLE["VALUE"], 1e6, 1e3


def columns_of(sensor: SmallSensor) -> str:
    """Returns a sentence on the columns of such a file."""
    numbers = ", ".join(sensor.columns.values())
    sigmas = ", ".join(dict.fromkeys(_shared(sensor, letter) for letter in sensor.letters))
    if sensor.at_rest:
        return f"Columns t_s (or t_ns), some of {sigmas}: the body rests then; repeatable."
    arm = f"; {', '.join(ARM)} unless it sits at the body's origin" if sensor.has_arm else ""
    each = "" if len(sensor.columns) == 1 else ", all or some"
    apart = "" if len(sensor.columns) == 1 else " (or sigma_ and the column's name, one each)"
    return f"Columns t_s (or t_ns), {numbers}{each}; {sigmas}{apart}{arm}; repeatable."


def read(table: Table, sensor: SmallSensor) -> list[Reading]:
    """Returns the readings of the file's rows."""
    path = table.path
    table.leave_out_bad(*(name for name in _known(sensor) if table.has(name)))
    t_ns = table.ascending_times()
    value, sigma = np.zeros((2, len(t_ns), 3))
    measured = ""
    for k, (letter, column) in enumerate(sensor.columns.items()):
        source = _sigma_column(table, sensor, letter)
        if not (source if sensor.at_rest else table.has(column)):
            continue
        measured += letter
        sigma[:, k] = _sigma(table, source or _shared(sensor, letter))
        if not sensor.at_rest:
            value[:, k] = _within(table, column, VALUE_MAX)
    if not measured:
        expected = f"some of {', '.join(_wanted(sensor))} are expected"
        raise ForeignFileError(path, f"measures nothing; {expected}")
    arm = np.zeros((len(t_ns), 3))
    if sensor.has_arm and any(table.has(name) for name in ARM):
        table.require(*ARM)
        arm = np.stack([_within(table, name, ARM_MAX_M) for name in ARM], axis=-1)
    axes = sensor.axes(measured)
    rows = zip(t_ns.tolist(), value, sigma, arm, strict=True)
    return [Reading(t, sensor.number, axes, *numbers) for t, *numbers in rows]


def _known(sensor: SmallSensor) -> list[str]:
    """Returns all columns of numbers that such a file may have."""
    shared = [_shared(sensor, letter) for letter in sensor.letters]
    own = list(sensor.columns.values())
    return list(dict.fromkeys((*own, *shared, *(f"sigma_{name}" for name in own), *ARM)))


def _wanted(sensor: SmallSensor) -> list[str]:
    """Returns the columns of which at least one is needed."""
    if sensor.at_rest:
        return [_shared(sensor, letter) for letter in sensor.letters]
    return list(sensor.columns.values())


def _shared(sensor: SmallSensor, letter: str) -> str:
    """Returns the column of one sigma for all numbers of this one's unit."""
    return f"sigma_{sensor.unit(letter)}"


def _sigma_column(table: Table, sensor: SmallSensor, letter: str) -> str:
    """Returns the existing column of the sigma; empty if there is none."""
    names = (f"sigma_{sensor.columns[letter]}", _shared(sensor, letter))
    return next((name for name in names if table.has(name)), "")


def _sigma(table: Table, name: str) -> Floats:
    sigma = _within(table, name, SIGMA_MAX)
    table.refuse(sigma <= 0, lambda k: f"{name} is {sigma[k]:g}, a positive number is expected")
    return sigma


def _within(table: Table, name: str, most: float) -> Floats:
    x = table.numbers(name)[:, 0]
    table.refuse(np.abs(x) > most, lambda k: f"{name} is {x[k]:g}, at most {most:g} is expected")
    return x
