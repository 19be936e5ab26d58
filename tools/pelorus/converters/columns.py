# SPDX-License-Identifier: MIT
"""Names and units of the columns of a user's CSV: `--columns v=speed_kmh,t=stamp_ms`.

NAME=COLUMN gives a column of the file the project's name; the unit is what follows its last
underscore, stands in brackets, or follows a colon: v=speed:km/h. FILE.NAME=COLUMN is for one file
alone. A column without a unit is refused, not guessed; but one that is plainly called vx, wz, ax,
px or t is taken in SI units, with a remark.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi
from pathlib import Path

from pelorus.converters import geodetic, instances, ulog
from pelorus.converters.geodetic import Ground
from pelorus.errors import PelorusError
from pelorus.io.table import TIME_UNITS, Table

VELOCITY = {"mps": 1.0, "m/s": 1.0, "kmh": 1 / 3.6, "kph": 1 / 3.6, "km/h": 1 / 3.6, "mmps": 1e-3}
RATE = {"radps": 1.0, "rad/s": 1.0, "degps": pi / 180, "dps": pi / 180, "deg/s": pi / 180}
FORCE = {"mps2": 1.0, "m/s2": 1.0, "m/s^2": 1.0, "g": 9.80665}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
ANGLE = {"deg": 1.0, "rad": 180 / pi, "e7": 1e-7}  # e7: degrees times 10^7
NUMBER = {"": 1.0}  # needs no unit

# By name in --columns: the column that the converters read, and units with their factors.
NAMES: dict[str, tuple[str, Mapping[str, float]]] = {
    "t": ("t", TIME_UNITS),
    **{f"v{a}": (f"v{a}_mps", VELOCITY) for a in "xyz"},
    "v": ("vx_mps", VELOCITY),
    **{f"w{a}": (f"w{a}_radps", RATE) for a in "xyz"},
    "w": ("wz_radps", RATE),
    **{f"a{a}": (f"a{a}_mps2", FORCE) for a in "xyz"},
    **{f"p{a}": (f"p{a}_m", LENGTH) for a in "xyz"},
    **{f"q{a}": (f"q{a}", NUMBER) for a in "xyzw"},
    **{name: (f"{name}_deg", ANGLE) for name in ("lat", "lon")},
    **{name: (f"{name}_m", LENGTH) for name in ("alt", "easting", "northing")},
    "id": ("id", NUMBER),
    **{f"{axis}{side}": (f"{axis}{side}_px", NUMBER) for side in "LR" for axis in "uv"},
}

# Columns with units in brackets, as EuRoC has them.
BRACKETED = re.compile(r"(?P<base>[^\[]*?)\s*\[.+\]")
BASES = {
    "t": re.compile(r"t|time|timestamp|stamp"),
    "w": re.compile(r"(?:w|gyr|gyro|omega|angular_velocity)(?:_RS_S)?[_ .]?(?P<axis>[xyz])"),
    "a": re.compile(
        r"(?:a|acc|accel|acceleration|linear_acceleration)(?:_RS_S)?[_ .]?(?P<axis>[xyz])"
    ),
}

MOTION = ("twists", "imu", "gyro")  # files that may hold several sensors
PLACES = ("position", "truth")  # files whose places may be on the earth

# Columns that have the plain name, vx, and are taken in the first unit, with a remark.
PLAIN = {
    target: (short, "" if units is NUMBER else next(iter(units)))
    for short, (target, units) in NAMES.items()
    if target not in (short, "t") and len(short) > 1
}


@dataclass
class Column:
    """One NAME=COLUMN."""

    words: str
    file: str  # for this file alone; empty: for all
    target: str
    column: str
    factor: float
    used: bool = False


@dataclass(frozen=True)
class Columns:
    """All column names of --columns; `read` is how the converters read a CSV file."""

    given: list[Column] = field(default_factory=list)
    seen: dict[Path, list[str]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)  # on the files that were read
    ground: Ground = field(default_factory=Ground)
    rows: list[instances.AskedRows] = field(default_factory=list)

    @classmethod
    def of(cls, words: list[str], crs: str = "", rows: Sequence[str] = ()) -> Columns:
        """Parses the words of --columns, of --crs and of --rows."""
        parts = [part.strip() for word in words for part in word.split(",") if part.strip()]
        given = [_column(part) for part in parts if not _says_nothing(part)]
        asked = [instances.AskedRows.of(words) for words in rows]
        return cls(given, ground=Ground(crs), rows=asked)

    def read(self, path: Path, file: str) -> Table:
        """Returns the file's columns under the project's names; `file` is its option's name."""
        table = ulog.table(path, file) if ulog.is_one(path) else Table.read(path)
        self.remarks.extend(table.remarks)
        table.hint_of, table.plain, table.remarks = _hint, PLAIN, self.remarks
        self.seen[path] = table.names
        for one in self.given:
            if one.file not in ("", file):
                continue
            if table.has(one.column):
                table.rename(one.column, one.target, one.factor)
                one.used = True
            else:
                table.miss(one.column, one.target)
        _name_bracketed(table)
        asked = [one for one in self.rows if one.file in ("", file) and one.column in table.names]
        if file in MOTION or asked:
            instances.take(table, asked)
        if file in PLACES:
            geodetic.localise(table, self.ground)
        return table

    def require_used(self) -> None:
        """Refuses a name whose column no file has: it is a typing error."""
        for one in self.given:
            if not one.used:
                there = "; ".join(f"{p}: {', '.join(names)}" for p, names in self.seen.items())
                raise PelorusError(
                    f"--columns {one.words}: no file has the column {one.column}; there are: "
                    f"{there}"
                )
        for row in self.rows:
            if not any(row.column in names for names in self.seen.values()):
                there = "; ".join(f"{p}: {', '.join(names)}" for p, names in self.seen.items())
                raise PelorusError(f"--rows {row.column}={row.value}: there are: {there}")


