# SPDX-License-Identifier: MIT
"""CSV files with named columns of numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pelorus.io import arrays, foreign, stamps
from pelorus.io.foreign import ForeignFileError
from pelorus.wire.layout import Floats

DIGITS_MAX = 19  # digits of 2^63
SHOWN_MAX = 40
WHOLE = re.compile(r"(?<=\d)\.0*$")  # after a whole number, as pandas writes 3.0
TIME_UNITS = {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9}  # a column t_ms and so on; in ns
PLAIN_TIME = "t"
TIME_COLUMNS = [f"t_{unit}" for unit in TIME_UNITS]


class Table:
    """The columns of one file, by name; blanks around names and numbers do not matter."""

    def __init__(self, path: Path, columns: dict[str, list[str]], first_row: int = 2) -> None:
        self.path = path
        self.first_row = first_row  # as in messages: the file's first line is 1
        self.rows = np.arange(first_row, first_row + len(next(iter(columns.values()), [])))
        self.remarks: list[str] = []  # on how the file was read
        self._taken: dict[str, list[str]] = {}  # of them, by unit
        self.plain: Mapping[str, tuple[str, str]] = {}  # by column, its name without unit; a unit
        self._columns = columns
        self._factor: dict[str, float] = {}
        self._own: dict[str, str] = {}  # a renamed column's name in the file
        self.hint_of: Callable[[str, list[str]], str] | None = None  # advice about a missing column
        self._missed: dict[str, str] = {}  # names that other columns should have been given

    @classmethod
    def read(cls, path: Path) -> Table:
        found = foreign.csv_rows(path)
        names = [name.strip() for name in found.names]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ForeignFileError(path, f"names the column {twice[0]} twice", at="row 1")
        columns = {name: [row[k] for row in found.rows] for k, name in enumerate(names)}
        return cls(path, columns, found.first_row)

    @property
    def names(self) -> list[str]:
        return list(self._columns)

    @property
    def count(self) -> int:
        """Returns the number of rows."""
        return len(next(iter(self._columns.values())))

    def row(self, k: int) -> str:
        """Returns the k-th row's place in the file."""
        return f"row {self.rows[k]}"

    def rename(self, column: str, name: str, factor: float) -> None:
        """Renames a column, and multiplies its numbers by `factor`."""
        if name != column and name in self._columns:
            raise ForeignFileError(
                self.path, f"has the column {name}, and {column} is to be called so", at="row 1"
            )
        self._columns = {name if old == column else old: c for old, c in self._columns.items()}
        self._factor[name] = factor
        self._own[name] = column

    def put(self, name: str, numbers: Floats) -> None:
        """Adds a column."""
        self._columns[name] = [repr(number) for number in numbers.tolist()]

    def leave_out_bad(self, *names: str, each_time_once: bool = True) -> None:
        """Leaves out the few rows whose numbers in these columns are missing or not finite.

        Rows whose time was never set, or repeats, go too. Raises ForeignFileError where they are
        many.
        """
        for name in filter(self.has, (self._time_column(), *names)):
            wrong = np.array([_is_none(cell) for cell in self._columns[name]], np.bool_)
            self._leave_out(wrong, f"{self._called(name)} is not finite")
        if self.has(self._time_column()):
            self._leave_out(arrays.never_set(self.times()), arrays.NEVER_SET)
        if each_time_once and self.has(self._time_column()):
            self._spread_batches()
            again = np.asarray(np.diff(self.times(), prepend=-1) == 0, np.bool_)
            self._leave_out(again, "time does not ascend but repeats")

    def _spread_batches(self) -> None:
        """Gives readings times of their own where a driver gives a batch one stamp.

        Duplicate rows are no batch.
        """
        if not self._share_times(self.times()):
            return
        cells = np.array(list(zip(*self._columns.values(), strict=True)))
        copies = np.concatenate(([False], (cells[1:] == cells[:-1]).all(axis=1)))
        self.keep(~copies)
        if copies.any():
            self.remarks.append(f"{self.path}: {int(copies.sum())} rows stand twice: left out")
        t_ns = self.times()
        if not self._share_times(t_ns):
            return
        found = stamps.spread(t_ns)
        del self._columns[self._time_column()]
        self._columns["t_ns"] = [str(t) for t in found.t_ns.tolist()]
        self.remarks.append(
            f"{self.path}: {found.batch} readings have one time (the median): spread over the time "
            "since the ones before, the last one at its stamp"
        )

    @staticmethod
    def _share_times(t_ns: NDArray[np.int64]) -> bool:
        """Returns whether enough rows repeat the time before for a driver's habit."""
        steps = np.diff(t_ns)
        return bool((steps == 0).sum() > foreign.BAD_ROWS_MAX * len(t_ns) and (steps >= 0).all())

    def keep(self, good: NDArray[np.bool_]) -> None:
        """Keeps only these rows."""
        kept = np.nonzero(good)[0].tolist()
        self.rows = self.rows[good]
        self._columns = {n: [column[k] for k in kept] for n, column in self._columns.items()}

    def cells(self, name: str) -> list[str]:
        """Returns the cells of a column as they are."""
        return self._columns[name]

    @property
    def has_times(self) -> bool:
        """Returns whether some column holds readable times."""
        name = self._time_column()
        return self.has(name) and not any(map(_is_none, self._columns[name]))

    def is_numeric(self, name: str) -> bool:
        """Returns whether every cell of a column is a number."""
        return all(map(foreign.is_number, self._columns[name]))

    def _leave_out(self, wrong: NDArray[np.bool_], what: str) -> None:
        self.remarks += foreign.left_out(self.path, wrong, self.row, what)
        if wrong.any():
            self.keep(~wrong)

    def miss(self, column: str, name: str) -> None:
        """Records that `column`, which is missing here, should have been renamed."""
        self._missed[name] = column

    def require(self, *names: str) -> None:
        """Refuses a file without these columns."""
        lacking = [name for name in names if not self.has(name)]
        if lacking:
            there = ", ".join(self._called(name) for name in self._columns)
            hint = "; commas should part them" if len(self._columns) == 1 and ";" in there else ""
            if not hint and not self._missed and self.hint_of is not None:
                hint = self.hint_of(lacking[0], self.names)
            raise ForeignFileError(
                self.path,
                f"lacks the column {', '.join(self._missed.get(name, name) for name in lacking)}; "
                f"there are: {there}{hint}",
            )

    def refuse(self, wrong: NDArray[np.bool_], what: str | Callable[[int], str]) -> None:
        """Raises ForeignFileError with what is wrong in the first of these rows, if any."""
        if wrong.any():
            k = int(wrong.argmax())
            raise ForeignFileError(
                self.path, what if isinstance(what, str) else what(k), at=self.row(k)
            )

    def numbers(self, *names: str) -> Floats:
        """Returns (rows, len(names)) finite float64."""
        self.require(*names)
        return np.stack([self._column(name) for name in names], axis=-1)

    def integers(self, name: str, highest: int) -> NDArray[np.int64]:
        """Returns whole numbers from 0 to `highest`, exact beyond 2^53."""
        self.require(name)
        out = np.empty(len(self._columns[name]), np.int64)
        for row, cell in enumerate(self._columns[name]):
            text = WHOLE.sub("", cell.strip())
            if not text.isdecimal() or len(text) > DIGITS_MAX or int(text) > highest:
                raise ForeignFileError(
                    self.path,
                    f"{self._called(name)} is {_shown(cell.strip())}, "
                    f"a whole number from 0 to {highest} is expected",
                    at=self.row(row),
                )
            out[row] = int(text)
        return out

    def has(self, name: str) -> bool:
        """Returns whether a column exists; a plain name without a unit adds a remark."""
        if name in self._columns:
            return True
        short, unit = self.plain.get(name, ("", ""))
        if short not in self._columns or name in self._missed:
            return False
        self._take(short, name, unit)
        return True

    def _take(self, short: str, name: str, unit: str) -> None:
        self.rename(short, name, 1.0)
        if not unit:
            return
        if self._taken:
            self.remarks.remove(self._taken_words)
        self._taken.setdefault(unit, []).append(short)
        self.remarks.append(self._taken_words)

    @property
    def _taken_words(self) -> str:
        each = [f"{', '.join(names)} in {unit}" for unit, names in self._taken.items()]
        first = next(iter(self._taken.values()))[0]
        return (
            f"{self.path}: taken {'; '.join(each)}. In another unit: --columns {first}={first}:UNIT"
        )

    def words(self, name: str) -> list[str]:
        """Returns the cells of a column, without blanks around them."""
        self.require(name)
        return [cell.strip() for cell in self._columns[name]]

    def times(self) -> NDArray[np.int64]:
        """Returns ns from the column t_ns, t_us, t_ms or t_s; not yet checked to ascend."""
        name = self._time_column()
        unit = name[2:]
        if unit == "ns":
            t_ns = self.integers(name, 2**63 - 1)
        else:
            numbers = self.numbers(name)[:, 0]
            if len(numbers):
                arrays.check_seconds(self.path, self._called(name), numbers, TIME_UNITS[unit])
            t_ns = self._exact_ns(name, TIME_UNITS[unit])
        if not len(t_ns):
            raise ForeignFileError(self.path, "holds column names but no row")
        found = stamps.unwrapped(t_ns)
        remark = f"{self.path}: {self._called(name)}: {found.words}"
        if found.wraps and remark not in self.remarks:
            self.remarks.append(remark)
        return found.t_ns

    def _time_column(self) -> str:
        """Returns the existing one of t_ns, t_us ..., else t_s; plain t is s or ns by its size."""
        known = [*self._columns, *self._missed]
        found = next((name for name in known if name in TIME_COLUMNS), "")
        if found or not self.plain or PLAIN_TIME not in self._columns:
            return found or "t_s"
        cells = self._columns[PLAIN_TIME]
        stamps = np.array([float(cell) for cell in cells if foreign.is_number(cell)])
        unit = "ns" if arrays.are_ns(stamps[np.isfinite(stamps)]) else "s"
        self._take(PLAIN_TIME, f"t_{unit}", unit)
        return f"t_{unit}"

    def _exact_ns(self, name: str, factor: float) -> NDArray[np.int64]:
        """Parses decimals: a double would round today's clock to 0.2 microseconds."""
        exact = (Decimal(cell.strip()) * int(factor) for cell in self._columns[name])
        return np.array([int(t.to_integral_value()) for t in exact], np.int64)

    def ascending_times(self) -> NDArray[np.int64]:
        t_ns = self.times()
        self.refuse(
            np.concatenate(([False], np.diff(t_ns) <= 0)),
            lambda k: f"time does not ascend ({t_ns[k - 1]} ns, then {t_ns[k]} ns)",
        )
        return t_ns

    def _called(self, name: str) -> str:
        """Returns the column's name in the file, for its owner."""
        return self._own.get(name, name)

    def _column(self, name: str) -> Floats:
        cells = self._columns[name]
        try:
            if any("_" in cell for cell in cells):  # numpy takes 1_763, as Python does
                raise ValueError
            column = np.array(cells, dtype=np.float64)
        except ValueError:
            self.refuse(
                np.array([not foreign.is_number(cell) for cell in cells]),
                lambda k: f"{self._called(name)} is {_shown(cells[k])}, a number is expected",
            )
            raise
        self.refuse(~np.isfinite(column), f"{self._called(name)} is not finite")
        factor = self._factor.get(name, 1.0)
        return column if factor == 1.0 else column * factor


def _is_none(cell: str) -> bool:
    """Returns whether a cell is empty, or a program's word for a missing number."""
    return cell.strip().lstrip("+-").lower() in ("", "nan", "inf", "infinity")


def _shown(cell: str) -> str:
    return repr(cell if len(cell) <= SHOWN_MAX else f"{cell[:SHOWN_MAX]}...")
