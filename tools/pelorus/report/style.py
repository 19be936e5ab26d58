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

from pelorus.errors import PelorusError
from pelorus.motion import Times
from pelorus.se3 import Floats

RHO = "\N{GREEK SMALL LETTER RHO}"
THETA = "\N{GREEK SMALL LETTER THETA}"
SIGMA = "\N{GREEK SMALL LETTER SIGMA}"

DPI = 100
WIDTH_IN = 10.0
PALETTE_COLOURS = 128  # of a stored picture: an eighth of the bytes, and no eye sees it

BLACK, GREY, BLUE, SKY = "#000000", "#808080", "#0072B2", "#56B4E9"
GREEN, ORANGE, VERMILLION, PURPLE = "#009E73", "#E69F00", "#D55E00", "#CC79A7"
PALE = "#D9E8F2"

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
    """How a run is drawn; the dashes tell the runs apart without any colour."""

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
    "body": Pen(BLUE, "-", "body", 7),
}
TRUTH = Pen(BLACK, (0, (2.5, 1.5)), "truth", 8)


def new_figure(width_in: float, height_in: float) -> Figure:
    """A figure that lays itself out, outside pyplot's global state."""
    return Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")


def legend_above(figure: Figure, axes: Axes, columns: int = 6) -> None:
    """One row over the panels, where it covers no data."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)


def seconds(t_ns: Times, origin_ns: int) -> Floats:
    """Time since the first frame."""
    return np.asarray((t_ns - origin_ns) * 1e-9)


def save(draw: Callable[[], Figure], path: Path) -> None:
    """Draw and write a PNG with few colours: a report is to be sent around."""
    from PIL import Image  # noqa: PLC0415 - comes with matplotlib, needed here alone

    try:
        with rc_context(LOOK):
            draw().savefig(path, format="png")
        with Image.open(path) as image:
            few = image.convert("RGB").quantize(PALETTE_COLOURS, dither=Image.Dither.NONE)
        few.save(path, optimize=True)
    except OSError as error:
        raise PelorusError(f"{path}: cannot be written: {error.strerror or error}") from error
