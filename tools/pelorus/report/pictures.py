# SPDX-License-Identifier: MIT
"""The pictures of a report: which there are, what stands under them, and how each is drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import chi2

from pelorus.frame_table import BIASES
from pelorus.frames import Message, Truth, TruthKnows
from pelorus.grid import picture
from pelorus.grid.files import heights
from pelorus.layout import Floats
from pelorus.motion import Times
from pelorus.report import top_view
from pelorus.report.comparison import COURSE, Comparison
from pelorus.report.results import OWN, Run
from pelorus.style import (
    BLACK,
    BLUE,
    DPI,
    GREY,
    ORANGE,
    PALE,
    PENS,
    PURPLE,
    RHO,
    SIGMA,
    SKY,
    THETA,
    VERMILLION,
    WIDTH_IN,
    legend_above,
    limit_decades,
    new_figure,
    panel,
)
from pelorus.trajectory import POSE_SIZE

JUDGED = (OWN, "world", COURSE)  # dead reckoning has no error worth a picture
CURVE_MIN = 2  # frames: one point is no curve
NAMES = (
    *("top-view", "error-yours", "error-world", "error-course", "nees", "covariance", "bias"),
    *("observations", "time", "map", "hero"),
)


class Picture(NamedTuple):
    """A file `name`.png; without a caption it does not stand on the page."""

    name: str
    title: str
    caption: str
    draw: Callable[[], Figure]


def pictures(compared: Comparison) -> list[Picture]:
    """In the page's order; what needs a truth or a bias is left out without one, and a curve
    needs two frames.
    """
    out = [_top_view(compared), *_map(compared)]
    if len(compared.main.frames.t_ns) < CURVE_MIN:
        return out

    def add(name: str, title: str, caption: str, draw: Callable[[Comparison], Figure]) -> None:
        out.append(Picture(name, title, caption, partial(draw, compared)))

    truths = [len(accuracy.t_ns) for accuracy in compared.accuracy.values()]
    judged = min(truths, default=0) >= CURVE_MIN
    if judged:
        for run in (run for run in compared.runs if run.name in JUDGED):
            if not run.poses_given:
                draw = partial(errors, name=run.name)
                add(f"error-{run.name}", f"Error of {PENS[run.name].label}", ERRORS, draw)
        add("nees", "Consistency", NEES, nees)
    words = COVARIANCE
    if compared.has_course:
        words = f"{COVARIANCE} {WHOLE_MAP.format(ids=compared.whole_map.ids)}"
    add("covariance", "Trace of the covariance", words, covariance)
    if compared.main.summary["bias"] == "on":
        whose = "IMU" if compared.main.frames.by_imu else "twist"
        add("bias", "Biases", f"The biases of the {whose} as your run estimates them.", biases)
    add("observations", "Observations", OBSERVATIONS, observations)
    add("time", "Time a frame", TIMES, times)
    if judged and not compared.main.poses_given:
        add("hero", "", "", hero)
    return out


ERRORS = (
    f"e = ({RHO}, {THETA}) = Log(T⁻¹ A T_true) in body axes, A bringing the truth to the "
    "estimate's start, within three standard deviations of the filter's own covariance. An honest "
    "filter stays inside."
)
NEES = (
    "Normalised estimation error squared, a degree of freedom: 1 on average for an honest filter, "
    "above it for one that believes more than it knows. The band holds 95 % of a consistent "
    "filter's frames."
)
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
OBSERVATIONS = (
    "What became of a frame's observations: used in the update, rejected by the gate, or the "
    "first of a new landmark; below, the landmarks that the state holds."
)
TIMES = "Predict, gate, update, retract, on this machine and with all that runs beside it."


def _top_view(compared: Comparison) -> Picture:
    seen = top_view.view(compared)
    words = f"Seen {seen.plane.why}." if seen.plane.why.startswith("from") else (
        f"Seen in {seen.plane.why}, for the recording does not say which way is up."
    )  # fmt: skip
    if seen.uncertain:
        words += f" {seen.uncertain} landmarks of your run are too uncertain to be drawn."
    if seen.truth is not None:
        words += " The truth is brought to the estimate's start."
    return Picture("top-view", "Trajectories", words, partial(top_view.draw, compared))


def _map(compared: Comparison) -> list[Picture]:
    grid = compared.grid
    if grid is None:
        return []
    words = (
        f"Cells of {grid.resolution_m:g} m, {heights(grid.band)}, from the rays between the camera "
        "and the landmarks of your run, weighted by the landmarks' covariance. `pelorus map` draws "
        "it with other settings, and writes it for nav2's map_server."
    )
    title = f"{compared.subject.title}: {grid.plane.why}"
    return [Picture("map", "Free and occupied", words, partial(picture.draw, grid, title))]


# --- errors and the band that the covariance promises ---------------------------------------------

TITLES = tuple(f"{letter} {axis}" for letter in (RHO, THETA) for axis in "xyz")
SIGMAS = 3.0
HEADROOM = 1.1
BAND_MAX = 6.0  # times the largest error: a band wider than that would flatten the error


def errors(compared: Comparison, name: str) -> Figure:
    """A run's errors inside, or outside, the band that its covariance promises. Six panels:
    position above, rotation below.
    """
    accuracy = compared.accuracy[name]
    t = compared.seconds(accuracy.t_ns)
    figure = new_figure(WIDTH_IN, 5.8)
    panels = figure.subplots(2, 3, sharex=True, sharey="row")
    unit = np.repeat((1.0, 180 / np.pi), 3)
    error, band = accuracy.error * unit, SIGMAS * accuracy.sigma * unit
    for k, axes in enumerate(panels.flat):
        _error_in_band(axes, t, error[:, k], band[:, k], name)
        axes.set_title(TITLES[k])
    panels[0, 0].set_ylim(*limits(error[:, :3], band[:, :3]))
    panels[1, 0].set_ylim(*limits(error[:, 3:], band[:, 3:]))
    panels[0, 0].set_ylabel("position error (m)")
    panels[1, 0].set_ylabel("rotation error (deg)")
    for axes in panels[1]:
        axes.set_xlabel("time (s)")
    legend_above(figure, panels[0, 0])
    return figure


def _error_in_band(axes: Axes, t: Floats, error: Floats, band: Floats, name: str) -> None:
    """One error with its band."""
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
    """Symmetric; holds every error, and the band as far as it leaves the error legible."""
    largest = float(np.nanmax(np.abs(error), initial=0.0))
    widest = float(np.nanmax(band[np.isfinite(band)], initial=0.0))
    half = max(largest, min(widest, BAND_MAX * largest) if largest else widest) * HEADROOM
    return (-half, half) if half else (-1.0, 1.0)


# --- quantities over time -------------------------------------------------------------------------

TIME = "time (s)"
BAND = 0.95
POSITION = ("var_rho_x", "var_rho_y", "var_rho_z")


def covariance(compared: Comparison) -> Figure:
    """Trace of the state's covariance, of the whole map's (the course's figure 2), and of the
    position block.
    """
    rows = 3 if compared.has_course else 2
    figure = new_figure(WIDTH_IN, 3.0 * rows)
    panels = figure.subplots(rows, 1, sharex=True)
    state, position = panels[0], panels[-1]
    for run in _in_layers(compared):
        t = compared.seconds(run.frames.t_ns)
        _positive(state, t, run.frames["trace"], run)
        _positive(position, t, run.frames.stack(*POSITION).sum(axis=-1), run)
    if compared.has_course:
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
    """A logarithm shows no value of a broken covariance: the line has a gap there."""
    axes.plot(t, np.where(values > 0, values, np.nan), **PENS[run.name].line)


def nees(compared: Comparison) -> Figure:
    """NEES a degree of freedom, with the band that holds 95 % of a consistent filter's frames."""
    figure = new_figure(WIDTH_IN, 4.5)
    axes = figure.subplots()
    low, high = chi2.interval(BAND, POSE_SIZE)
    axes.axhspan(
        low / POSE_SIZE, high / POSE_SIZE, color=PALE, label=f"{BAND:.0%} band, χ² (6)", zorder=1
    )
    for run in (run for run in _in_layers(compared) if not run.poses_given):
        accuracy = compared.accuracy[run.name]
        _positive(axes, compared.seconds(accuracy.t_ns), accuracy.nees, run)
    axes.axhline(1.0, color=GREY, linewidth=1, zorder=2)
    limit_decades(axes)
    axes.set_xlabel(TIME)
    axes.set_ylabel("NEES / 6")
    legend_above(figure, axes)
    return figure


def biases(compared: Comparison) -> Figure:
    """The estimate with its 3-sigma band, and the truth where TRUTH tells it."""
    frames = compared.main.frames
    true_t_ns, true = true_biases(compared.main.messages)
    letters = {"v": "a", "w": "g"} if frames.by_imu else {"v": "v", "w": "w"}
    t = compared.seconds(frames.t_ns)
    figure = new_figure(WIDTH_IN, 5.5)
    panels = figure.subplots(2, 3, sharex=True, sharey="row")
    for k, (name, axes) in enumerate(zip(BIASES, panels.flat, strict=True)):
        value, three_sigma = frames[name], 3 * np.sqrt(np.clip(frames[f"var_{name}"], 0, None))
        axes.fill_between(t, value - three_sigma, value + three_sigma, color=SKY, alpha=0.35,
                          linewidth=0, label=f"± 3 {SIGMA}")  # fmt: skip
        axes.plot(t, value, color=BLUE, label="estimate")
        axes.axhline(0, color=GREY, linewidth=1)
        if len(true):
            axes.plot(compared.seconds(true_t_ns), true[:, k], color=BLACK, label="truth")
        axes.set_title(f"$b_{{{letters[name[-2]]}{name[-1]}}}$")
    of_v = "accelerometer bias (m/s²)" if frames.by_imu else "velocity bias (m/s)"
    panels[0, 0].set_ylabel(of_v)
    panels[1, 0].set_ylabel("gyro bias (rad/s)")
    for axes in panels[1]:
        axes.set_xlabel(TIME)
    legend_above(figure, panels[0, 0])
    return figure


def true_biases(messages: Sequence[Message]) -> tuple[Times, Floats]:
    """Times (n,) and (n, 6), of the TRUTH that tells them."""
    known = [m for m in messages if isinstance(m, Truth) and m.knows & TruthKnows.BIAS]
    t_ns = np.array([m.t_ns for m in known], np.int64)
    return t_ns, np.array([m.bias for m in known]).reshape(-1, 6)


def observations(compared: Comparison) -> Figure:
    """What became of a frame's observations, and how full the state is."""
    frames = compared.main.frames
    t = compared.seconds(frames.t_ns)
    figure = new_figure(WIDTH_IN, 6.5)
    fates, slots = figure.subplots(2, 1, sharex=True)
    fates.stackplot(
        t,
        frames["used"],
        frames["gated"],
        frames["created"],
        labels=("used", "gated", "new"),
        colors=(SKY, VERMILLION, ORANGE),
        step="mid",
    )
    fates.set_ylabel("observations (a frame)")
    slots.plot(t, frames["active"], color=BLUE, label="active landmarks")
    slots.plot(t, frames["evicted"], color=PURPLE, linewidth=1, label="evicted in the frame")
    slots.set_ylabel("landmarks (held)")
    slots.set_xlabel(TIME)
    for axes in (fates, slots):
        axes.set_ylim(bottom=0)
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, borderaxespad=0.2)
    return figure


