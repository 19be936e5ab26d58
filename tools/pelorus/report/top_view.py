# SPDX-License-Identifier: MIT
"""The trajectories with landmarks and truth, seen from above."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pelorus import se3
from pelorus.report import plane
from pelorus.report.comparison import MAIN, Comparison
from pelorus.report.plane import Plane
from pelorus.report.results import Points
from pelorus.report.style import BLACK, GREEN, PENS, PURPLE, TRUTH, WIDTH_IN, new_figure
from pelorus.se3 import Floats

MARGIN = 0.06  # of the larger side
STRAY = 0.75  # a run may widen the picture by so much of the larger side, then it leaves it
SIGMA_MAX = 0.05  # of the larger side: a landmark less certain than that is no point in the picture
EXTENT_MIN_M = 1e-3  # a recording at rest needs axes too
HEIGHT_IN = (4.5, 10.0)


class Box(NamedTuple):
    """Corners (2,) in the plane, m."""

    low: Floats
    high: Floats

    @property
    def side(self) -> float:
        return max(float((self.high - self.low).max()), EXTENT_MIN_M)

    def holds(self, points: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=-1))

    def grown(self, by: float) -> Box:
        return Box(self.low - by, self.high + by)


class View(NamedTuple):
    """The plane, and everything in its coordinates (n, 2)."""

    plane: Plane
    paths: dict[str, Floats]
    truth: Floats | None
    known: Floats
    landmarks: Floats
    hidden: int  # landmarks beyond the picture or too uncertain for it
    box: Box


def view(compared: Comparison) -> View:
    """Choose the plane and the picture's limits."""
    main = compared.accuracy.get(MAIN)
    looked_at = plane.choose(compared.subject.header.body_axes, compared.main.trajectory.poses)

    def flat(points: Floats) -> Floats:
        return np.stack((looked_at.right.of(points), looked_at.up.of(points)), axis=-1)

    paths = {run.name: flat(run.trajectory.poses.p) for run in compared.runs}
    truth = flat(main.truth.p) if main else None
    box = _limits(paths, truth)
    points = compared.main.landmarks
    shown = _certain(points, box) & box.holds(flat(points.p_W_m))
    known = compared.subject.known_W_m
    if main:  # they lie in the truth's world, and the picture is in the estimate's
        known = se3.apply(main.A, known)
    landmarks = flat(points.p_W_m[shown])
    return View(looked_at, paths, truth, flat(known), landmarks, int((~shown).sum()), box)


def _certain(points: Points, box: Box) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    return np.asarray(points.sigma_m <= SIGMA_MAX * box.side)


def _limits(paths: dict[str, Floats], truth: Floats | None) -> Box:
    """Around the main run and the truth; the other runs widen it, but cannot blow it up."""
    core = paths[MAIN] if truth is None else np.concatenate((paths[MAIN], truth))
    inner = Box(core.min(axis=0), core.max(axis=0))
    outmost = inner.grown(STRAY * inner.side)
    everything = np.concatenate((core, *paths.values()))
    low = np.maximum(everything.min(axis=0), outmost.low)
    high = np.minimum(everything.max(axis=0), outmost.high)
    whole = Box(low, high)
    return whole.grown(MARGIN * whole.side)


def draw(compared: Comparison) -> Figure:
    """The picture, its caption as the title, its legend beside the data."""
    seen = view(compared)
    width, height = seen.box.high - seen.box.low
    panel_in = WIDTH_IN - 3.2  # the legend stands to the right
    figure = new_figure(WIDTH_IN, float(np.clip(panel_in * height / width + 1.0, *HEIGHT_IN)))
    axes = figure.subplots()
    fill(axes, seen)
    axes.set_title(f"{compared.subject.title}: {seen.plane.why}", loc="left")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right upper")
    return figure


def fill(axes: Axes, seen: View) -> None:
    """Draw into axes that are already there."""
    axes.scatter(
        seen.landmarks[:, 0],
        seen.landmarks[:, 1],
        s=5,
        color=GREEN,
        alpha=0.55,
        linewidths=0,
        label="landmarks (body)",
    )
    if len(seen.known):
        axes.scatter(
            seen.known[:, 0],
            seen.known[:, 1],
            s=60,
            facecolors="none",
            edgecolors=BLACK,
            label="known landmarks",
        )
    for name, pen in PENS.items():
        axes.plot(*seen.paths[name].T, **pen.line)
    if seen.truth is not None:
        axes.plot(*seen.truth.T, **TRUTH.line)
    _mark_ends(axes, seen)
    axes.set_xlim(seen.box.low[0], seen.box.high[0])
    axes.set_ylim(seen.box.low[1], seen.box.high[1])
    axes.set_aspect("equal")
    axes.set_xlabel(seen.plane.right.label)
    axes.set_ylabel(seen.plane.up.label)


def _mark_ends(axes: Axes, seen: View) -> None:
    path = seen.paths[MAIN]
    style: dict[str, Any] = {
        "color": PURPLE,
        "markeredgecolor": BLACK,
        "linestyle": "none",
        "zorder": 10,
    }
    axes.plot(*path[0], marker="o", markersize=9, label="start", **style)
    axes.plot(*path[-1], marker="s", markersize=9, label="end (body)", **style)
