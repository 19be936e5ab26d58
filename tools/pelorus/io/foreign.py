# SPDX-License-Identifier: MIT
"""Every file that somebody else wrote is opened here: text, CSV, JSON, YAML, .npz and .mat;
but bags of ROS and logs of PX4, which libraries open (converters/bag.py, converters/ulog.py).

Each reader has a limit of size, and one way to fail: ForeignFileError, whatever the file holds. The
rest of the package opens no foreign file; tests/python/test_foreign.py sees to it.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
import zipfile
from collections import Counter
from collections.abc import Callable
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from pelorus.errors import PelorusError
from pelorus.wire.layout import Floats

TEXT_BYTES_MAX = 1 << 30
JSON_BYTES_MAX = 1 << 20  # a calibration has some hundred
YAML_BYTES_MAX = 1 << 18  # its parser is slow
YAML_DEPTH_MAX = 50
ARRAYS_BYTES_MAX = 1 << 31  # unpacked; the course's largest drive has 0.2 GB
INTEGER_DIGITS_MAX = 20  # digits of 2^64
BAD_ROWS_MAX = 0.1  # of a file's rows may be left out; more is another fault
PIECE_BYTES = 1 << 20
BEGINNING_BYTES = 1 << 17
NOT_FINITE = "holds a number that is not finite"
COMMENT = "#"
NPY_MAGIC = b"\x93NUMPY"

ArraysByName = dict[str, NDArray[np.generic]]


class ForeignFileError(PelorusError):
    """A file is not what it should be: which one, where in it, what is wrong, what would be right:
    "has 3 numbers; 12 are expected".
    """

    def __init__(self, path: Path, what: str, *, at: str = "") -> None:
        self.path, self.at = path, at
        super().__init__(f"{path}: {at}: {what}" if at else f"{path}: {what}")


# --- bytes and text -------------------------------------------------------------------------------


def content(path: Path, most: int) -> bytes:
    """Returns all bytes of a file or a pipe; it must have one at least and `most` at most."""
    pieces, size = [], 0
    try:
        with path.open("rb") as stream:
            while piece := stream.read(PIECE_BYTES):
                size += len(piece)
                if size > most:
                    raise ForeignFileError(path, f"is too long; at most {most} bytes are expected")
                pieces.append(piece)
    except OSError as error:
        raise ForeignFileError(path, f"cannot be read: {error.strerror}") from error
    if not size:
        raise ForeignFileError(path, "the file is empty")
    return b"".join(pieces)


def beginning(path: Path) -> bytes:
    """Returns the first bytes of a file, which show its format."""
    try:
        with path.open("rb") as stream:
            return stream.read(BEGINNING_BYTES)
    except OSError as error:
        raise ForeignFileError(path, f"cannot be read: {error.strerror}") from error


def ending(path: Path, count: int) -> bytes:
    """Returns the last bytes of a file."""
    try:
        with path.open("rb") as stream:
            stream.seek(max(stream.seek(0, io.SEEK_END) - count, 0))
            return stream.read()
    except OSError as error:
        raise ForeignFileError(path, f"cannot be read: {error.strerror}") from error


def text(path: Path, most: int = TEXT_BYTES_MAX) -> str:
    """Returns UTF-8 text, with or without a byte order mark."""
    raw = content(path, most)
    try:
        found, bad = raw.decode("utf-8-sig"), raw.find(b"\0")
    except UnicodeDecodeError as error:
        bad = error.start
    if bad >= 0:  # a zero, too: UTF-16 without a mark, or unwritten data
        raise ForeignFileError(path, "is no text; text in UTF-8 is expected", at=f"byte {bad}")
    return found


# --- rows of numbers ------------------------------------------------------------------------------


class Row(NamedTuple):
    """The cells of a line, with its number in the file."""

    line: int
    cells: list[str]


def rows(path: Path) -> list[Row]:
    """Returns lines of cells separated by blanks or commas, without blank lines and # comments."""
    return rows_of(path, text(path))


