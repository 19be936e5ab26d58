# SPDX-License-Identifier: MIT
"""Small sensors from CSV, a file a sensor.

wheel       t_s or t_ns, some of vx_mps, vy_mps, vz_mps: velocity of its point, in body axes
standstill  t_s or t_ns: the body does not move
position    t_s or t_ns, some of px_m, py_m, pz_m: place of its point in the world

Which columns there are says which axes are measured. Each file has sigma_mps (sigma_m for a
position) for all axes, or sigma_vx_mps and so on; at_x_m, at_y_m, at_z_m say where on the body the
sensor is, else it is at the origin.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pelorus.foreign import ForeignFileError
from pelorus.frames import Reading, Sensor
from pelorus.layout import Floats
from pelorus.table import Table

COLUMNS = {
    Sensor.WHEEL: ("vx_mps", "vy_mps", "vz_mps"),
    Sensor.STANDSTILL: (),
    Sensor.POSITION: ("px_m", "py_m", "pz_m"),
}
ARM = ("at_x_m", "at_y_m", "at_z_m")
ALL_AXES = 7


def read(path: Path, sensor: Sensor) -> list[Reading]:
    """The readings of one sensor, their times ascending."""
    table = Table.read(path)
    t_ns = table.ascending_times()
    columns = COLUMNS[sensor]
    measured = [k for k, name in enumerate(columns) if table.has(name)]
    if columns and not measured:
        raise ForeignFileError(
            path, "measures no axis", due=f"some of {', '.join(columns)} are due"
        )
    value, sigma = np.zeros((len(t_ns), 3)), np.ones((len(t_ns), 3))
    for k in measured:
        value[:, k] = table.numbers(columns[k])[:, 0]
    for k in measured or range(3):
        sigma[:, k] = _sigma(path, table, sensor, columns[k] if columns else "")
    arms = table.numbers(*ARM) if any(table.has(name) for name in ARM) else np.zeros(value.shape)
    axes = sum(1 << k for k in measured) if columns else ALL_AXES
    rows = zip(t_ns.tolist(), value, sigma, arms, strict=True)
    return [Reading(t, sensor, axes, *numbers) for t, *numbers in rows]


def _sigma(path: Path, table: Table, sensor: Sensor, column: str) -> Floats:
    """Of one axis; its own column counts before that for all."""
    of_all = "sigma_m" if sensor is Sensor.POSITION else "sigma_mps"
    own = f"sigma_{column}"
    name = own if column and table.has(own) else of_all
    sigma = table.numbers(name)[:, 0]
    if sigma.min() <= 0:
        row = int(np.argmax(sigma <= 0)) + 2
        raise ForeignFileError(path, f"{name} is not positive", at=f"row {row}")
    return sigma
