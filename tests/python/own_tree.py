# SPDX-License-Identifier: MIT
"""Which pelorus the tests would test: another checkout's editable install wins over PYTHONPATH."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# Whatever takes part in a test, and where it stands in this tree.
PACKAGES = {"pelorus": ROOT / "tools", "pelorus_course": ROOT / "tools/course"}
FIND = (
    "import importlib.util, sys\n"
    "for name in sys.argv[1:]:\n"
    "    found = importlib.util.find_spec(name)\n"
    "    print(found.origin if found else '')\n"
)


def here() -> dict[str, str]:
    """Returns the file of each package, as this process imports it; empty: none."""
    found = {name: importlib.util.find_spec(name) for name in PACKAGES}
    return {name: (spec.origin or "") if spec else "" for name, spec in found.items()}


def started(python: str = sys.executable) -> dict[str, str]:
    """Returns the same for the programs that tests start, which see another sys.path."""
    command = [python, "-c", FIND, *PACKAGES]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(zip(PACKAGES, done.stdout.split("\n"), strict=False))


def foreign(found: Mapping[str, str]) -> str:
    """Returns what would be tested in place of this tree, in words; empty: nothing."""
    for name, file in found.items():
        if not file or not Path(file).resolve().is_relative_to(PACKAGES[name]):
            return (
                f"tests of {ROOT} would test {name} of {file or 'nowhere'}: "
                f"use this tree's own environment ({ROOT}/.venv; CONTRIBUTING says how)"
            )
    return ""


def require(config: pytest.Config) -> None:
    """Ends pytest where its tests would not be of this tree."""
    wrong = foreign(here())
    if not wrong and not hasattr(config, "workerinput"):
        wrong = foreign(started())
    if wrong:
        raise pytest.UsageError(wrong)
