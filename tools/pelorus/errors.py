# SPDX-License-Identifier: MIT
"""The one exception that the commands turn into a message and an exit status."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


class PelorusError(Exception):
    """Says what is wrong, where, and what would be right."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Where the system does not let a file be written, say which and why."""
    try:
        yield
    except OSError as error:
        raise PelorusError(f"{path}: cannot be written: {error.strerror or error}") from error


@contextmanager
def whole(*paths: Path) -> Iterator[tuple[Path, ...]]:
    """Where to write files that shall be whole: they get their names when all are written, and if
    that fails nothing of them is left behind.
    """
    parts = tuple(path.with_name(path.name + ".part") for path in paths)
    try:
        yield parts
        for path, part in zip(paths, parts, strict=True):
            with writing(path):
                part.replace(path)
    finally:  # after a good end they have their own names
        for part in parts:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """The whole file, or nothing of it."""
    with whole(path) as (part,), writing(path):
        part.write_text(text, encoding="utf-8")


def made(folder: Path) -> Path:
    """The folder, which is there from now on."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PelorusError(f"{folder}: cannot be made: {error.strerror}") from error
    return folder


def read_text(path: Path) -> str:
    """A text file as it is; PelorusError where it is none."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise PelorusError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise PelorusError(f"{path}: is no text in UTF-8") from error
