# SPDX-License-Identifier: MIT
"""The command `pelorus`. Each command lives in its own file under pelorus/commands.

To add one: write commands/NAME.py with an `app` that has it, and name it in COMMANDS. Only
the command that is called is imported: plotting takes longer to load than most of them to run.
Another package adds a command by an entry point of the group pelorus.commands.
Nothing is imported here before `main` is there to take a Ctrl-C.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from io import TextIOWrapper

COMMANDS = (
    *("try", "convert", "track", "info", "check", "evaluate", "explain", "export", "view"),
    *("simulate", "report", "map", "live", "stream", "compare", "fleet"),
)

INTERRUPTED = 130  # the exit status that shells use for Ctrl-C


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns 0, 1 after an error that was reported, or 2 for a wrong call."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    _say_what_cannot_be_encoded()
    # Before numpy is imported: on matrices as small as these threads cost more than they gain, and
    # wait for each other at full speed.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    signal.signal(signal.SIGTERM, _leave)
    try:
        return _run(words)
    except KeyboardInterrupt:  # while importing; later the application takes it
        return INTERRUPTED


def _leave(number: int, _frame: object) -> None:
    """Ends as after an error: incomplete and temporary files are removed."""
    sys.exit(128 + number)


def _say_what_cannot_be_encoded() -> None:
    r"""Escapes unencodable letters: an umlaut in a name is no error, it becomes \xfc."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")


def _run(words: list[str]) -> int:
    from rich.markup import escape  # noqa: PLC0415 - see above

    import pelorus  # noqa: PLC0415
    from pelorus.program.console import err  # noqa: PLC0415
    from pelorus.program.distribution import mixed_up  # noqa: PLC0415

    if said := mixed_up():
        err.print(f"[bold yellow]warning:[/] {escape(said)}")
        if not hasattr(pelorus, "ARITHMETIC"):  # it has overwritten this one
            return 1
    from pelorus.commands.application import application  # noqa: PLC0415
    from pelorus.errors import PelorusError, gives_up_output  # noqa: PLC0415

    is_ours = bool(words) and words[0] in COMMANDS
    needs_all = not is_ours and words[:1] != ["--version"]
    app = application(COMMANDS if needs_all else words[:1] * is_ours, others=needs_all)
    status = 0
    try:
        try:
            app(args=words, prog_name="pelorus")
        except SystemExit as leaving:
            status = leaving.code if isinstance(leaving.code, int) else 1
        if sys.stdout is not None:
            sys.stdout.flush()
    except PelorusError as error:
        err.print(f"[bold red]error:[/] {escape(str(error))}")
        return 1
    except OSError as error:
        if not gives_up_output():
            raise
        if not isinstance(error, BrokenPipeError):  # who closed the pipe has read enough
            err.print(f"pelorus: cannot write to standard output: {error.strerror}", markup=False)
        return 1
    return status
