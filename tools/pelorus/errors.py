# SPDX-License-Identifier: MIT
"""The one exception that the commands turn into a message and an exit status."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PART_FOLDER = ".part"  # folder for incomplete files
STANDARD_OUTPUT = Path("-")
TEXT_BYTES_MAX = 1 << 20  # of settings and other small files


class PelorusError(Exception):
    """An error that says what is wrong, where, and what would be right."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turns the system's error in writing a file into one that names file and reason."""
    try:
        yield
    except OSError as error:
        raise PelorusError(f"{path}: cannot be written: {error.strerror or error}") from error


class Existing:
    """Whether existing files are overwritten.

    Commands keep them unless the user says --force; callers of the functions overwrite them.
    """

    overwritten = True

    @classmethod
    def keep(cls, *paths: Path) -> None:
        """Raises PelorusError if one of them is a file, and must not be overwritten."""
        for path in paths:
            if path.is_file() and not cls.overwritten:
                raise PelorusError(
                    f"{path}: is there already: give another name, or --force to overwrite it"
                )


@contextmanager
def whole(*paths: Path) -> Iterator[tuple[Path, ...]]:
    """Yields paths to write; the files get their own names when all are complete, else are removed.

    A pipe or /dev/null is written directly, for a file in its place would end it. A link keeps
    pointing at its file, and - is the standard output.
    """
    if paths == (STANDARD_OUTPUT,):
        with _collected() as part:
            yield (part,)
        return
    files = places(*paths)
    parts = tuple(_part(file) for file in files)
    try:
        yield parts
        for path, file, part in zip(paths, files, parts, strict=True):
            if part != file:
                with writing(path):
                    part.replace(file)
    finally:  # after a good end they have their own names
        for file, part in zip(files, parts, strict=True):
            if part != file:
                with suppress(OSError):
                    part.unlink(missing_ok=True)


def places(*paths: Path) -> tuple[Path, ...]:
    """Returns the files behind the paths; raises PelorusError where one can be none. Commands that
    compute for minutes ask before.
    """
    files = tuple(_file_of(path) for path in paths)
    for path, file in zip(paths, files, strict=True):
        if not file.parent.exists():
            raise PelorusError(f"{path}: cannot be written: there is no folder {file.parent}")
        if file.is_dir():
            raise PelorusError(f"{path}: cannot be written: is a folder")
    return files


@contextmanager
def _collected() -> Iterator[Path]:
    """Yields a file that goes to the standard output when it is complete."""
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        part = Path(folder) / "out"
        yield part
        with part.open("rb") as stream:
            shutil.copyfileobj(stream, sys.stdout.buffer)
        sys.stdout.buffer.flush()


def _file_of(path: Path) -> Path:
    """Returns the file to which a link points; /dev/stdout stays, for only the link has a name."""
    opens_no_file = path.exists() and not path.is_file()
    return resolved(path) if path.is_symlink() and not opens_no_file else path


def resolved(path: Path) -> Path:
    """Returns the path behind all links; raises PelorusError where they lead back to themselves."""
    try:
        return path.resolve()
    except (OSError, RuntimeError) as error:  # the latter until Python 3.12
        raise PelorusError(f"{path}: is a link that leads back to itself") from error


def _part(file: Path) -> Path:
    """Returns where to write a file until it is complete; a device or a pipe itself."""
    is_device = file.exists() and not file.is_file() and not file.is_dir()
    return file if is_device else file.with_name(file.name + ".part")


def write_text(path: Path, text: str) -> None:
    """Writes the whole file, or nothing of it; escapes what is not UTF-8, as in a file's name."""
    with whole(path) as (part,), writing(path):
        part.write_text(text, encoding="utf-8", errors="backslashreplace")


def made(folder: Path) -> Path:
    """Creates the folder if need be, and returns it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PelorusError(f"{folder}: cannot be made: {error.strerror}") from error
    return folder


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yields a folder for files that belong together.

    They move into the given folder when all are complete, in place of files of their names; if that
    fails nothing of them remains.
    """
    absent = [path for path in (folder, *folder.parents) if not path.exists()]
    part = folder / PART_FOLDER
    try:
        shutil.rmtree(made(folder) / PART_FOLDER, ignore_errors=True)  # of one that was killed
        yield made(part)
        with writing(folder):
            _move(part, folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)
        for path in absent:
            with suppress(OSError):  # after a good end they hold something
                path.rmdir()


def _move(part: Path, folder: Path) -> None:
    for path in sorted(part.iterdir()):
        if path.is_dir():
            (folder / path.name).mkdir(exist_ok=True)
            _move(path, folder / path.name)
        else:
            path.replace(folder / path.name)


def read_text(path: Path) -> str:
    """Returns a text file's content; raises PelorusError where it is none, or does not end."""
    try:
        with path.open("rb") as stream:
            found = stream.read(TEXT_BYTES_MAX + 1)
        if len(found) > TEXT_BYTES_MAX:
            raise PelorusError(f"{path}: is too long: at most {TEXT_BYTES_MAX} bytes are expected")
        return found.decode("utf-8").replace("\r\n", "\n")
    except OSError as error:
        raise PelorusError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise PelorusError(f"{path}: is no text in UTF-8") from error


def gives_up_output() -> bool:
    """Returns whether standard output fails, and if so discards all further output.

    Otherwise Python would report it once more at its exit.
    """
    try:
        sys.stdout.flush()
        os.write(sys.stdout.fileno(), b"\n")
    except OSError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
        return True
    return False