def times(compared: Comparison) -> Figure:
    """Computing time of each frame, a dot a frame."""
    figure = new_figure(WIDTH_IN, 4.5)
    axes = figure.subplots()
    for run in _in_layers(compared):
        pen = PENS[run.name]
        milliseconds = run.frames["update_us"] * 1e-3
        label = f"{pen.label}: median {np.median(milliseconds):.2g} ms"
        t = compared.seconds(run.frames.t_ns)
        axes.plot(t, milliseconds, ".", markersize=3, color=pen.colour, label=label,
                  zorder=pen.layer)  # fmt: skip
    axes.set_yscale("log")
    axes.set_xlabel(TIME)
    axes.set_ylabel("time a frame (ms)")
    legend_above(figure, axes, columns=2, markers=4)
    return figure


# --- one picture that says it all -----------------------------------------------------------------

HERO_IN = 12.0, 5.6
BOTTOM_IN = 1.15  # the legend stands below
LEFT_PANEL_IN = (0.8, BOTTOM_IN, 5.6, 4.1)  # left, bottom, width, height
RIGHT_IN, RIGHT_WIDTH_IN, RIGHT_HEIGHT_IN, GAP_IN = 7.4, 4.4, 1.26, 0.16


def hero(compared: Comparison) -> Figure:
    """1200 px wide, readable at the width of a README: top view on the left, the position error
    with its band on the right.
    """
    figure = Figure(figsize=HERO_IN, dpi=DPI)
    left = panel(figure, *LEFT_PANEL_IN)
    top_view.fill(left, top_view.view(compared), LEFT_PANEL_IN[2] / LEFT_PANEL_IN[3])
    left.set_title("trajectories and landmarks", loc="left")
    figure.legend(*left.get_legend_handles_labels(), loc="lower center", ncols=8, columnspacing=1.2)
    _position_errors(figure, compared)
    return figure


def _position_errors(figure: Figure, compared: Comparison) -> None:
    accuracy = compared.accuracy[OWN]
    t = compared.seconds(accuracy.t_ns)
    error, band = accuracy.error[:, :3], SIGMAS * accuracy.sigma[:, :3]
    for k, name in enumerate("xyz"):
        bottom = BOTTOM_IN + (2 - k) * (RIGHT_HEIGHT_IN + GAP_IN)
        axes = panel(figure, RIGHT_IN, bottom, RIGHT_WIDTH_IN, RIGHT_HEIGHT_IN)
        _error_in_band(axes, t, error[:, k], band[:, k], OWN)
        axes.set_ylim(*limits(error, band))
        axes.set_ylabel(f"{RHO} {name} (m)")
        axes.tick_params(labelbottom=name == "z")
        if name == "x":
            axes.set_title(f"position error (black) in its 3 {SIGMA} band", loc="left")
    axes.set_xlabel("time (s)")
