# SPDX-License-Identifier: MIT
"""Judges one recording of a fleet: replay, explain, evaluate, and check."""

from __future__ import annotations

import io
import os
import tempfile
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import Any

import pelorus
from pelorus.check.checked import check
from pelorus.check.options import options_of
from pelorus.errors import PelorusError, made
from pelorus.evaluate.evaluation import judge, path_m
from pelorus.fleet.table import Found, Row, finite
from pelorus.fleet.whole import (
    EVALUATED,
    PIECE_BYTES,
    Course,
    Part,
    columns_of,
    holds_answers,
    in_pieces,
    is_answered,
)
from pelorus.io.trajectory import estimate_in
from pelorus.math.consistency import Figures
from pelorus.native.replay import Outputs, find_programs, replay
from pelorus.program.console import err
from pelorus.wire import packed_file
from pelorus.wire.frames import Kind, Message
from pelorus.wire.framing import Counts, Writer

LOST = ("damaged", "malformed", "too_long")  # counts of frames that are left out


@dataclass(frozen=True)
class Work:
    """What is done with each recording. `checked`: the search for settings, too."""

    settings: tuple[tuple[str, str], ...] = ()
    checked: bool = True
    programs: Path | None = None
    tools: str = ""  # digest of programs and tools: every worker must have the same ones
    piece_bytes: int = PIECE_BYTES

    @property
    def made_by(self) -> str:
        """Returns the digest of all that a row depends on beside its recording."""
        said = repr((self.settings, self.checked, self.tools, self.piece_bytes))
        return sha256(said.encode()).hexdigest()[:16]


@cache
def digest_of_tools(programs: Path | None) -> str:
    """Returns a digest of the replay programs and of this package's sources."""
    found = find_programs(programs)
    package = Path(pelorus.__file__).parent
    sources = sorted((*package.rglob("*.py"), *package.glob("*.json")))
    digest = sha256()
    for path in (found.float32, *sources):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def examine_on_worker(found: Found, work: Work) -> Row:
    """Does the same as `examine`, in a worker: silently, and with one processor."""
    os.environ.setdefault("PELORUS_THREADS", "1")
    err.file = io.StringIO()
    if digest_of_tools(work.programs) != work.tools:
        return Row.broken(found, work.made_by, f"a worker has another Pelorus: {OTHER}")
    return examine(found, work)


OTHER = "install the same version on every machine of the cluster"


def examine(found: Found, work: Work) -> Row:
    """Returns the recording's row; what goes wrong with it is in the row, too."""
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        try:
            return _Examination(found, work, Path(folder)).row()
        except PelorusError as error:
            words = str(error)
        except Exception as error:
            words = f"{type(error).__name__}: {error}: a fault of these tools, please report it"
    for place in (folder, str(found.folder)):
        words = words.replace(f"{place}/", "")
    return Row.broken(found, work.made_by, words)


@dataclass(frozen=True)
class _Examination:
    """One recording, and a folder for what is made of it."""

    found: Found
    work: Work
    folder: Path

    def row(self) -> Row:
        path = self.found.path
        counts = Counts()
        pieces = in_pieces(path, counts, self.work.piece_bytes)
        first = next(pieces)
        is_whole = not any(m.kind == Kind.STEREO for m in next(pieces, ()))
        part = path if is_whole else self._written(first)
        lost = None
        if holds_answers(first):
            self._require_no_settings()
            log = path
        else:
            log, lost = self._replayed(path)
        del first, pieces
        columns = self._explained(log, counts := Counts())
        if lost is None:
            lost = counts.damaged + counts.malformed + counts.too_long
        columns |= {"damaged_frames": lost}
        if self.work.checked:
            columns |= self._checked(part)
        found = self.found
        return Row(found.recording, found.bytes, found.modified_ns, self.work.made_by, **columns)

    def _require_no_settings(self) -> None:
        if self.work.settings:
            raise PelorusError(
                f"{self.found.recording}: holds a filter's result already: --config and --set are "
                "for recordings"
            )

    def _written(self, first: list[Message]) -> Path:
        """Returns a file of a long recording's beginning, on which `check` looks for settings."""
        path = self.folder / "beginning.plr"
        with path.open("wb") as stream:
            writer = Writer(stream)
            for message in first:
                if message.kind != Kind.END:
                    writer.write(message)
            writer.end()
        return path

    def _replayed(self, path: Path) -> tuple[Path, int]:
        """Returns the log of a replay, and how many frames were left out as damaged."""
        if packed_file.is_packed(path):  # else it would be unpacked in memory
            plain = self.folder / path.with_suffix("").name
            with plain.open("wb") as stream:
                stream.writelines(packed_file.pieces(path))
            path = plain
        outputs = Outputs.named(self.folder, "log")
        program = find_programs(self.work.programs).float32
        summary, _ = replay(program, path, options_of(dict(self.work.settings)), outputs)
        return outputs.log, sum(int(summary[name]) for name in LOST)

    def _explained(self, log: Path, counts: Counts) -> dict[str, Any]:
        every = in_pieces(log, counts, self.work.piece_bytes)
        pieces = (piece for piece in every if is_answered(piece))
        first = next(pieces, None)
        if first is None:
            raise PelorusError(f"{log}: holds no answer of a filter to a stereo frame")
        second = next(pieces, None)
        if second is None:
            return columns_of([Part.of(first)]) | _figures(judge(first), _path_m(first))
        parts, course = [], Course()
        for piece in chain((first, second), pieces):
            first = second = None  # they go when they are done with
            parts.append(Part.of(piece))
            course.add(piece)
        return columns_of(parts) | _figures(course.figures(), course.path_m)

    def _checked(self, recording: Path) -> dict[str, Any]:
        program = find_programs(self.work.programs).float32
        settings = dict(self.work.settings)
        try:
            found = check(program, recording, settings, made(self.folder / "check"))
        except PelorusError as error:
            return {"check_error": str(error).replace(f"{self.found.folder}/", "")}
        return {
            "check_grade": found.verdict.mark,
            "check_verdict": found.verdict.words,
            "check_changes": list(found.lines),
        }


def _path_m(messages: list[Message]) -> float | None:
    estimate = estimate_in(messages)
    return None if estimate is None else path_m(estimate[0].poses)


def _figures(found: Figures, path: float | None) -> dict[str, Any]:
    columns: dict[str, Any] = {"path_m": finite(path)}
    for name in EVALUATED:
        value = found.get(name)
        columns[name] = value if isinstance(value, int) else finite(value)
    return columns
