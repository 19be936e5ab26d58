# SPDX-License-Identifier: MIT
"""The covariance in a world that shares nothing with the other tests: tests/independent."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
from draws import draws
from pelorus.wire.frames import Stereo

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "tests/independent/honest.py"
pytestmark = pytest.mark.usefixtures("built")


@pytest.mark.parametrize("words", draws([["--imu", "--runs", "30"], []]))
def test_the_error_of_many_runs_is_as_large_as_the_filter_says(words: list[str]) -> None:
    command = [sys.executable, str(SCRIPT), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(" m, own sigma ") == 8
    assert "GOOD beyond 5 sigma: 0.0000" in done.stdout


@pytest.mark.parametrize("words", [["--told", "focal-sigma=0"], ["--told", "model=world"]])
def test_a_covariance_that_is_too_small_is_seen(words: list[str]) -> None:
    """A calibration that is taken for exact and is not; the textbook's model."""
    command = [sys.executable, str(SCRIPT), "--runs", "20", "--seconds", "8", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "OUTSIDE" in done.stdout


def test_hostile_frames_are_made_and_held_against_the_bound_that_sizes_tells() -> None:
    """An image counts them, made as `tests/independent/bounded.py` says."""
    spec = spec_from_file_location("bounded", ROOT / "tests/independent/bounded.py")
    assert spec
    assert spec.loader
    sys.modules["bounded"] = bounded = module_from_spec(spec)
    spec.loader.exec_module(bounded)
    table = (ROOT / "docs/SIZES.md").read_text(encoding="utf-8")
    by_twists = table.split("### With twists")[1]
    row = next(line for line in by_twists.splitlines() if line.startswith("| mps2_an386 | 32 |"))
    assert abs(bounded.bound_of(60) - int(row.split("|")[-2])) < 1
    made = list(bounded.drives(seed=1, count=3, frames=60))
    kinds = Counter(kind for kind, message in made if isinstance(message, Stereo))
    assert set(kinds) == set(bounded.KINDS)
    most = max(len(message.ids) for _, message in made if isinstance(message, Stereo))
    assert most == bounded.MOST_SEEN
