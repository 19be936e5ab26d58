# SPDX-License-Identifier: MIT
"""The pictures of a report: two for the page and two to show elsewhere.

Those for the page are the map and the whole map's covariance with the course's filter. The page
itself draws all curves over time. The others are the trajectories with landmarks and truth, seen
from above, and one for a README.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pelorus.grid import picture, plane
from pelorus.grid.files import heights
from pelorus.grid.plane import Plane
from pelorus.math import se3
from pelorus.program.style import (
    BLACK,
    DPI,
    GREEN,
    GREY,
    PENS,
    PURPLE,
    RHO,
    SIGMA,
    TRUTH,
    WIDTH_IN,
    legend_above,
    limit_decades,
    new_figure,
    panel,
)
from pelorus.report.comparison import COURSE, OWN, Comparison, Run
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


def top_view(compared: Comparison) -> Figure:
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


CURVE_MIN = 2  # frames: one point is no curve


class ReportPicture(NamedTuple):
    """A file `name`.png; without a caption it is not on the page."""

    name: str
    title: str
    caption: str
    draw: Callable[[], Figure]


def pictures(compared: Comparison) -> list[ReportPicture]:
    """Returns the pictures in the page's order; a curve needs two frames."""
    seen = ReportPicture("top-view", "", "", partial(top_view, compared))
    out = [*_map(compared), seen]
    if len(compared.main.frames.t_ns) < CURVE_MIN:
        return out
    if compared.has_course:
        words = f"{COVARIANCE} {WHOLE_MAP.format(ids=compared.whole_map.ids)}"
        draw = partial(covariance, compared)
        out.append(ReportPicture("covariance", "Trace of the covariance", words, draw))
    own = compared.accuracy.get(OWN)
    if own is not None and len(own.t_ns) >= CURVE_MIN and not compared.main.poses_given:
        out.append(ReportPicture("hero", "", "", partial(hero, compared)))
    return out


COVARIANCE = (
    "Above, of the state as it is: pose and the landmarks in its slots, more of them at one time "
    "than at another. The models count landmarks in different units (world in metres, body in "
    "angles and inverse range), so compare the runs below, where it is the position alone."
)
WHOLE_MAP = (
    "In the middle, of the whole map, the course's figure 2, for the course's filter: all {ids} "
    "landmarks of the recording, those not seen yet at their prior of 6 m², those that have left "
    "with the covariance with which they left."
)


def _map(compared: Comparison) -> list[ReportPicture]:
    grid = compared.grid
    if grid is None:
        return []
    words = (
        f"Cells of {grid.resolution_m:g} m, {heights(grid.band)}, from the rays between the camera "
        "and the landmarks of your run, weighted by the landmarks' covariance. `pelorus map` draws "
        "it with other settings, and writes it for nav2's map_server."
    )
    title = f"{compared.subject.title}: {grid.plane.why}"
    return [ReportPicture("map", "Free and occupied", words, partial(picture.draw, grid, title))]


# --- errors and the band that the covariance promises ---------------------------------------------

SIGMAS = 3.0
HEADROOM = 1.1
BAND_MAX = 6.0  # ratio to the largest error: a wider band would flatten the error


def _error_in_band(axes: Axes, t: Floats, error: Floats, band: Floats, name: str) -> None:
    """Draws one error with its band."""
    pen = PENS[name]
    axes.fill_between(
        t,
        -band,
        band,
        color=pen.colour,
        alpha=0.25,
        linewidth=0,
        label=f"± 3 {SIGMA} ({pen.label})",
    )
    axes.axhline(0, color=GREY, linewidth=1)
    axes.plot(t, error, color=BLACK, linewidth=1.2, label="error")


def limits(error: Floats, band: Floats) -> tuple[float, float]:
    """Returns symmetric limits that hold every error, and the band as far as the error stays
    legible.
    """
    largest = float(np.nanmax(np.abs(error), initial=0.0))
    widest = float(np.nanmax(band[np.isfinite(band)], initial=0.0))
    half = max(largest, min(widest, BAND_MAX * largest) if largest else widest) * HEADROOM
    return (-half, half) if half else (-1.0, 1.0)


