# SPDX-License-Identifier: MIT
"""One command runs another."""

from __future__ import annotations

from rich.markup import escape

from pelorus.program.console import out


def run_command(*words: str) -> int:
    """Another command, as the user could give it; returns its exit status."""
    from pelorus.commands.application import application  # noqa: PLC0415 - it imports the commands

    out.print(f"[bold]$ pelorus {escape(' '.join(words))}[/]")
    status = application(words[:1])(args=list(words), standalone_mode=False)
    return status if isinstance(status, int) else 0
