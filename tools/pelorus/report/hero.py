# SPDX-License-Identifier: MIT
"""One picture that says it all: 1200 px wide, readable at the width of a README."""

from __future__ import annotations

from matplotlib.figure import Figure

from pelorus.report import bands, top_view
from pelorus.report.comparison import MAIN, Comparison
from pelorus.report.style import RHO, SIGMA, new_figure

WIDTH_IN, HEIGHT_IN = 12.0, 5.6
AXES = "xyz"


def draw(compared: Comparison) -> Figure:
    """Top view on the left, the position error with its band on the right."""
    figure = new_figure(WIDTH_IN, HEIGHT_IN)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.15, 1))
    seen = top_view.view(compared)
    left = figure.add_subplot(grid[:, 0])
    top_view.fill(left, seen)
    handles = left.get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=8, columnspacing=1.2, fontsize=11.5)
    accuracy = compared.accuracy[MAIN]
    t = compared.seconds(accuracy.t_ns)
    band = bands.SIGMAS * accuracy.sigma
    top = figure.add_subplot(grid[0, 1])
    panels = [top, *(figure.add_subplot(grid[k, 1], sharex=top) for k in (1, 2))]
    for k, axes in enumerate(panels):
        bands.component(axes, t, accuracy.error[:, k], band[:, k], MAIN)
        axes.set_ylim(*bands.limits(accuracy.error[:, :3], band[:, :3]))
        axes.set_ylabel(f"{RHO} {AXES[k]} (m)")
        axes.tick_params(labelbottom=k == 2)
    top.set_title(f"position error of body (black) in its 3 {SIGMA} band", loc="left")
    panels[-1].set_xlabel("time (s)")
    return figure
