# SPDX-License-Identifier: MIT
"""Tests do not silently test an installed package in the place of this tree."""

from __future__ import annotations

from pathlib import Path

import own_tree
import pytest


def test_these_tests_and_what_they_start_import_this_tree() -> None:
    for found in (own_tree.here(), own_tree.started()):
        assert set(found) == set(own_tree.PACKAGES)
        assert own_tree.foreign(found) == ""


def test_another_or_no_package_is_told() -> None:
    right = own_tree.here()
    said = own_tree.foreign(right | {"pelorus": "/usr/lib/python3/dist-packages/pelorus"})
    assert "would test pelorus of /usr/lib/python3/dist-packages/pelorus" in said
    assert "would test pelorus_course of nowhere" in own_tree.foreign(
        right | {"pelorus_course": ""}
    )


def test_what_wins_in_a_started_program_is_seen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An editable install is a finder that comes first."""
    other = tmp_path / "pelorus" / "__init__.py"
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "from importlib.util import spec_from_file_location\n"
        "class First:\n"
        "    @staticmethod\n"
        "    def find_spec(name, path=None, target=None):\n"
        f"        if name == 'pelorus':\n"
        f"            return spec_from_file_location(name, {str(other)!r})\n"
        "sys.meta_path.insert(0, First)\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert f"would test pelorus of {other}" in own_tree.foreign(own_tree.started())
