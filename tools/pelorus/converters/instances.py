# SPDX-License-Identifier: MIT
"""Separates several sensors of one kind in one file by a column, like ArduPilot's I (instance).

Rows of one time are then of different sensors. That column has few whole numbers or words, each of
them at most once at any time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.io.foreign import BAD_ROWS_MAX, ForeignFileError
from pelorus.io.table import Table

SENSORS_MAX = 16
UNNAMED_MAX = 4  # in a column of any name, which may as well count the readings of a batch
NAMES = ("i", "instance", "imu", "sensor", "sensor_id", "device_id", "multi_id", "id")
UNLIKE = 2.0  # ratio of differences between rows of one time and successive rows


class AskedRows(NamedTuple):
    """COLUMN=VALUE: the rows to keep, in one file (imu) or in all that have the column."""

    file: str
    column: str
    value: str

    @classmethod
    def of(cls, words: str) -> AskedRows:
        name, equals, value = words.partition("=")
        file, dot, column = name.strip().rpartition(".")
        if not (equals and column and value.strip()):
            raise PelorusError(f"--rows {words}: COLUMN=VALUE is expected, such as I=0, or imu.I=0")
        return cls(file if dot else "", column, value.strip())


def take(table: Table, asked: list[AskedRows]) -> None:
    """Keeps the rows of one sensor: the one asked for, else the first one, with a remark."""
    for one in asked:
        cells = np.array([cell.strip() for cell in table.cells(one.column)])
        if not (cells == one.value).any():
            there = ", ".join(_first_values(cells))
            raise ForeignFileError(
                table.path, f"no row has {one.column} = {one.value}; there are: {there}"
            )
        table.keep(cells == one.value)
    if asked or not table.has_times or not table.count:
        return
    t_ns = table.times()
    shared = np.diff(np.sort(t_ns)) == 0
    if shared.sum() <= BAD_ROWS_MAX * len(t_ns):
        return
    found = _telling(table, t_ns)
    if found is None:
        _require_one_sensor(table, t_ns)
        return
    cells = np.array([cell.strip() for cell in table.cells(found)])
    values = _first_values(cells)
    table.keep(cells == values[0])
    table.remarks.append(
        f"{table.path}: rows of one time are of {len(values)} sensors, which the column {found} "
        f"tells apart ({', '.join(values)}): {values[0]} is taken. Another: --rows "
        f"{found}={values[1]}"
    )


def _first_values(cells: NDArray[np.str_]) -> list[str]:
    values = np.unique(cells)[:SENSORS_MAX].tolist()
    return sorted(values, key=lambda value: (len(value), value))


def _telling(table: Table, t_ns: NDArray[np.int64]) -> str | None:
    """Returns the column that separates the rows of one time; a usual name is preferred."""
    found = []
    for name in table.names:
        cells = np.array([cell.strip() for cell in table.cells(name)])
        values, code = np.unique(cells, return_inverse=True)
        most = SENSORS_MAX if name.lower() in NAMES else UNNAMED_MAX
        if not 2 <= len(values) <= most or not all(map(_may_name, values.tolist())):
            continue
        order = np.lexsort((code, t_ns))
        twice = (np.diff(t_ns[order]) == 0) & (np.diff(code[order]) == 0)
        if not twice.any():
            found.append(name)
    return min(found, key=lambda name: name.lower() not in NAMES) if found else None


def _may_name(value: str) -> bool:
    """Returns whether the value is a whole number or a word, as sensors are called."""
    return value.isdecimal() or (value.replace("_", "").isalnum() and not value[:1].isdecimal())


def _require_one_sensor(table: Table, t_ns: NDArray[np.int64]) -> None:
    """Refuses rows of several sensors that no column separates.

    Readings of one sensor that share a stamp differ no more than successive ones.
    """
    count = np.unique(t_ns, return_counts=True)[1]
    each = int(np.median(count))
    if each < 2 or (count == each).mean() < 1 - BAD_ROWS_MAX:
        return
    numeric = [name for name in table.names if table.is_numeric(name)]
    whole = np.stack([np.array(table.cells(name), np.float64) for name in numeric], axis=-1)
    kept = np.repeat(count == each, count)
    batches = whole[np.argsort(t_ns, kind="stable")][kept].reshape(-1, each, len(numeric))
    scale = np.maximum(batches.std(axis=(0, 1)), np.finfo(float).tiny)
    batches = batches / scale
    within = np.mean(np.diff(batches, axis=1) ** 2)
    between = np.mean(np.diff(batches, axis=0) ** 2)
    if within > UNLIKE * between:
        raise ForeignFileError(
            table.path,
            f"{each} rows have one time and differ as those of {each} sensors; a column that tells "
            "the sensors apart is expected (--rows COLUMN=VALUE takes one of them), or a file for "
            "each",
        )
