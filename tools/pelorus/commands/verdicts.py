# SPDX-License-Identifier: MIT
"""How commands show a verdict."""

from __future__ import annotations

from rich.markup import escape

from pelorus.check.verdict import Verdict
from pelorus.program.console import out

VERDICT_COLOURS = {"good": "green", "care": "yellow", "bad": "red"}


def tell_verdict(verdict: Verdict) -> None:
    """Prints a verdict in its colour, with reasons and settings, before a command's result."""
    head, *why = verdict.lines()
    out.print(f"[bold {VERDICT_COLOURS[verdict.mark]}]{escape(head)}[/]")
    for words in why:
        out.print(escape(words))
