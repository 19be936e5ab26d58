# SPDX-License-Identifier: MIT
"""`pelorus --man-pages`: a page a command, with every option that its help has."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from converted import Run
from pelorus.commands import man
from pelorus.commands.application import application
from pelorus.commands.cli import COMMANDS
from replay_drive import BIN


@pytest.fixture
def pages(pelorus: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    monkeypatch.setenv("PELORUS_BIN", str(BIN))
    said = pelorus("--man-pages", tmp_path / "man")
    found = {path.stem: path.read_text() for path in (tmp_path / "man/man1").glob("*.1")}
    assert said.out == f"{len(found)} man pages: {tmp_path / 'man/man1'}\n"
    return found


def commands(command: Any, name: str = "pelorus") -> Iterator[tuple[str, Any]]:
    yield name, command
    for word, below in getattr(command, "commands", {}).items():
        yield from commands(below, f"{name}-{word}")


def test_every_command_has_its_page_with_every_option(pages: dict[str, str]) -> None:
    all_of_them = dict(commands(typer.main.get_command(application(COMMANDS, others=True))))
    assert len(all_of_them) > 20
    assert pages.keys() == {*all_of_them, "pelorus-replay"}
    for name, command in all_of_them.items():
        options = [one for p in command.params if not getattr(p, "hidden", 0) for one in p.opts]
        for option in options:
            if option.startswith("--"):
                assert man.text(option) in pages[name], (name, option)
    assert man.text("--pixel-sigma") in pages["pelorus-replay"]


@pytest.mark.skipif(not shutil.which("groff"), reason="no groff")
def test_roff_takes_the_pages_without_a_warning(pages: dict[str, str]) -> None:
    for name, page in pages.items():
        done = subprocess.run(
            ["groff", "-man", "-Tutf8", "-ww", "-Kutf8", "-P-c"],
            input=page.encode(), capture_output=True, check=False,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, b""), name
        shown = re.sub(r".\x08", "", done.stdout.decode())  # struck twice: bold
        for title in ("NAME", "SYNOPSIS", "DESCRIPTION"):
            assert f"\n{title}\n" in shown, name


def test_what_would_be_a_request_of_roff_is_shown() -> None:
    assert man.text(".conf\n'a' \\ --b") == "\\&.conf\n\\&'a' \\e \\-\\-b"
