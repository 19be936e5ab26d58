# SPDX-License-Identifier: MIT
"""The fleet's table: a row a recording, kept as Parquet, which DuckDB writes, reads and asks.

The same recording, settings and Pelorus give the same row, on whichever machine: no time of the day
and no running time is in it. While a fleet is being judged the rows that are done are in a journal:
a run that is stopped goes on.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, astuple, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pelorus.errors import PelorusError, whole, writing
from pelorus.program.extras import extra

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection

BROKEN = "broken"  # grade of a recording that could not be judged


@dataclass(frozen=True)
class Found:
    """A recording in the folder. Size and time of the last change tell whether it is the same."""

    folder: Path
    recording: str  # its path from the folder, with /
    bytes: int
    modified_ns: int

    @property
    def path(self) -> Path:
        return self.folder / self.recording


@dataclass(frozen=True)
class Row:
    """What was found in a recording; None where a figure cannot be had."""

    recording: str
    bytes: int
    modified_ns: int
    made_by: str  # digest of programs, tools and settings
    error: str | None = None  # why it could not be judged; then the figures are None
    # as `pelorus explain` says it
    grade: str = BROKEN  # good, care, bad, broken
    verdict: str | None = None
    cause: str | None = None  # one word; None: nothing is wrong
    why: list[str] | None = None
    what_to_set: list[str] | None = None
    faults: list[str] | None = None  # by name
    setup: list[str] | None = None
    remarks: list[str] | None = None
    events: int | None = None
    diverged: int | None = None  # events that are divergences
    first_cause: str | None = None
    first_s: float | None = None  # since the first frame
    first_words: str | None = None
    what_to_do: str | None = None
    duration_s: float | None = None
    frames: int | None = None
    good_share: float | None = None  # of the frames
    nis: float | None = None  # innovations a degree of freedom: 1 is expected
    gated_share: float | None = None  # of the matches
    damaged_frames: int | None = None  # left out
    pieces: int | None = None  # in which a long log was explained
    # as `pelorus evaluate` says it
    path_m: float | None = None
    truth_frames: int | None = None
    err0_m: float | None = None
    ate_m: float | None = None
    rot_deg: float | None = None
    nees_per_dof: float | None = None
    map_landmarks: int | None = None
    map_rms_m: float | None = None
    map_nees_per_dof: float | None = None
    # as `pelorus check` says it
    check_grade: str | None = None
    check_verdict: str | None = None
    check_changes: list[str] | None = None  # settings to change, as in a config file
    check_error: str | None = None

    @classmethod
    def broken(cls, found: Found, made_by: str, error: str) -> Row:
        """Returns the row of a recording that could not be judged."""
        return cls(found.recording, found.bytes, found.modified_ns, made_by, error, cause=BROKEN)

    @classmethod
    def of(cls, found: Mapping[str, Any]) -> Row:
        """Returns the row with these fields; a table of another version may lack some."""
        return cls(**{name: found[name] for name in COLUMNS if name in found})

    def is_of(self, found: Found, made_by: str) -> bool:
        """Returns whether judging the recording would give this row again.

        One with an error is judged anew: its worker may have died for want of memory.
        """
        mine = (self.recording, self.bytes, self.modified_ns, self.made_by)
        given = (found.recording, found.bytes, found.modified_ns, made_by)
        return self.error is None and mine == given


_SQL = {"str": "VARCHAR", "int": "BIGINT", "float": "DOUBLE", "list[str]": "VARCHAR[]"}
COLUMNS = {field.name: _SQL[str(field.type).removesuffix(" | None")] for field in fields(Row)}


def finite(value: float | None) -> float | None:
    """Returns the number, None for NaN and infinity: a table is sorted by it."""
    return None if value is None or not math.isfinite(value) else float(value)


@contextmanager
def _database(what: str) -> Iterator[DuckDBPyConnection]:
    """Yields an empty database in memory; its errors say what was being done."""
    with extra("duckdb"):
        import duckdb  # noqa: PLC0415 - an extra
    offline: dict[str, str | bool | int | float | list[str]] = {
        "autoinstall_known_extensions": False,
        "autoload_known_extensions": False,
    }
    try:
        with duckdb.connect(":memory:", config=offline) as database:
            yield database
    except duckdb.Error as error:
        raise PelorusError(f"{what}: {error}") from error


def require_database() -> None:
    """Raises PelorusError where DuckDB is missing: better now than after hours of work."""
    with extra("duckdb"):
        import duckdb  # noqa: F401, PLC0415 - an extra


def write(path: Path, rows: Sequence[Row]) -> None:
    """Writes the whole table, sorted by name."""
    with whole(path) as (part,), writing(path), _database(str(path)) as database:
        columns = ", ".join(f"{name} {kind}" for name, kind in COLUMNS.items())
        database.execute(f"create table fleet ({columns})")
        marks = ", ".join("?" * len(COLUMNS))
        if rows:
            ordered = sorted(rows, key=lambda row: row.recording)
            database.executemany(f"insert into fleet values ({marks})", list(map(astuple, ordered)))
        database.execute(f"copy fleet to {_quoted(part)} (format parquet)")


def read(path: Path) -> list[Row]:
    """Returns the rows of a table, of an earlier version, too."""
    _require_file(path)
    with _database(str(path)) as database:
        names, rows = _all_of(database, f"from read_parquet({_quoted(path)})")
    lacking = {"recording", "bytes", "modified_ns", "made_by"} - set(names)
    if lacking:
        raise PelorusError(f"{path}: is no table of `pelorus fleet`: it has no {min(lacking)}")
    return [Row.of(dict(zip(names, row, strict=True))) for row in rows]


def ask(question: str, fleet: Path, before: Path | None) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Returns columns and rows of an SQL question to the tables `fleet` and `before`."""
    tables = {"fleet": fleet} | ({} if before is None else {"before": before})
    with _database("--ask") as database:
        for name, path in tables.items():
            _require_file(path)
            database.execute(f"create view {name} as from read_parquet({_quoted(path)})")
        return _all_of(database, question)


