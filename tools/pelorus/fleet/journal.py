# SPDX-License-Identifier: MIT
"""The rows that are done, on disk while a fleet is being judged: one that is stopped goes on."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from pelorus.errors import PelorusError, writing
from pelorus.fleet.row import Row


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
