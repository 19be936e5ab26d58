# SPDX-License-Identifier: MIT
"""What the commands say: results to stdout, progress and errors to stderr."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

from rich.console import Console
from rich.progress import track

Item = TypeVar("Item")

# No emoji: tcp:x:5000 would be printed with a cross in it.
out = Console(highlight=False, soft_wrap=True, emoji=False)
err = Console(stderr=True, highlight=False, soft_wrap=True, emoji=False)


def progress(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """A bar on a terminal, nothing elsewhere."""
    yield from track(items, what, total, console=err, transient=True, disable=not err.is_terminal)
