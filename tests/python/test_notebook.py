# SPDX-License-Identifier: MIT
"""The notebooks of docs/notebooks: every cell runs, in order, and comes to what the text says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
from replay_drive import BIN, ROOT

NOTEBOOK = ROOT / "docs/notebooks/filter.ipynb"


def executed(path: Path) -> dict[str, Any]:
    """The names that its cells leave. Jupyter's own runner would bring thirty packages for this."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    names: dict[str, Any] = {"__name__": "__main__"}
    for k, cell in enumerate(notebook["cells"]):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{path.name}, cell {k}", "exec"), names)
    return names


def test_the_filters_notebook_ends_with_a_consistent_filter(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PELORUS_BIN", str(BIN))
    mpl.use("Agg")
    names = executed(NOTEBOOK)
    assert len(names["errors"]) == len(names["reports"]) > 500
    assert 0.5 < names["nees_per_dof"] < 2
    assert names["inside"] > 0.95  # of one drive: neighbouring frames err alike
    assert len(names["landmarks"]) == 50


def test_the_filters_notebook_shows_what_it_drew() -> None:
    """Whoever reads it without running it sees the outputs of one whole run."""
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    kinds = {kind for cell in code for out in cell["outputs"] for kind in out.get("data", ())}
    assert "image/png" in kinds
    assert not [out for cell in code for out in cell["outputs"] if out["output_type"] == "error"]