# --- quantities over time -------------------------------------------------------------------------

TIME = "time (s)"
POSITION = ("var_rho_x", "var_rho_y", "var_rho_z")


def covariance(compared: Comparison) -> Figure:
    """Draws the traces of the state's covariance, the whole map's (the course's figure 2) and
    the position's.
    """
    figure = new_figure(WIDTH_IN, 9.0)
    panels = figure.subplots(3, 1, sharex=True)
    state, position = panels[0], panels[-1]
    for run in _in_layers(compared):
        t = compared.seconds(run.frames.t_ns)
        _positive(state, t, run.frames["trace"], run)
        _positive(position, t, run.frames.stack(*POSITION).sum(axis=-1), run)
    _whole_map(panels[1], compared)
    state.set_ylabel("trace of P, state\n(mixed units)")
    position.set_ylabel("trace of position block\n(m²)")
    position.set_xlabel(TIME)
    for axes in (state, position):
        limit_decades(axes)
    legend_above(figure, state)
    return figure


def _whole_map(axes: Axes, compared: Comparison) -> None:
    found = compared.whole_map
    axes.plot(compared.seconds(found.t_ns), found.whole, **PENS[COURSE].line)
    axes.set_ylim(bottom=0)
    axes.set_ylabel("trace of P, whole map\n(course: m², rad²)")


def _in_layers(compared: Comparison) -> list[Run]:
    runs = {run.name: run for run in compared.runs}
    return [runs[name] for name in PENS if name in runs]


def _positive(axes: Axes, t: Floats, values: Floats, run: Run) -> None:
    """Draws a line with gaps where an invalid covariance has no logarithm."""
    axes.plot(t, np.where(values > 0, values, np.nan), **PENS[run.name].line)


# --- one picture for the README -------------------------------------------------------------------

HERO_IN = 12.0, 5.6
HERO_BOTTOM_IN = 1.15  # the legend stands below
LEFT_PANEL_IN = (0.8, HERO_BOTTOM_IN, 5.6, 4.1)  # left, bottom, width, height
RIGHT_IN, RIGHT_WIDTH_IN, RIGHT_HEIGHT_IN, GAP_IN = 7.4, 4.4, 1.26, 0.16


def hero(compared: Comparison) -> Figure:
    """Draws 1200 px for a README: top view on the left, position error with its band on the
    right.
    """
    figure = Figure(figsize=HERO_IN, dpi=DPI)
    left = panel(figure, *LEFT_PANEL_IN)
    fill(left, view(compared), LEFT_PANEL_IN[2] / LEFT_PANEL_IN[3])
    left.set_title("trajectories and landmarks", loc="left")
    figure.legend(*left.get_legend_handles_labels(), loc="lower center", ncols=8, columnspacing=1.2)
    _position_errors(figure, compared)
    return figure


def _position_errors(figure: Figure, compared: Comparison) -> None:
    accuracy = compared.accuracy[OWN]
    t = compared.seconds(accuracy.t_ns)
    error, band = accuracy.error[:, :3], SIGMAS * accuracy.sigma[:, :3]
    for k, name in enumerate("xyz"):
        bottom = HERO_BOTTOM_IN + (2 - k) * (RIGHT_HEIGHT_IN + GAP_IN)
        axes = panel(figure, RIGHT_IN, bottom, RIGHT_WIDTH_IN, RIGHT_HEIGHT_IN)
        _error_in_band(axes, t, error[:, k], band[:, k], OWN)
        axes.set_ylim(*limits(error, band))
        axes.set_ylabel(f"{RHO} {name} (m)")
        axes.tick_params(labelbottom=name == "z")
        if name == "x":
            axes.set_title(f"position error (black) in its 3 {SIGMA} band", loc="left")
    axes.set_xlabel("time (s)")
