# SPDX-License-Identifier: MIT
"""What the commands say: results to stdout, progress and errors to stderr.

Words of a file, a board or an emulator may hold anything. A terminal obeys control characters: an
ESC moves its cursor, renames its window, or types. So both consoles show them instead.
"""

from __future__ import annotations

import json
import math
import unicodedata
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from rich.console import Console
from rich.markup import escape
from rich.progress import track
from rich.text import Text

if TYPE_CHECKING:
    from pelorus.check.verdict import Verdict

Item = TypeVar("Item")

# Control, format (these turn the direction of what follows), surrogate: what is not to be printed.
UNPRINTABLE = ("Cc", "Cf", "Cs", "Zl", "Zp")
LAYOUT = "\n\t"


def shown(words: str) -> str:
    r"""The words with what a terminal would obey made visible: ESC becomes \x1b."""
    if words.isprintable():
        return words
    return "".join(c if _harmless(c) else _escape(ord(c)) for c in words)


def one_line(words: str) -> str:
    """What another program says, in a line of ours: it cannot begin one itself."""
    return words.replace("\n", "\\n")


def _harmless(character: str) -> bool:
    return character in LAYOUT or unicodedata.category(character) not in UNPRINTABLE


def _escape(code: int) -> str:
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


class SafeConsole(Console):
    """Every string that is printed, in a table too, goes through `shown`."""

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(shown(text), **options)


# No emoji: tcp:x:5000 would be printed with a cross in it.
out = SafeConsole(highlight=False, soft_wrap=True, emoji=False)
err = SafeConsole(stderr=True, highlight=False, soft_wrap=True, emoji=False)


def print_json(found: dict[str, Any]) -> None:
    """One object, the whole output of a command. What is not finite has no number in JSON: null."""
    out.print(json.dumps(_finite(found), indent=2, allow_nan=False), markup=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def leave_standard_output() -> None:
    """Results go where errors go: the standard output is a file's."""
    out.stderr = True


def progress(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """A bar on a terminal, nothing elsewhere."""
    yield from track(items, what, total, console=err, transient=True, disable=not err.is_terminal)


VERDICT_COLOURS = {"good": "green", "care": "yellow", "bad": "red"}


def tell_verdict(verdict: Verdict) -> None:
    """In its colour, with the reasons and what to set: the first lines of every command that has
    one.
    """
    head, *why = verdict.lines()
    out.print(f"[bold {VERDICT_COLOURS[verdict.mark]}]{escape(head)}[/]")
    for words in why:
        out.print(escape(words))


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """For one piece of work that cannot say how far it is: a sign of life on a terminal."""
    if not err.is_terminal:
        yield
        return
    with err.status(what):
        yield
