# SPDX-License-Identifier: MIT
"""The table of the runs, the same on the terminal and on the page."""

from __future__ import annotations

from typing import Any

from pelorus.report.comparison import Comparison
from pelorus.report.results import Run

NONE = "-"
POSE = ("err0 m", "ATE m", "rotation deg", "NEES/6")
MAP = ("map m", "NEES/3")
USE = ("used", "gated", "times real time")
POSE_KEYS = ("err0_m", "ate_m", "rot_deg", "nees_per_dof")


def titles(compared: Comparison) -> tuple[str, ...]:
    """The map's columns stand only where the recording knows its landmarks."""
    return ("run", *POSE, *(MAP if compared.subject.known else ()), *USE)


def row(compared: Comparison, run: Run) -> tuple[str, ...]:
    """Cells in the order of the titles. In mapping the poses are given: they have no error."""
    summary = run.summary
    pose = (NONE if run.poses_given else number(summary[key]) for key in POSE_KEYS)
    found = compared.map_error.get(run.name)
    of_map: tuple[str, ...] = ()
    if compared.subject.known:
        of_map = (NONE,) * len(MAP)
    if found is not None:
        of_map = (number(found.map_rms_m), number(found.map_nees))
    use = (str(summary["used"]), str(summary["gated"]), _factor(summary["realtime_factor"]))
    return (run.name, *pose, *of_map, *use)


def number(value: Any) -> str:
    """Three digits, and no more than a millimetre."""
    if value is None:
        return NONE
    if abs(value) >= 1e5:
        return f"{value:.2e}"
    return f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"


def _factor(value: Any) -> str:
    if value is None:
        return NONE
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"
