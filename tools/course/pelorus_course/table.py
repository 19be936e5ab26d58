# SPDX-License-Identifier: MIT
"""The comparison in numbers, for the terminal and as a Markdown table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pelorus.evaluate.evaluation import step_change
from pelorus.report.words import NONE, POSE_KEYS, number
from pelorus.wire.layout import Floats

from pelorus_course.trial import NAMES, Trial

TITLES = (
    "recording",
    "run",
    "road m",
    "err0 m",
    "ATE m",
    "rot deg",
    "NEES/6",
    "step change m",
    "used",
    "gated",
    "trace, state",
    "trace, whole map",
)
TRACES = 2  # the last columns


def rows(trials: Sequence[Trial]) -> list[tuple[str, ...]]:
    """Returns cells in the order of TITLES, a row a run."""
    return [_row(trial, name) for trial in trials for name in NAMES]


def _row(trial: Trial, name: str) -> tuple[str, ...]:
    run = trial.compared.run(name)
    fit, found = trial.road_fits.get(name), trial.traces.get(name)
    moving = ("", "") if found is None else (_range(found.active), _range(found.whole))
    return (
        trial.subject.title,
        NAMES[name],
        number(fit.figures.road_m if fit else None),
        *(number(run.summary[key]) for key in POSE_KEYS),
        number(step_change(run.trajectory.poses)),
        str(run.summary["used"]),
        str(run.summary["gated"]),
        *(cell or NONE for cell in moving),
    )


def _range(values: Floats) -> str:
    """Returns the first and the last frame's value, in words."""
    sound = values[np.isfinite(values)]
    return f"{sound[0]:,.0f} to {sound[-1]:,.0f}" if len(sound) else NONE


def summary(trial: Trial) -> str:
    """Returns a sentence on the two traces."""
    found = trial.traces["course"]
    return (
        f"{trial.subject.title}: trace of the covariance of the course's filter: the whole map of "
        f"{found.ids} landmarks {_range(found.whole)}, the state alone {_range(found.active)}"
    )


def markdown(trials: Sequence[Trial]) -> str:
    """Returns the table as Markdown."""
    lines = [TITLES, ("---",) * 2 + ("---:",) * (len(TITLES) - 2), *rows(trials)]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