def rows_of(path: Path, whole: str) -> list[Row]:
    """Returns the same from the file's text."""
    lines = enumerate(whole.splitlines(), 1)
    bare = ((number, line.partition("#")[0].replace(",", " ").split()) for number, line in lines)
    found = [Row(number, cells) for number, cells in bare if cells]
    if not found:
        raise ForeignFileError(path, "holds no row of numbers")
    return found


class Written(NamedTuple):
    """Rows of numbers, with the columns' names, if any, and whether commas separate them."""

    rows: list[Row]
    names: list[str]
    by_commas: bool


def written(path: Path) -> Written:
    """Reads rows; a first row of words, or the comment before the numbers, names the columns."""
    whole = text(path)
    found = rows_of(path, whole)
    lines = whole.splitlines()
    comments = [line for line in lines[: found[0].line - 1] if line.lstrip().startswith(COMMENT)]
    heading = comments[-1].lstrip().lstrip(COMMENT) if comments else ""
    if not any(map(is_number, found[0].cells)) and len(found) > 1:
        heading, found = lines[found[0].line - 1], found[1:]
    names = heading.split(",") if "," in heading else heading.split()
    by_commas = "," in lines[found[0].line - 1]
    return Written(found, [name.strip() for name in names], by_commas)


class Sound(NamedTuple):
    """The usable rows, their numbers, and remarks on the others."""

    rows: list[Row]
    numbers: Floats
    remarks: tuple[str, ...]


def sound(
    path: Path, given: list[Row], columns: int | None = None, used: int | None = None
) -> Sound:
    """Returns rows and numbers without the few rows that are cut off or not finite.

    Numbers must be finite in the first `used` columns, or in all.
    """
    expected = columns or Counter(len(row.cells) for row in given).most_common(1)[0][0]
    short = np.array([len(row.cells) for row in given]) != expected
    first = given[int(short.argmax())]
    what = f"has {len(first.cells)} numbers; {expected} a row are expected"
    remarks = left_out(path, short, lambda k: f"line {given[k].line}", what)
    whole = _where(given, ~short)
    found = _numbers(path, whole, expected)
    bad = np.asarray(~np.isfinite(found[:, :used]).all(axis=1), np.bool_)
    remarks += left_out(path, bad, lambda k: f"line {whole[k].line}", NOT_FINITE)
    return Sound(_where(whole, ~bad), found[~bad], remarks)


def _where(given: list[Row], good: NDArray[np.bool_]) -> list[Row]:
    return [row for row, is_good in zip(given, good, strict=True) if is_good]


def left_out(
    path: Path, bad: NDArray[np.bool_], at: Callable[[int], str], what: str
) -> tuple[str, ...]:
    """Returns a remark on bad rows, if any; raises ForeignFileError where they are many."""
    count = int(bad.sum())
    if not count:
        return ()
    first = at(int(bad.argmax()))
    if count > BAD_ROWS_MAX * len(bad):
        raise ForeignFileError(path, f"{what} ({count} of {len(bad)} rows)", at=first)
    return (f"{path}: {count} of {len(bad)} rows are left out, {first} first: {what}",)


def numbers(path: Path, given: list[Row], columns: int | None = None) -> Floats:
    """Returns (rows, columns) finite numbers; by default as many columns as the first row has."""
    out = _numbers(path, given, columns)
    bad = np.nonzero(~np.isfinite(out).all(axis=1))[0]
    if len(bad):
        raise ForeignFileError(path, NOT_FINITE, at=f"line {given[int(bad[0])].line}")
    return out


def _numbers(path: Path, given: list[Row], columns: int | None) -> Floats:
    expected = columns or len(given[0].cells)
    out = np.empty((len(given), expected))
    for k, (line, cells) in enumerate(given):
        at = f"line {line}"
        if len(cells) != expected:
            raise ForeignFileError(
                path, f"has {len(cells)} numbers; {expected} a row are expected", at=at
            )
        if not all(map(is_number, cells)):
            raise ForeignFileError(path, "holds something that is no number", at=at)
        out[k] = [float(cell) for cell in cells]
    return out


# --- CSV ------------------------------------------------------------------------------------------


class Csv(NamedTuple):
    """The columns' names, the rows below, and the first row's number in the file."""

    names: list[str]
    rows: list[list[str]]
    first_row: int


