# SPDX-License-Identifier: MIT
"""One picture that says it all: 1200 px wide, readable at the width of a README."""

from __future__ import annotations

from matplotlib.figure import Figure

from pelorus.report import bands, top_view
from pelorus.report.comparison import MAIN, Comparison
from pelorus.report.style import DPI, RHO, SIGMA, panel

WIDTH_IN, HEIGHT_IN = 12.0, 5.6
BOTTOM_IN = 1.15  # the legend stands below
LEFT_PANEL_IN = (0.8, BOTTOM_IN, 5.6, 4.1)  # left, bottom, width, height
RIGHT_IN, RIGHT_WIDTH_IN, RIGHT_HEIGHT_IN, GAP_IN = 7.4, 4.4, 1.26, 0.16
AXES = "xyz"


def draw(compared: Comparison) -> Figure:
    """Top view on the left, the position error with its band on the right."""
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI)
    left = panel(figure, *LEFT_PANEL_IN)
    top_view.fill(left, top_view.view(compared), LEFT_PANEL_IN[2] / LEFT_PANEL_IN[3])
    left.set_title("trajectories and landmarks", loc="left")
    figure.legend(*left.get_legend_handles_labels(), loc="lower center", ncols=8, columnspacing=1.2)
    _errors(figure, compared)
    return figure


def _errors(figure: Figure, compared: Comparison) -> None:
    accuracy = compared.accuracy[MAIN]
    t = compared.seconds(accuracy.t_ns)
    error, band = accuracy.error[:, :3], bands.SIGMAS * accuracy.sigma[:, :3]
    for k, name in enumerate(AXES):
        bottom = BOTTOM_IN + (2 - k) * (RIGHT_HEIGHT_IN + GAP_IN)
        axes = panel(figure, RIGHT_IN, bottom, RIGHT_WIDTH_IN, RIGHT_HEIGHT_IN)
        bands.component(axes, t, error[:, k], band[:, k], MAIN)
        axes.set_ylim(*bands.limits(error, band))
        axes.set_ylabel(f"{RHO} {name} (m)")
        axes.tick_params(labelbottom=name == AXES[-1])
        if name == AXES[0]:
            axes.set_title(f"position error of body (black) in its 3 {SIGMA} band", loc="left")
    axes.set_xlabel("time (s)")
