# SPDX-License-Identifier: MIT
"""Makes man pages from `--help`: a page for each command, and that of pelorus-replay."""

from __future__ import annotations

import inspect
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pelorus import __version__
from pelorus.errors import made, write_text
from pelorus.native.replay import find_programs

CONTROL = re.compile(r"^([.'])", re.M)  # begins a request of roff


def text(words: str) -> str:
    """Returns words escaped for roff."""
    return CONTROL.sub(r"\\&\1", words.replace("\\", "\\e").replace("-", "\\-"))


def write(command: Any, folder: Path) -> list[Path]:
    """Writes the pages of the application and its commands into the folder man1."""
    context = command.make_context("pelorus", [], resilient_parsing=True)
    pages = dict(_pages(command, context))
    replay = find_programs(None).float32
    said = subprocess.run([replay, "--help"], capture_output=True, text=True, check=True)
    pages[replay.stem] = _verbatim(replay.stem, said.stdout)
    where = made(folder / "man1")
    paths = [where / f"{name}.1" for name in pages]
    for path, page in zip(paths, pages.values(), strict=True):
        write_text(path, page)
    return paths


def _pages(command: Any, context: Any) -> Iterator[tuple[str, str]]:
    """Yields name and text of each page."""
    name = context.command_path.replace(" ", "-")
    below = getattr(command, "commands", {})
    yield name, _page(name, command, context, below)
    for word, sub in below.items():
        yield from _pages(sub, sub.make_context(word, [], context, resilient_parsing=True))


def _page(name: str, command: Any, context: Any, below: dict[str, Any]) -> str:
    paragraphs = _paragraphs(command)
    usage = " ".join(command.collect_usage_pieces(context))
    page = _head(name, " ".join(paragraphs[0].split()).rstrip("."))
    page += f".SH SYNOPSIS\n.B {text(context.command_path)}\n{text(usage)}\n.SH DESCRIPTION\n"
    page += "".join(f".PP\n{text(paragraph)}\n" for paragraph in paragraphs)
    records = [record for one in command.params if (record := one.get_help_record(context))]
    page += _list("OPTIONS", records)
    page += _list("COMMANDS", [(word, _paragraphs(sub)[0]) for word, sub in below.items()])
    if command.epilog:
        page += f".SH EXAMPLE\n.nf\n{text(command.epilog.removeprefix('Example:').strip())}\n.fi\n"
    others = [f"{name}-{word}" for word in below] or ["pelorus"]
    return page + _see_also(others)


def _verbatim(name: str, help: str) -> str:
    """Returns the page of a program that lays out its help itself."""
    usage, _, rest = help.partition("\n\n")
    page = _head(name, "run the filter over a recording")
    page += f".SH SYNOPSIS\n{text(usage.removeprefix('usage: '))}\n"
    page += f".SH DESCRIPTION\n.nf\n{text(rest.rstrip())}\n.fi\n"
    return page + _see_also(["pelorus"])


def _head(name: str, about: str) -> str:
    return (
        f'.TH "{name.upper()}" "1" "" "Pelorus {__version__}" "Pelorus"\n'
        f".SH NAME\n{text(name)} \\- {text(about)}\n"
    )


def _paragraphs(command: Any) -> list[str]:
    return inspect.cleandoc(command.help or "").replace("\\[", "[").split("\n\n")


def _list(title: str, records: list[tuple[str, str]]) -> str:
    """Returns a section of words and their meanings."""
    rows = [f".TP\n.B {text(word)}\n{text(' '.join(help.split()))}\n" for word, help in records]
    return f".SH {title}\n{''.join(rows)}" if rows else ""


def _see_also(names: list[str]) -> str:
    return ".SH SEE ALSO\n" + ",\n".join(f".BR {text(name)} (1)" for name in names) + "\n"
