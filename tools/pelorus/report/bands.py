# SPDX-License-Identifier: MIT
"""A run's errors inside, or outside, the band that its covariance promises."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pelorus.report.comparison import Comparison
from pelorus.report.style import (
    BLACK,
    GREY,
    PENS,
    RHO,
    SIGMA,
    THETA,
    WIDTH_IN,
    legend_above,
    new_figure,
)
from pelorus.se3 import Floats

TITLES = tuple(f"{letter} {axis}" for letter in (RHO, THETA) for axis in "xyz")
SIGMAS = 3.0
HEADROOM = 1.1
BAND_MAX = 6.0  # times the largest error: a band wider than that would flatten the error


def draw(compared: Comparison, name: str) -> Figure:
    """Six panels: position above, rotation below."""
    accuracy = compared.accuracy[name]
    t = compared.seconds(accuracy.t_ns)
    figure = new_figure(WIDTH_IN, 5.8)
    panels = figure.subplots(2, 3, sharex=True, sharey="row")
    unit = np.repeat((1.0, 180 / np.pi), 3)
    error, band = accuracy.error * unit, SIGMAS * accuracy.sigma * unit
    for k, axes in enumerate(panels.flat):
        component(axes, t, error[:, k], band[:, k], name)
        axes.set_title(TITLES[k])
    panels[0, 0].set_ylim(*limits(error[:, :3], band[:, :3]))
    panels[1, 0].set_ylim(*limits(error[:, 3:], band[:, 3:]))
    panels[0, 0].set_ylabel("position error (m)")
    panels[1, 0].set_ylabel("rotation error (deg)")
    for axes in panels[1]:
        axes.set_xlabel("time (s)")
    legend_above(figure, panels[0, 0])
    return figure


def component(axes: Axes, t: Floats, error: Floats, band: Floats, name: str) -> None:
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
