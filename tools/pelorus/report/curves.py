# SPDX-License-Identifier: MIT
"""Quantities over time: covariance, NEES, biases, observations, time a frame."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import chi2

from pelorus.report.comparison import COURSE, Comparison
from pelorus.report.results import POSE_SIZE, Run
from pelorus.report.style import (
    BLUE,
    GREY,
    ORANGE,
    PALE,
    PENS,
    PURPLE,
    SIGMA,
    SKY,
    VERMILLION,
    WIDTH_IN,
    legend_above,
    limit_decades,
    new_figure,
)
from pelorus.se3 import Floats

TIME = "time (s)"
BAND = 0.95
POSITION = ("var_rho_x", "var_rho_y", "var_rho_z")
BIASES = ("bias_vx", "bias_vy", "bias_vz", "bias_wx", "bias_wy", "bias_wz")


def covariance(compared: Comparison) -> Figure:
    """Trace of the state's covariance, of the whole map's (the course's figure 2), and of the
    position block.
    """
    figure = new_figure(WIDTH_IN, 9.0)
    state, whole, position = figure.subplots(3, 1, sharex=True)
    for run in _in_layers(compared):
        t = compared.seconds(run.frames.t_ns)
        _positive(state, t, run.frames["trace"], run)
        _positive(position, t, run.frames.stack(*POSITION).sum(axis=-1), run)
    found = compared.whole_map
    whole.plot(compared.seconds(found.t_ns), found.whole, **PENS[COURSE].line)
    whole.set_ylim(bottom=0)
    state.set_ylabel("trace of P, state\n(mixed units)")
    whole.set_ylabel("trace of P, whole map\n(course: m², rad²)")
    position.set_ylabel("trace of position block\n(m²)")
    position.set_xlabel(TIME)
    for axes in (state, position):
        limit_decades(axes)
    legend_above(figure, state)
    return figure


def _in_layers(compared: Comparison) -> list[Run]:
    return [compared.run(name) for name in PENS]


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
    """The estimate with its 3-sigma band; what the truth is, no recording says."""
    frames = compared.main.frames
    t = compared.seconds(frames.t_ns)
    figure = new_figure(WIDTH_IN, 5.5)
    panels = figure.subplots(2, 3, sharex=True, sharey="row")
    for name, axes in zip(BIASES, panels.flat, strict=True):
        value, three_sigma = frames[name], 3 * np.sqrt(np.clip(frames[f"var_{name}"], 0, None))
        axes.fill_between(t, value - three_sigma, value + three_sigma, color=SKY, alpha=0.35,
                          linewidth=0, label=f"± 3 {SIGMA}")  # fmt: skip
        axes.plot(t, value, color=BLUE, label="estimate (body)")
        axes.axhline(0, color=GREY, linewidth=1)
        axes.set_title(f"$b_{{{name[-2]}{name[-1]}}}$")
    panels[0, 0].set_ylabel("velocity bias (m/s)")
    panels[1, 0].set_ylabel("gyro bias (rad/s)")
    for axes in panels[1]:
        axes.set_xlabel(TIME)
    legend_above(figure, panels[0, 0])
    return figure


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
        frames["new"],
        labels=("used", "gated", "new"),
        colors=(SKY, VERMILLION, ORANGE),
        step="mid",
    )
    fates.set_ylabel("observations a frame (body)")
    slots.plot(t, frames["active"], color=BLUE, label="active landmarks")
    slots.plot(t, frames["evicted"], color=PURPLE, linewidth=1, label="evicted in the frame")
    slots.set_ylabel("landmarks (body)")
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