def csv_rows(path: Path) -> Csv:
    """Returns the cells of every row that is not blank; the first row names the columns.

    Rows that begin with # before the first one of data are comments. The last of them names the
    columns where no other row does: `#timestamp [ns],w_RS_S_x [rad s^-1]`, as EuRoC has it.
    """
    try:
        table = list(csv.reader(io.StringIO(text(path), newline="")))
    except csv.Error as error:
        raise ForeignFileError(path, f"is no CSV text: {error}") from error
    table = [row for row in table if any(cell.strip() for cell in row)]
    comments, skipped = _comments(table)
    table = table[skipped:]
    if comments and (not table or _may_name(comments[-1], table[0])):
        table.insert(0, comments[-1])
        skipped -= 1
    if not table:
        raise ForeignFileError(path, "the file is empty; a row of column names is expected")
    names, below = table[0], table[1:]
    _, more = _comments(below)
    first_row = skipped + more + 2
    for number, row in enumerate(below[more:], start=first_row):
        if len(row) != len(names):
            wrong = f"has {len(row)} cells, the first row names {len(names)}"
            if len(names) == 1 and ";" in names[0]:
                wrong += "; points in numbers, and commas between them, are expected"
            raise ForeignFileError(path, wrong, at=f"row {number}")
    return Csv(names, below[more:], first_row)


def _comments(table: list[list[str]]) -> tuple[list[list[str]], int]:
    """Returns the leading comment rows, without their #, and their number."""
    count = next(
        (k for k, row in enumerate(table) if not row[0].lstrip().startswith(COMMENT)), len(table)
    )
    bare = [[row[0].lstrip().lstrip(COMMENT), *row[1:]] for row in table[:count]]
    return bare, count


def _may_name(comment: list[str], row: list[str]) -> bool:
    """Returns whether the comment has a name for each cell of a row of numbers."""
    return len(comment) == len(row) and any(is_number(cell) for cell in row)


def is_number(cell: str) -> bool:
    """Returns whether a cell is a number as people write them, unlike Python's 1_763."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell


# --- JSON -----------------------------------------------------------------------------------------


def json_object(path: Path) -> dict[str, Any]:
    """Reads a JSON object; its numbers must fit a double, its strings UTF-8."""
    return json_words(path, text(path, JSON_BYTES_MAX))


def json_words(path: Path, words: str) -> dict[str, Any]:
    """Parses the same from the file's text."""
    try:
        found = json.loads(
            words, parse_int=_integer, parse_float=_real, object_pairs_hook=_named_once
        )
        json.dumps(found, ensure_ascii=False).encode("utf-8")
    except RecursionError:
        raise ForeignFileError(
            path, "is nested too deep; an object with numbers, words and lists of them is expected"
        ) from None
    except UnicodeEncodeError:
        raise ForeignFileError(
            path,
            "holds half of a surrogate pair (\\ud800 to \\udfff); whole characters are expected",
        ) from None
    except json.JSONDecodeError as error:
        raise ForeignFileError(
            path, f"is no JSON: {error.msg}", at=f"line {error.lineno}, column {error.colno}"
        ) from None
    except ValueError as error:
        raise ForeignFileError(path, str(error)) from None
    if not isinstance(found, dict):
        raise ForeignFileError(path, "is JSON without names; an object with names is expected")
    return found


def _integer(digits: str) -> int:
    if len(digits.lstrip("-")) > INTEGER_DIGITS_MAX:
        raise ValueError(
            f"holds a number of {len(digits)} digits; at most {INTEGER_DIGITS_MAX} are expected"
        )
    return int(digits)


def _real(digits: str) -> float:
    number = float(digits)
    if not math.isfinite(number):
        raise ValueError(f"holds the number {digits[:INTEGER_DIGITS_MAX]}, which no double holds")
    return number


def _named_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"holds the name {twice!r} twice")
    return found


# --- YAML -----------------------------------------------------------------------------------------

OPENCV_DIRECTIVE = "%YAML:1.0"  # invalid YAML: the colon is OpenCV's own
LACKS_BLANK = re.compile(r"^(\s*[A-Za-z_][\w.]*:)(?=[^\s:/])", re.MULTILINE)
OPENCV_MATRIX = "tag:yaml.org,2002:opencv-matrix"


