# SPDX-License-Identifier: MIT
"""One look for all pictures: colours that colour-blind readers can tell apart (Okabe and Ito)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pelorus.errors import writing

RHO = "\N{GREEK SMALL LETTER RHO}"
SIGMA = "\N{GREEK SMALL LETTER SIGMA}"

DPI = 100
WIDTH_IN = 10.0
FOOT_PERCENT = 2.0

BLACK, GREY, BLUE = "#000000", "#808080", "#0072B2"
GREEN, ORANGE, VERMILLION, PURPLE = "#009E73", "#E69F00", "#D55E00", "#CC79A7"

LOOK: Any = {
    "font.size": 12,
    "axes.titlesize": 12,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#E0E0E0",
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "path.simplify": True,
    "agg.path.chunksize": 10000,
}


class Pen(NamedTuple):
    """A run's line style; the dashes distinguish runs without any colour."""

    colour: str
    dashes: str | tuple[int, tuple[float, ...]]
    label: str
    layer: int

    @property
    def line(self) -> dict[str, Any]:
        return {
            "color": self.colour,
            "linestyle": self.dashes,
            "label": self.label,
            "zorder": self.layer,
        }


PENS = {
    "dead-reckoning": Pen(GREY, (0, (1, 1.2)), "dead reckoning", 3),
    "course": Pen(ORANGE, (0, (6, 2)), "course", 4),
    "world": Pen(VERMILLION, (0, (6, 1.5, 1, 1.5)), "world", 5),
    "yours": Pen(BLUE, "-", "your run", 7),
}
TRUTH = Pen(BLACK, (0, (2.5, 1.5)), "truth", 8)


def new_figure(width_in: float, height_in: float) -> Figure:
    """Returns a figure with automatic layout, outside pyplot's global state."""
    return Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")


def panel(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Returns axes at a place in inches, where a picture needs a known shape."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up))


def limit_decades(axes: Axes) -> None:
    """Limits a logarithmic scale, so that the few smallest values of a curve do not stretch it."""
    curves = [np.asarray(line.get_ydata(), float) for line in axes.get_lines()]
    feet = [np.percentile(y[y > 0], FOOT_PERCENT) for y in curves if (y > 0).any()]
    axes.set_yscale("log")
    if feet:
        axes.set_ylim(bottom=min(feet) / 2)


def legend_above(figure: Figure, axes: Axes, columns: int = 6, markers: float = 1.0) -> None:
    """Draws the legend in one row above the panels, where it covers no data."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns, markerscale=markers)


def save(draw: Callable[[], Figure], path: Path) -> None:
    """Draws and writes a PNG."""
    with writing(path), rc_context(LOOK):
        draw().savefig(path, format="png")