def _name_bracketed(table: Table) -> None:
    """Gives the project's names to other programs' columns that have units.

    These are a time, rates of turn and specific forces.
    """
    for column in table.names:
        bracketed = BRACKETED.fullmatch(column)
        for letter, base in BASES.items() if bracketed else ():
            found = base.fullmatch(bracketed["base"]) if bracketed else None
            if found is None:
                continue
            unit, axis = _unit_in(column), found.groupdict().get("axis", "")
            target, units = NAMES[letter + axis]
            own = f"t_{unit}" if letter == "t" else target
            if unit in units and own not in table.names:
                table.rename(column, own, 1.0 if letter == "t" else units[unit])


def _says_nothing(words: str) -> bool:
    """Returns whether a word like vx=vx renames nothing."""
    name, _, column = words.partition("=")
    return name == column and name in NAMES


def _hint(lacking: str, there: Sequence[str]) -> str:
    """Returns what to write where a column exists under another name."""
    short = _short_of(lacking)
    return f". If it is called otherwise: --columns {example(lacking, there)}" if short else ""


def example(lacking: str, there: Sequence[str]) -> str:
    """Returns an example of the option: wx=COLUMN:radps, or with the plain column's name."""
    short = _short_of(lacking)
    units = NAMES[short][1]
    for column in there:
        if column.startswith(f"{short}_") and column.removeprefix(f"{short}_") in units:
            return f"{short}={column}"
    unit = lacking.partition("_")[2]
    return f"{short}=COLUMN:{unit}" if units is not NUMBER else f"{short}=COLUMN"


def _short_of(target: str) -> str:
    if target == "t_s":
        return "t"
    return next((name for name, (known, _) in NAMES.items() if known == target), "")


def _short(name: str) -> tuple[str, str]:
    """Returns the short name, which has no unit: vx for the project's vx_mps."""
    short, _, unit = name.partition("_")
    if name in NAMES or short not in NAMES:
        return name, ""
    target, units = NAMES[short]
    return (short, unit) if unit in units or target == name else (name, "")


def _column(words: str) -> Column:
    name, equals, rest = words.strip().partition("=")
    file, _, asked = name.rpartition(".")
    short, implied = _short(asked)
    column, colon, unit = rest.partition(":")
    if not equals or not column or short not in NAMES:
        raise PelorusError(
            f"--columns {words}: NAME=COLUMN is expected, such as v=speed_mps,t=stamp_ms; names "
            f"are {', '.join(NAMES)}, also for one file: wheel.t=stamp_ms"
        )
    target, units = NAMES[short]
    unit = unit if colon else _unit_in(column)
    unit = implied if implied and not colon and unit not in units else unit
    if units is NUMBER:
        return Column(words, file, target, column, 1.0)
    if unit not in units:
        asks = f"{unit} is no unit of {short}:" if colon else f"in which unit is {column}?"
        raise PelorusError(
            f"--columns {words}: {asks} {short}={column}:UNIT is expected, with "
            f"{' or '.join(units)}"
        )
    if units is TIME_UNITS:
        return Column(words, file, f"t_{unit}", column, 1.0)
    return Column(words, file, target, column, units[unit])


def _unit_in(column: str) -> str:
    """Returns the unit in speed_mps, or in w_RS_S_x [rad s^-1], as EuRoC writes it."""
    bracket = re.search(r"\[(.*)\]$", column)
    if bracket is None:
        return column.rpartition("_")[2]
    return re.sub(r" s\^-(\d)", r"/s\1", bracket[1]).replace("/s1", "/s").replace("/s2", "/s^2")
