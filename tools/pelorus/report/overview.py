# SPDX-License-Identifier: MIT
"""The table of the runs, the same on the terminal and on the page."""

from __future__ import annotations

from typing import Any

from pelorus.report.results import Run

NONE = "-"
TITLES = (
    "run",
    "err0 m",
    "ATE m",
    "rotation deg",
    "NEES/6",
    "used",
    "gated",
    "times real time",
)


def row(run: Run) -> tuple[str, ...]:
    """Cells in the order of TITLES."""
    summary = run.summary
    return (
        run.name,
        number(summary["err0_m"]),
        number(summary["ate_m"]),
        number(summary["rot_deg"]),
        number(summary["nees_per_dof"]),
        str(summary["used"]),
        str(summary["gated"]),
        _factor(summary["realtime_factor"]),
    )


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
