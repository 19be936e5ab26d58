# SPDX-License-Identifier: MIT
"""What the commands say: results to stdout, progress and errors to stderr.

Words of a file, a board or an emulator may hold anything. A terminal obeys control characters: an
ESC moves its cursor, renames its window, or types. So both consoles show them instead.
"""

from __future__ import annotations

import json
import math
import time
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import Progress, track
from rich.text import Text

Item = TypeVar("Item")

# Categories that are not printed: control, format (which may change the text's direction),
# surrogate.
UNPRINTABLE = ("Cc", "Cf", "Cs", "Zl", "Zp")
LAYOUT = "\n\t"


def shown(words: str) -> str:
    r"""Returns the words with control characters made visible: ESC becomes \x1b."""
    if words.isprintable():
        return words
    return "".join(c if _harmless(c) else _escape(ord(c)) for c in words)


def one_line(words: str) -> str:
    """Returns another program's words in one line, so that they cannot begin a line of ours."""
    return words.replace("\n", "\\n")


def _harmless(character: str) -> bool:
    return character in LAYOUT or unicodedata.category(character) not in UNPRINTABLE


def _escape(code: int) -> str:
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


class SafeConsole(Console):
    """A console that passes every printed string, also in tables, through `shown`."""

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(shown(text), **options)


# No emoji: tcp:x:5000 would be printed with a cross in it.
out = SafeConsole(highlight=False, soft_wrap=True, emoji=False)
err = SafeConsole(stderr=True, highlight=False, soft_wrap=True, emoji=False)


def tell_lines(lines: Iterable[tuple[str, str]]) -> None:
    """Prints a line for each thing, never cut: a board's own words and a path may be long."""
    for name, words in lines:
        out.print(f"{name:<8}  {words}", markup=False)


def print_json(found: dict[str, Any]) -> None:
    """Prints one object, the whole output of a command; numbers that are not finite become null."""
    out.print(json.dumps(_finite(found), indent=2, allow_nan=False), markup=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def leave_standard_output() -> None:
    """Redirects results to the errors' stream, for standard output is a file's."""
    out.stderr = True


SAID_EVERY_S = 10.0  # without a terminal


@dataclass
class _Told:
    """How far the command is, and when that was last printed."""

    steps: int = 0
    step: int = 0
    words: str = ""
    clock: Callable[[], float] = time.monotonic
    said_s: float = field(default_factory=time.monotonic)

    def label(self, what: str) -> str:
        return f"step {self.step} of {self.steps}, {self.words}: {what}" if self.steps else what

    def say(self, words: str) -> None:
        """Prints a line, unless one was printed recently."""
        if err.is_terminal or self.clock() - self.said_s < SAID_EVERY_S:
            return
        self.said_s = self.clock()
        err.print(words, markup=False)


told = _Told()


@contextmanager
def steps(count: int) -> Iterator[None]:
    """Begins a command of so many steps; where one command runs another the outer one counts."""
    if told.steps:
        yield
        return
    told.steps, told.step = count, 0
    try:
        yield
    finally:
        told.steps = 0


def step(words: str) -> None:
    """Begins the next step."""
    told.step, told.words = min(told.step + 1, told.steps), words


def progress(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """Yields the items, with a bar on a terminal, a line every ten seconds elsewhere."""
    label = told.label(what)
    if err.is_terminal:
        yield from track(items, label, total, console=err, transient=True)
        return
    of = total if total is not None else len(items) if isinstance(items, Sized) else None
    for done, item in enumerate(items):
        if done:
            told.say(f"{label}, {done}{f' of {of}' if of else ''}")
        yield item


@contextmanager
def tally(what: str, count: int, weight: float) -> Iterator[Callable[[float], None]]:
    """Yields a function that counts one of `count` as done, of this share of the whole weight.

    Shows how many are done, and the time left: by weight, for they differ.
    """
    begun_s, done = told.clock(), 0
    weighed = 0.0
    with Progress(console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(f"{what}, 0 of {count}", total=weight)

        def advance(share: float) -> None:
            nonlocal done, weighed
            done, weighed = done + 1, weighed + share
            left_s = (told.clock() - begun_s) * (weight - weighed) / max(weighed, 1e-9)
            words = f"{what}, {done} of {count}"
            bar.update(task, completed=weighed, description=words)
            told.say(f"{words}, about {spoken_time(left_s)} left")

        yield advance


def spoken_time(seconds: float) -> str:
    """Returns `40 s`, `12 min` or `3 h 5 min`."""
    minutes = round(seconds / 60)
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """Shows a sign of life on a terminal during work whose progress is unknown."""
    told.say(told.label(what))
    if not err.is_terminal:
        yield
        return
    with err.status(told.label(what)):
        yield
