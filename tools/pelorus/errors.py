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

PART_FOLDER = ".part"  # in a folder: what is not yet whole
STANDARD_OUTPUT = Path("-")
TEXT_BYTES_MAX = 1 << 20  # of settings and other small files


class PelorusError(Exception):
    """Says what is wrong, where, and what would be right."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Where the system does not let a file be written, say which and why."""
    try:
        yield
    except OSError as error:
        raise PelorusError(f"{path}: cannot be written: {error.strerror or error}") from error


class Existing:
    """What becomes of files that are there already. Under a command they are kept, unless the user
    said --force; who calls the functions himself knows what he does.
    """

    overwritten = True

    @classmethod
    def keep(cls, *paths: Path) -> None:
        """PelorusError if one of them is a file, and may not be overwritten."""
        for path in paths:
            if path.is_file() and not cls.overwritten:
                raise PelorusError(
                    f"{path}: is there already: give another name, or --force to overwrite it"
                )


@contextmanager
def whole(*paths: Path) -> Iterator[tuple[Path, ...]]:
    """Where to write files that shall be whole: they get their names when all are written, and if
    that fails nothing of them is left behind. What is there already and is no file, a pipe or
    /dev/null, is written to as it stands: a file that took its name would put an end to it. A link
    keeps pointing at its file, and - is the standard output.
    """
    if paths == (STANDARD_OUTPUT,):
        with _collected() as part:
            yield (part,)
        return
    files = tuple(_file_of(path) for path in paths)
    parts = tuple(_part(file) for file in files)
    for path, file in zip(paths, files, strict=True):
        if not file.parent.exists():
            raise PelorusError(f"{path}: cannot be written: there is no folder {file.parent}")
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


@contextmanager
def _collected() -> Iterator[Path]:
    """A file that goes to the standard output when it is whole."""
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        part = Path(folder) / "out"
        yield part
        with part.open("rb") as stream:
            shutil.copyfileobj(stream, sys.stdout.buffer)
        sys.stdout.buffer.flush()


def _file_of(path: Path) -> Path:
    """The file that a link stands for; of /dev/stdout the link is all that has a name."""
    opens_no_file = path.exists() and not path.is_file()
    return resolved(path) if path.is_symlink() and not opens_no_file else path


def resolved(path: Path) -> Path:
    """The path behind all links; PelorusError where they lead back to themselves."""
    try:
        return path.resolve()
    except (OSError, RuntimeError) as error:  # the latter until Python 3.12
        raise PelorusError(f"{path}: is a link that leads back to itself") from error


def _part(file: Path) -> Path:
    """Where to write a file until it is whole; of a device or a pipe itself."""
    is_device = file.exists() and not file.is_file() and not file.is_dir()
    return file if is_device else file.with_name(file.name + ".part")


def write_text(path: Path, text: str) -> None:
    """The whole file, or nothing of it. What is no UTF-8, as in a file's name, is escaped."""
    with whole(path) as (part,), writing(path):
        part.write_text(text, encoding="utf-8", errors="backslashreplace")


def made(folder: Path) -> Path:
    """The folder, which is there from now on."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PelorusError(f"{folder}: cannot be made: {error.strerror}") from error
    return folder


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Where to make files that belong together: they move into the folder when all are made, in
    place of those of their names, and if that fails nothing of them is left behind.
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
    """A text file as it is; PelorusError where it is none, or no end of it comes."""
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
    """Whether it is standard output that fails: then it does not take a line more. From here on it
    goes nowhere, or Python would complain once more while leaving.
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
