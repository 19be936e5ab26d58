# SPDX-License-Identifier: MIT
"""--view: a drive in Rerun while it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from pelorus.errors import Existing
from pelorus.wire.frames import Message

VIEW = typer.Option(
    None,
    "--view",
    metavar="spawn|URL|OUT.rrd",
    help="Show it in Rerun while it runs: in a viewer that is started, one that runs already, "
    "or a file; as pelorus view does of a log.",
)


@contextmanager
def watching(where: str | None) -> Iterator[Callable[[Message], None]]:
    """Gives what takes each message of inputs and answers, in their order."""
    if where is None:
        yield lambda _: None
        return
    from pelorus.view.drive import ShownDrive  # noqa: PLC0415 - scipy loads slowly
    from pelorus.view.in_rerun import InRerun  # noqa: PLC0415

    file = Path(where) if where.endswith(".rrd") else None
    if file is not None:
        Existing.keep(file)
    spawn = where == "spawn"
    drive = ShownDrive([InRerun(file, None if spawn or file else where, spawn)])
    try:
        yield drive.take
    finally:
        drive.end()