class _Constructor(SafeConstructor):
    """Reads OpenCV's matrices as objects with the names rows, cols, dt and data."""


_Constructor.add_constructor(
    OPENCV_MATRIX, lambda constructor, node: constructor.construct_mapping(node, deep=True)
)


def yaml_object(path: Path) -> dict[str, Any]:
    """Reads an object in YAML 1.2, where 1e-3 is a number: Kalibr's, OpenCV's, a data set's."""
    return yaml_words(path, text(path, YAML_BYTES_MAX))


def yaml_words(path: Path, words: str) -> dict[str, Any]:
    """Parses the same from the file's text."""
    if len(words) > YAML_BYTES_MAX:
        raise ForeignFileError(path, f"is too long; at most {YAML_BYTES_MAX} bytes are expected")
    _require_shallow(path, words)
    yaml = YAML(typ="safe", pure=True)
    yaml.Constructor = _Constructor
    try:
        found = yaml.load(_as_yaml(words))
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        at = f"line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise ForeignFileError(
            path, f"is no YAML: {error.problem or error.context}", at=at
        ) from None
    except (YAMLError, RecursionError, ValueError) as error:
        raise ForeignFileError(path, f"is no YAML: {_first_line(error)}") from None
    if not isinstance(found, dict) or not all(isinstance(name, str) for name in found):
        raise ForeignFileError(path, "is YAML without names; names with values are expected")
    return found


def _as_yaml(words: str) -> str:
    """Adds the blank after a name's colon, which OpenCV's reader does not need and people omit."""
    if not words.startswith(OPENCV_DIRECTIVE):
        return words
    return LACKS_BLANK.sub(r"\1 ", words.removeprefix(OPENCV_DIRECTIVE))


def _require_shallow(path: Path, words: str) -> None:
    """Refuses deep nesting: the parser takes minutes over thousands of nested brackets."""
    deepest = max(accumulate((c in "[{") - (c in "]}") for c in words), default=0)
    if deepest > YAML_DEPTH_MAX:
        raise ForeignFileError(
            path, "is nested too deep; names with numbers, words and lists of them are expected"
        )


# --- arrays ---------------------------------------------------------------------------------------


def npz(path: Path) -> ArraysByName:
    """Reads all arrays of a .npz file; refuses pickled objects."""
    require_file(path)
    expected = "a .npz file (a zip of numpy arrays, as np.savez makes one) is expected"
    if beginning(path).startswith(NPY_MAGIC):
        raise ForeignFileError(path, f"is a lone array (.npy); {expected}")
    if not zipfile.is_zipfile(path):
        raise ForeignFileError(path, f"is no .npz file, or its end is missing; {expected}")
    try:
        _require_unpackable(path)
        with np.load(path, allow_pickle=False) as file:
            return {key: file[key] for key in file.files}
    except PelorusError:
        raise
    except Exception as error:  # zipfile and numpy raise a dozen kinds on damaged files
        raise ForeignFileError(path, f"cannot be read as .npz: {_first_line(error)}") from error


def _require_unpackable(path: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
    locked = [member.filename for member in members if member.flag_bits & 1]
    if locked:
        raise ForeignFileError(
            path, "is encrypted; a zip without a password is expected", at=locked[0]
        )
    _require_size(path, sum(member.file_size for member in members))


def require_file(path: Path) -> None:
    """Refuses what is no file, an empty one, and one that is too large."""
    if path.is_dir():
        raise ForeignFileError(path, "is a folder; one file of it is expected")
    if not path.is_file():
        raise ForeignFileError(path, "there is no such file")
    size = path.stat().st_size
    if not size:
        raise ForeignFileError(path, "the file is empty")
    _require_size(path, size)


def _require_size(path: Path, size: int) -> None:
    if size > ARRAYS_BYTES_MAX:
        raise ForeignFileError(
            path,
            f"holds {size} bytes of arrays; at most {ARRAYS_BYTES_MAX} are expected: cut the drive "
            "into pieces",
        )


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
