# SPDX-License-Identifier: MIT
"""A board that somebody adds: what the build takes, and what it says where something is missing."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ENTRIES = """
set(board_mine_cpu m4f)
set(board_mine_drivers stm32_usart.c stm32_flash.c)
set(board_mine_largest 32)
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The project's firmware with one folder more among the boards, a copy of the STM32F405's."""
    for part in ("src", "include"):
        (tmp_path / part).symlink_to(ROOT / part)
    port = tmp_path / "port" / "cortex_m"
    shutil.copytree(ROOT / "port" / "cortex_m", port)
    shutil.copytree(port / "boards" / "stm32f405", port / "boards" / "mine")
    return port


def cmake(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["cmake", *words], capture_output=True, text=True, check=False)


def configure(project: Path, *options: str) -> subprocess.CompletedProcess[str]:
    toolchain = f"--toolchain={project / 'toolchain.cmake'}"
    return cmake("-S", project, "-B", project / "build", toolchain, *options)


def test_a_new_board_needs_a_folder_and_its_entries(project: Path) -> None:
    boards = project / "cmake" / "Boards.cmake"
    boards.write_text(boards.read_text(encoding="utf-8") + ENTRIES, encoding="utf-8")
    said = configure(project)
    assert said.returncode == 0, said.stderr
    said = cmake("--build", project / "build", "-j2", "--target", "bringup-mine")
    assert said.returncode == 0, said.stderr
    assert (project / "build" / "images" / "bringup-mine.bin").stat().st_size > 0


@pytest.mark.parametrize(
    ("entries", "options", "due"),
    [
        ("", (), "does not set board_mine_cpu"),
        (ENTRIES.replace("_largest", "_size"), (), "does not set board_mine_largest"),
        (ENTRIES.replace("m4f", "m3"), (), "no cpu_m3"),
        (ENTRIES, ("-DPELORUS_BOARDS=yours",), "no boards/yours/memory.ld; boards are: mine"),
    ],
)
def test_what_a_new_board_lacks_is_told(
    project: Path, entries: str, options: tuple[str, ...], due: str
) -> None:
    boards = project / "cmake" / "Boards.cmake"
    boards.write_text(boards.read_text(encoding="utf-8") + entries, encoding="utf-8")
    said = configure(project, *options)
    assert said.returncode != 0
    assert due in " ".join(said.stderr.split()), said.stderr
