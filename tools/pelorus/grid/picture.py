# SPDX-License-Identifier: MIT
"""Draws the occupancy grid as a reader of the files sees it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from pelorus.grid import files
from pelorus.grid.occupancy import Grid
from pelorus.program.style import BLACK, BLUE, DPI, PURPLE, panel

UNKNOWN, FREE = "#C4C9CE", "#FFFFFF"
WIDTH_IN, LEFT_IN, RIGHT_IN, BOTTOM_IN, TOP_IN = 12.0, 0.8, 0.2, 0.65, 0.85
HEIGHT_IN = (3.0, 10.0)
LEGEND_IN = 9.6
DOT = 1.6  # points: least size of an occupied cell, so that it stays visible


def draw(grid: Grid, title: str) -> Figure:
    """Draws free cells white, occupied ones black, unknown ones grey; the body's path in blue."""
    found = files.cells(grid)
    height, width = found.shape
    across = WIDTH_IN - LEFT_IN - RIGHT_IN
    up = float(np.clip(across * height / width, *HEIGHT_IN))
    across = min(across, up * width / height)
    whole = max(LEFT_IN + across + RIGHT_IN, LEGEND_IN)
    figure = Figure(figsize=(whole, BOTTOM_IN + up + TOP_IN), dpi=DPI)
    axes = panel(figure, LEFT_IN, BOTTOM_IN, across, up)
    fill(axes, grid)
    axes.set_title(title, loc="left", pad=24)
    handles, labels = axes.get_legend_handles_labels()
    patches = [
        Patch(facecolor=colour, edgecolor="#808080", label=label)
        for colour, label in ((FREE, "free"), (BLACK, "occupied"), (UNKNOWN, "not known"))
    ]
    axes.legend(
        handles=[*patches, *handles],
        labels=[*(patch.get_label() for patch in patches), *labels],
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=6,
        borderaxespad=0.1,
        columnspacing=1.2,
    )
    return figure


def fill(axes: Axes, grid: Grid) -> None:
    """Draws the cells and the path."""
    found = files.cells(grid)
    shade = np.select([found == files.FREE, found == files.OCCUPIED], [0, 2], 1)
    x, y = grid.origin_m
    height, width = found.shape
    axes.imshow(
        shade,
        cmap=ListedColormap([FREE, UNKNOWN, BLACK]),
        vmin=0,
        vmax=2,
        origin="lower",
        extent=(x, x + width * grid.resolution_m, y, y + height * grid.resolution_m),
        interpolation="nearest",
        zorder=0,
    )
    row, column = np.nonzero(found == files.OCCUPIED)
    middle = grid.resolution_m * (np.stack((column, row)) + 0.5) + np.array([[x], [y]])
    axes.plot(*middle, "s", color=BLACK, markersize=DOT, markeredgewidth=0)
    axes.plot(*grid.path_m.T, color=BLUE, linewidth=1, label="way of the body")
    axes.plot(*grid.path_m[0], "o", color=PURPLE, markeredgecolor=BLACK, label="start")
    axes.plot(*grid.path_m[-1], "s", color=PURPLE, markeredgecolor=BLACK, label="end")
    axes.grid(False)
    axes.set_xlabel(grid.plane.right.label)
    axes.set_ylabel(grid.plane.up.label)
