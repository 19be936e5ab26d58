# SPDX-License-Identifier: MIT
"""The covariance in a world that shares nothing with the other tests: tests/independent."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from draws import draws

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
