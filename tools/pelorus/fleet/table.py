# SPDX-License-Identifier: MIT
"""The fleet's table as Parquet: DuckDB writes, reads and asks it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pelorus.errors import PelorusError, whole, writing
from pelorus.fleet.row import COLUMNS, Row
from pelorus.program.extras import extra

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection


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
