# SPDX-License-Identifier: MIT
"""The report's figures 1 and 2, a column a recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pelorus.program.style import BLACK, BLUE, GREEN, ORANGE, PENS, TRUTH, VERMILLION, new_figure
from pelorus.report.comparison import OWN
from pelorus.report.pictures import Box, around
from pelorus.wire.layout import Floats

from pelorus_course.trial import NAMES, Trial

COLUMN_IN, HEIGHT_1_IN, HEIGHT_2_IN = 7.0, 6.4, 6.0
MARGIN = 0.08  # of the larger side
STRAY = 0.4  # of the larger side, by which dead reckoning may widen the picture


def figure_1(trials: Sequence[Trial]) -> Figure:
    """Draws dead reckoning, the course's filter and ours over truth or road, with the landmarks."""
    figure = new_figure(COLUMN_IN * len(trials), HEIGHT_1_IN)
    panels = figure.subplots(1, len(trials), squeeze=False)[0]
    for axes, trial in zip(panels, trials, strict=True):
        _trajectories(axes, trial)
    layout = panels[0].get_gridspec()
    layout.set_width_ratios([_shape(axes) for axes in panels])
    handles: dict[str, Any] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(handles.values(), handles.keys(), loc="outside lower center",
                  ncols=2 if len(trials) == 1 else 6, markerscale=3)  # fmt: skip
    return figure


def _trajectories(axes: Axes, trial: Trial) -> None:
    paths = {run.name: trial.flat(run.name, run.trajectory.poses.p) for run in trial.runs}
    true = trial.true_path
    for name, colour in (("course", ORANGE), (OWN, GREEN)):
        points = trial.scatter(name)
        axes.plot(*points.T, ".", color=colour, markersize=2, markeredgewidth=0, alpha=0.6,
                  label=f"landmarks of {NAMES[name]}")  # fmt: skip
    if true is not None:
        label = "the road" if trial.road_fits else "truth"
        axes.plot(*true.T, **{**TRUTH.line, "label": label, "linestyle": "-", "linewidth": 4,
                              "alpha": 0.25, "zorder": 2})  # fmt: skip
    for name, path in paths.items():
        axes.plot(*path.T, **{**PENS[name].line, "label": NAMES[name]})
        if not trial.road_fits:
            axes.plot(*path[0], "o", color=BLACK, markersize=5)
    _limit(axes, paths, true)
    axes.set_aspect("equal")
    axes.set_title(_title(trial), loc="left")
    axes.set_xlabel("m")
    axes.set_ylabel("m")


def _limit(axes: Axes, paths: dict[str, Floats], true: Floats | None) -> None:
    """Sets limits around both filters and the reference; dead reckoning widens them to a limit."""
    core = np.concatenate([paths["course"], paths[OWN], *([] if true is None else [true])])
    side = Box(core.min(axis=0), core.max(axis=0)).side
    low, high = around(core, [paths["dead-reckoning"]], STRAY).grown(MARGIN * side)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])


def _shape(axes: Axes) -> float:
    """Returns width to height, so that a narrow path leaves room to a wide one."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    return float(np.clip((right - left) / (high - low), 0.5, 2.0))


def _title(trial: Trial) -> str:
    if trial.road_fits:
        return f"{trial.subject.title}: each fitted to the road"
    if trial.subject.truth is not None:
        return f"{trial.subject.title}: from the true start"
    return f"{trial.subject.title}: no reference"


def figure_2(trials: Sequence[Trial]) -> Figure:
    """Draws the whole map's trace above, which falls, and that of the state's landmarks below."""
    figure = new_figure(COLUMN_IN * len(trials), HEIGHT_2_IN)
    panels = figure.subplots(2, len(trials), squeeze=False, sharex="col")
    for (above, below), trial in zip(panels.T, trials, strict=True):
        found = trial.traces["course"]
        steps = np.arange(len(found.t_ns))
        above.plot(steps, found.whole, color=BLUE)
        above.set_title(f"{trial.subject.title}: the whole map, {found.ids} landmarks", loc="left")
        above.set_ylabel("trace of P (m², rad²)")
        below.plot(steps, found.active, color=VERMILLION)
        below.set_title("the state as it is: pose and the landmarks in its slots", loc="left")
        below.set_ylabel("trace of P (m², rad²)")
        below.set_xlabel("timestep (frames)")
        for axes in (above, below):
            axes.set_ylim(bottom=0)
    return figure
