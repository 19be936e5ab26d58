# SPDX-License-Identifier: MIT
"""The trajectories with landmarks and truth, seen from above."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pelorus.grid import plane
from pelorus.grid.plane import Plane
from pelorus.math import se3
from pelorus.program.style import BLACK, DPI, GREEN, PENS, PURPLE, TRUTH, WIDTH_IN, panel
from pelorus.report.comparison import Comparison
from pelorus.report.results import OWN
from pelorus.wire.layout import Floats

MARGIN = 0.15  # of the larger side
STRAY = 0.75  # share of the larger side by which another run may widen the picture
SIGMA_MAX = 0.05  # of the larger side: a less certain landmark is not drawn
EXTENT_MIN_M = 1e-3  # a recording at rest needs axes too
LEFT_IN, BOTTOM_IN, TOP_IN = 0.9, 0.7, 0.4  # room for labels and title
PANEL_IN = 6.7  # the legend stands to the right of it
PANEL_HEIGHT_IN = (3.5, 8.0)
FEW = 200  # up to so many landmarks get larger dots


class Box(NamedTuple):
    """Corners (2,) in the plane, m."""

    low: Floats
    high: Floats

    @property
    def side(self) -> float:
        return max(float((self.high - self.low).max()), EXTENT_MIN_M)

    def grown(self, by: float) -> Box:
        return Box(self.low - by, self.high + by)

    def shaped(self, width_to_height: float) -> Box:
        """Returns the box widened in one direction to a panel's shape, without distortion."""
        width, height = self.high - self.low
        half = np.array(
            [max(width, height * width_to_height), max(height, width / width_to_height)]
        )
        middle = (self.low + self.high) / 2
        return Box(middle - half / 2, middle + half / 2)


class TopView(NamedTuple):
    """The plane, and everything in its coordinates (n, 2)."""

    plane: Plane
    paths: dict[str, Floats]
    truth: Floats | None
    known: Floats
    landmarks: Floats
    uncertain: int  # landmarks that are not drawn
    box: Box


def view(compared: Comparison) -> TopView:
    """Chooses the plane and the picture's limits."""
    main = compared.accuracy.get(OWN)
    looked_at = plane.choose(compared.subject.header.body_axes, compared.main.trajectory.poses)
    paths = {run.name: looked_at.flat(run.trajectory.poses.p) for run in compared.runs}
    truth = looked_at.flat(main.truth.p) if main else None
    box = _limits(paths, truth)
    points = compared.main.landmarks
    shown = points.sigma_m <= SIGMA_MAX * box.side
    known = compared.subject.known_W_m
    if main:  # known landmarks are in the truth's world, the picture in the estimate's
        known = se3.apply(main.A, known)
    landmarks = looked_at.flat(points.p_W_m[shown])
    return TopView(
        looked_at, paths, truth, looked_at.flat(known), landmarks, int((~shown).sum()), box
    )


def _limits(paths: dict[str, Floats], truth: Floats | None) -> Box:
    """Returns limits around the main run and the truth; the other runs widen them to a limit."""
    core = paths[OWN] if truth is None else np.concatenate((paths[OWN], truth))
    whole = around(core, tuple(paths.values()), STRAY)
    return whole.grown(MARGIN * whole.side)


def around(core: Floats, others: Sequence[Floats], stray: float) -> Box:
    """Returns a box around the core; others widen it by a share of its side at most."""
    inner = Box(core.min(axis=0), core.max(axis=0))
    outmost = inner.grown(stray * inner.side)
    everything = np.concatenate((core, *others))
    low = np.maximum(everything.min(axis=0), outmost.low)
    return Box(low, np.minimum(everything.max(axis=0), outmost.high))


def draw(compared: Comparison) -> Figure:
    """Draws the picture, its plane in the title, its legend beside the data."""
    seen = view(compared)
    width, height = seen.box.high - seen.box.low
    panel_height_in = float(np.clip(PANEL_IN * height / width, *PANEL_HEIGHT_IN))
    figure = Figure(figsize=(WIDTH_IN, BOTTOM_IN + panel_height_in + TOP_IN), dpi=DPI)
    axes = panel(figure, LEFT_IN, BOTTOM_IN, PANEL_IN, panel_height_in)
    fill(axes, seen, PANEL_IN / panel_height_in)
    axes.set_title(f"{compared.subject.title}: {seen.plane.why}", loc="left")
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0)
    return figure


def fill(axes: Axes, seen: TopView, width_to_height: float) -> None:
    """Draws into a panel of the given shape."""
    dots: dict[str, Any] = {"color": GREEN, "marker": ".", "linestyle": "none"}
    size = 3 if len(seen.landmarks) > FEW else 7
    axes.plot(*seen.landmarks.T, markersize=size, alpha=0.6, markeredgewidth=0, **dots)
    axes.plot([], [], markersize=8, label="landmarks", **dots)
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
        if name in seen.paths:
            axes.plot(*seen.paths[name].T, **pen.line)
    if seen.truth is not None:
        axes.plot(*seen.truth.T, **TRUTH.line)
    _mark_ends(axes, seen)
    box = seen.box.shaped(width_to_height)
    axes.set_xlim(box.low[0], box.high[0])
    axes.set_ylim(box.low[1], box.high[1])
    axes.set_aspect("equal")
    axes.set_xlabel(seen.plane.right.label)
    axes.set_ylabel(seen.plane.up.label)


def _mark_ends(axes: Axes, seen: TopView) -> None:
    path = seen.paths[OWN]
    style: dict[str, Any] = {
        "color": PURPLE,
        "markeredgecolor": BLACK,
        "linestyle": "none",
        "zorder": 10,
    }
    axes.plot(*path[0], marker="o", markersize=9, label="start", **style)
    axes.plot(*path[-1], marker="s", markersize=9, label="end", **style)
