# SPDX-License-Identifier: MIT
"""CSV files with named columns of numbers."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pelorus import arrays
from pelorus.errors import PelorusError
from pelorus.se3 import Floats


class Table:
    """The columns of one file, by name; blanks around names and numbers do not matter."""

    def __init__(self, path: Path, columns: dict[str, list[str]]) -> None:
        self.path = path
        self._columns = columns

    @classmethod
    def read(cls, path: Path) -> Table:
        try:
            with path.open(newline="", encoding="utf-8-sig") as stream:
                rows = [row for row in csv.reader(stream) if any(cell.strip() for cell in row)]
        except OSError as error:
            raise PelorusError(f"{path}: cannot be read: {error.strerror}") from error
        except (UnicodeDecodeError, csv.Error) as error:
            raise PelorusError(f"{path}: is no CSV text: {error}") from error
        if not rows:
            raise PelorusError(f"{path}: the file is empty; a row of column names is due")
        names = [name.strip() for name in rows[0]]
        for number, row in enumerate(rows[1:], start=2):
            if len(row) != len(names):
                raise PelorusError(
                    f"{path}: row {number} has {len(row)} cells, the first row names {len(names)}"
                )
        return cls(path, {name: [row[k] for row in rows[1:]] for k, name in enumerate(names)})

    def require(self, *names: str) -> None:
        """Refuse a file without these columns."""
        lacking = [name for name in names if name not in self._columns]
        if lacking:
            there = ", ".join(self._columns)
            hint = "; commas should part them" if len(self._columns) == 1 and ";" in there else ""
            raise PelorusError(
                f"{self.path}: lacks the column {', '.join(lacking)}; there are: {there}{hint}"
            )

    def numbers(self, *names: str) -> Floats:
        """(rows, len(names)) finite float64."""
        self.require(*names)
        return np.stack([self._column(name) for name in names], axis=-1)

    def integers(self, name: str, highest: int) -> NDArray[np.int64]:
        """Whole numbers from 0 to `highest`, exact beyond 2^53."""
        self.require(name)
        out = np.empty(len(self._columns[name]), np.int64)
        for row, cell in enumerate(self._columns[name]):
            text = cell.strip()
            if not text.isdecimal() or int(text) > highest:
                raise PelorusError(
                    f"{self.path}: row {row + 2}: {name} is {text!r}, "
                    f"a whole number from 0 to {highest} is due"
                )
            out[row] = int(text)
        return out

    def times(self) -> NDArray[np.int64]:
        """ns from the column t_ns, or from t_s; not yet checked to ascend."""
        if "t_ns" in self._columns:
            t_ns = self.integers("t_ns", 2**63 - 1)
        else:
            seconds = self.numbers("t_s")[:, 0]
            if len(seconds):
                arrays.check_seconds(self.path, "t_s", seconds)
            t_ns = np.round(seconds * 1e9).astype(np.int64)
        if not len(t_ns):
            raise PelorusError(f"{self.path}: holds column names but no row")
        return t_ns

    def ascending_times(self) -> NDArray[np.int64]:
        t_ns = self.times()
        back = np.nonzero(np.diff(t_ns) <= 0)[0]
        if len(back):
            raise PelorusError(
                f"{self.path}: row {int(back[0]) + 3}: time does not ascend "
                f"({t_ns[back[0]]} ns, then {t_ns[back[0] + 1]} ns)"
            )
        return t_ns

    def _column(self, name: str) -> Floats:
        cells = self._columns[name]
        try:
            column = np.array(cells, dtype=np.float64)
        except ValueError:
            row = next(k for k, cell in enumerate(cells) if not _is_number(cell))
            raise PelorusError(
                f"{self.path}: row {row + 2}: {name} is {cells[row]!r}, a number is due"
            ) from None
        if not np.isfinite(column).all():
            row = int(np.nonzero(~np.isfinite(column))[0][0])
            raise PelorusError(f"{self.path}: row {row + 2}: {name} is not finite")
        return column


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
