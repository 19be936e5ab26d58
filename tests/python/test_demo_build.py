# SPDX-License-Identifier: MIT
"""The demos build what they need and leave a build with tests as it is configured."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TESTS = "PELORUS_BUILD_TESTS"


def configured(tree: Path, cache: str | None) -> str:
    """Returns with which words the demos call cmake in a tree whose build/ is configured so."""
    (tree / "tools").mkdir()
    shutil.copy(ROOT / "tools/setup.sh", tree / "tools")
    said, cmake = tree / "said", tree / "cmake"
    cmake.write_text(f'#!/bin/sh\necho "$*" >>"{said}"\n')
    cmake.chmod(0o755)
    if cache is not None:
        (tree / "build").mkdir()
        (tree / "build/CMakeCache.txt").write_text(f"{TESTS}:BOOL={cache}\n")
    command = ["bash", "-c", f"set -eu; . '{tree}/tools/setup.sh'; build_desktop"]
    path = os.environ | {"PATH": f"{tree}:{os.environ['PATH']}"}
    subprocess.run(command, check=True, env=path)
    words = said.read_text()
    assert "--target pelorus-replay pelorus-replay-f64 pelorus-filter" in words
    return words


def test_a_demo_leaves_a_build_with_tests_as_it_is(tmp_path: Path) -> None:
    assert TESTS not in configured(tmp_path, "ON")


@pytest.mark.parametrize("cache", [None, "OFF"])
def test_a_demo_needs_no_tests(tmp_path: Path, cache: str | None) -> None:
    assert f"{TESTS}=OFF" in configured(tmp_path, cache)


@pytest.mark.parametrize("script", ["demo.sh", "robot-demo.sh"])
def test_both_demos_build_so(script: str) -> None:
    text = (ROOT / "tools" / script).read_text()
    assert "build_desktop" in text
    assert TESTS not in text
