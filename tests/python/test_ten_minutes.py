# SPDX-License-Identifier: MIT
"""docs/TEN-MINUTES.md, followed command by command; what it quotes is what comes out."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
from draws import long_run
from replay_drive import BIN

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "TEN-MINUTES.md").read_text()
SET_UP = ("pip install",)  # the tests' own environment stands for them
NUMBER = re.compile(r"\d+(?:\.\d+)?")


def commands() -> list[str]:
    """The indented lines; a line that ends in a backslash goes on in the next one."""
    joined = re.sub(r"\\\n +", "", PAGE)
    return re.findall(r"^    (\S.*)$", re.sub(r"(?ms)^```.*?^```$", "", joined), re.MULTILINE)


def quoted() -> list[str]:
    """The lines of output that the page shows."""
    blocks = re.findall(r"(?ms)^```text\n(.*?)^```$", PAGE)
    return [line for block in blocks for line in block.splitlines()]


def words(line: str) -> list[str]:
    return NUMBER.sub("#", line).split()


def numbers(line: str) -> list[float]:
    return [float(number) for number in NUMBER.findall(line)]


def is_said(line: str, output: str) -> bool:
    """In the same words, with numbers that another arithmetic may give."""
    alike = [other for other in output.splitlines() if words(other) == words(line)]
    return any(np.allclose(numbers(other), numbers(line), rtol=0.2, atol=0.01) for other in alike)


def folder_of_the_project(folder: Path) -> None:
    """What a fresh clone has after pip install, and the programs of the tests."""
    (folder / "tools").symlink_to(ROOT / "tools")
    (folder / "build").mkdir()
    (folder / "build" / "bin").symlink_to(BIN.resolve())


@long_run
def test_the_page_does_what_it_says_command_by_command(tmp_path: Path) -> None:
    folder_of_the_project(tmp_path)
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "PELORUS_BIN": str(BIN.resolve()), "COLUMNS": "200"}
    to_run = [command for command in commands() if not command.startswith(SET_UP)]
    assert len(to_run) > 6
    said = ""
    for command in to_run:
        outcome = subprocess.run(
            shlex.split(command),
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert outcome.returncode == 0, f"{command}\n{outcome.stdout}{outcome.stderr}"
        said += outcome.stdout
    assert quoted()
    for line in quoted():
        assert is_said(line, said), f"the page quotes, but nothing said: {line}\n{said}"
    assert (tmp_path / "out" / "mine" / "report.html").is_file()


def test_what_the_example_robot_needs_is_said_in_its_usage() -> None:
    script = ROOT / "tools" / "example_robot.py"
    outcome = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert outcome.returncode == 1
    assert "example_robot.py FOLDER" in outcome.stderr
