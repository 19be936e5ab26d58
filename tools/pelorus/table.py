# SPDX-License-Identifier: MIT
"""CSV files with named columns of numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pelorus import arrays, foreign
from pelorus.foreign import ForeignFileError
from pelorus.layout import Floats

DIGITS_MAX = 19  # 2^63 has as many
SHOWN_MAX = 40


class Table:
    """The columns of one file, by name; blanks around names and numbers do not matter."""

    def __init__(self, path: Path, columns: dict[str, list[str]]) -> None:
        self.path = path
        self._columns = columns

    @classmethod
    def read(cls, path: Path) -> Table:
        rows = foreign.csv_rows(path)
        names = [name.strip() for name in rows[0]]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ForeignFileError(path, f"names the column {twice[0]} twice", at="row 1")
        return cls(path, {name: [row[k] for row in rows[1:]] for k, name in enumerate(names)})

    def require(self, *names: str) -> None:
        """Refuse a file without these columns."""
        lacking = [name for name in names if name not in self._columns]
        if lacking:
            there = ", ".join(self._columns)
            hint = "; commas should part them" if len(self._columns) == 1 and ";" in there else ""
            raise ForeignFileError(
                self.path,
                f"lacks the column {', '.join(lacking)}",
                due=f"there are: {there}{hint}",
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
            if not text.isdecimal() or len(text) > DIGITS_MAX or int(text) > highest:
                raise ForeignFileError(
                    self.path,
                    f"{name} is {_shown(text)}, a whole number from 0 to {highest} is due",
                    at=f"row {row + 2}",
                )
            out[row] = int(text)
        return out

    def has(self, name: str) -> bool:
        return name in self._columns

    def words(self, name: str) -> list[str]:
        """The cells of a column, without the blanks around them."""
        self.require(name)
        return [cell.strip() for cell in self._columns[name]]

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
            raise ForeignFileError(self.path, "holds column names but no row")
        return t_ns

    def ascending_times(self) -> NDArray[np.int64]:
        t_ns = self.times()
        back = np.nonzero(np.diff(t_ns) <= 0)[0]
        if len(back):
            raise ForeignFileError(
                self.path,
                f"time does not ascend ({t_ns[back[0]]} ns, then {t_ns[back[0] + 1]} ns)",
                at=f"row {int(back[0]) + 3}",
            )
        return t_ns

    def _column(self, name: str) -> Floats:
        cells = self._columns[name]
        try:
            column = np.array(cells, dtype=np.float64)
        except ValueError:
            row = next(k for k, cell in enumerate(cells) if not _is_number(cell))
            raise ForeignFileError(
                self.path, f"{name} is {_shown(cells[row])}, a number is due", at=f"row {row + 2}"
            ) from None
        if not np.isfinite(column).all():
            row = int(np.nonzero(~np.isfinite(column))[0][0])
            raise ForeignFileError(self.path, f"{name} is not finite", at=f"row {row + 2}")
        return column


def _shown(cell: str) -> str:
    return repr(cell if len(cell) <= SHOWN_MAX else f"{cell[:SHOWN_MAX]}...")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