def _all_of(database: DuckDBPyConnection, question: str) -> tuple[list[str], list[tuple[Any, ...]]]:
    found = database.execute(question)
    return [column[0] for column in found.description or ()], found.fetchall()


def _quoted(path: Path) -> str:
    escaped = str(path).replace("'", "''")
    return f"'{escaped}'"


def _require_file(path: Path) -> None:
    if not path.is_file():
        raise PelorusError(f"{path}: there is no such file")


# --- the rows while a fleet is being judged -------------------------------------------------------


class Journal:
    """A JSON object a line, each written as soon as it is known."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def rows(self) -> Iterator[Row]:
        """Yields the rows of a run that was stopped; what was cut in writing is left out."""
        if not self.path.exists():
            return
        try:
            lines = self.path.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError as error:
            raise PelorusError(f"{self.path}: cannot be read: {error.strerror}") from error
        for line in lines:
            try:
                yield Row.of(json.loads(line))
            except (ValueError, TypeError):
                continue

    def write(self, row: Row) -> None:
        """Appends a row, on a line of its own whatever stands before it."""
        with writing(self.path), self.path.open("a", encoding="utf-8") as stream:
            cut = stream.tell() > 0 and not self._ends_with_a_line()
            stream.write("\n" * cut + json.dumps(asdict(row), allow_nan=False) + "\n")

    def _ends_with_a_line(self) -> bool:
        with self.path.open("rb") as stream:
            stream.seek(-1, 2)
            return stream.read(1) == b"\n"

    @contextmanager
    def until_written(self) -> Iterator[None]:
        """Removes the journal after the table that has its rows is written."""
        yield
        with writing(self.path):
            self.path.unlink(missing_ok=True)
