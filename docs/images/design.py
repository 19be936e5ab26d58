#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Draws docs/images/design.png, the picture of docs/DESIGN.md.

usage: design.py [FILE.png]
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch, Rectangle
from PIL import Image

INK, SOFT = "#22303c", "#6b7a87"
INPUT, PROCESS, FRAME, STATE, OUTPUT = "#f3e3c3", "#d5e6d3", "#d3e0f0", "#ecdcec", "#f2d8d2"
FRAME_STEPS = (
    ("match observations and slots by id", "matching.c"),
    ("find the motion from all of them", "motion_first.c, search.c"),
    ("gate each by the motion of the others", "motion_first.c"),
    ("apply the motion; its noise stays in W", "predict.c, model_body.c"),
    ("correct x, W and P, batch by batch", "correction.c"),
    ("add W to P; retract; transport P", "covariance_motion.c, model_body.c"),
    ("evict, initialise", "births.c"),
    ("evidence to the supervisor; decisions, health", "evidence.c, src/supervise"),
)


def box(axes: Axes, x: float, y: float, width: float, height: float, colour: str) -> None:
    """A rounded box with its lower left corner at (x, y)."""
    axes.add_patch(
        FancyBboxPatch(
            (x, y), width, height, boxstyle="round,pad=0,rounding_size=0.09",
            facecolor=colour, edgecolor=INK, linewidth=0.9,
        )
    )  # fmt: skip


def say(axes: Axes, x: float, y: float, text: str, small: str = "", size: float = 9) -> None:
    """A line in the middle of a box, and a smaller one below it."""
    up = 0.11 * (1 + small.count("\n")) if small else 0
    axes.text(x, y + up, text, ha="center", va="center", fontsize=size, color=INK)
    if small:
        axes.text(x, y - 0.13, small, ha="center", va="center", fontsize=7, color=SOFT)


def arrow(axes: Axes, *points: tuple[float, float], style: str = "-") -> None:
    """A line through the points with a head at its end."""
    for begin, end in pairwise(points[:-1]):
        axes.plot(
            *zip(begin, end, strict=True), color=INK, linewidth=1, linestyle=style, zorder=0.5
        )
    axes.annotate(
        "", points[-1], points[-2], zorder=0.5,
        arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1, "linestyle": style,
                    "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip


def title(axes: Axes, x: float, text: str, below: str) -> None:
    """A column's heading."""
    axes.text(x, 7.02, text, ha="center", fontsize=11, weight="bold", color=INK)
    axes.text(x, 6.77, below, ha="center", fontsize=7.5, color=SOFT)


def draw_inputs(axes: Axes) -> None:
    """What comes in, and what the process makes of it."""
    title(axes, 1.15, "what comes in", "any order, any rate")
    for y, text, small in (
        (5.75, "twist (v, w), or IMU (a, w)", "50 to 400 Hz; one of the two"),
        (4.65, "wheel, standstill", "with twists: weighed against them"),
        (2.15, "position", "corrects the state; IMU: wheels, too"),
        (0.55, "stereo frame", "ids and pixels, 10 Hz"),
    ):
        box(axes, 0.1, y, 2.1, 0.7, INPUT)
        say(axes, 1.15, y + 0.35, text, small)
    title(axes, 4.05, "between frames", "costs the same for any N")
    box(axes, 2.95, 4.65, 2.2, 1.8, PROCESS)
    say(axes, 4.05, 6.15, "a step of the motion", "process/twist.c, velocity.c, or imu.c")
    axes.text(
        4.05, 5.33, "pose (and velocity) move at once;\nD = D D$_k$,  Q,  B accumulate;\n"
        "wheels measure\nthe biases, too", ha="center", va="center", fontsize=8, color=INK,
        linespacing=1.35,
    )  # fmt: skip
    box(axes, 2.95, 2.75, 2.2, 1.05, PROCESS)
    say(axes, 4.05, 3.42, "motion since landmarks")
    axes.text(4.05, 3.2, "and P were last moved", ha="center", va="center", fontsize=9, color=INK)
    axes.text(4.05, 2.94, "D, Q, B in f->motion", ha="center", va="center", fontsize=7, color=SOFT)
    arrow(axes, (2.2, 6.1), (2.95, 6.1))
    arrow(axes, (2.2, 5.0), (2.95, 5.0))
    arrow(axes, (4.05, 4.65), (4.05, 3.8))
    arrow(axes, (5.15, 3.27), (5.65, 3.27), (5.65, 5.42), (5.95, 5.42))


def draw_frame(axes: Axes) -> None:
    """A frame from top to bottom."""
    title(axes, 7.45, "a frame", "in the order of filter/update.c")
    for i, (text, small) in enumerate(FRAME_STEPS):
        y = 5.9 - 0.78 * i
        box(axes, 5.95, y, 3.0, 0.6, FRAME)
        say(axes, 7.45, y + 0.3, text, small, 8.5)
        if i:
            arrow(axes, (7.45, y + 0.78), (7.45, y + 0.6))
    arrow(axes, (2.2, 0.9), (5.42, 0.9), (5.42, 6.2), (5.95, 6.2))
    arrow(axes, (2.2, 2.5), (5.18, 2.5), (5.18, 3.08), (5.95, 3.08), style="--")


def draw_state(axes: Axes) -> None:
    """The state, and P as a triangle of blocks with W beside it."""
    title(axes, 10.75, "the state", "one struct, static")
    left, top, unit = 9.72, 6.3, 0.34
    names = ("pose", "v, b", "1", "2", "...", "N")
    rows = len(names)
    for i in range(rows):
        for j in range(i + 1):
            axes.add_patch(
                Rectangle(
                    (left + unit * j, top - unit * (i + 1)), unit, unit,
                    facecolor="#c9a9c9" if i == j else STATE, edgecolor="white",
                    linewidth=0.8,
                )
            )  # fmt: skip
        y = top - unit * (i + 0.5)
        axes.text(left - 0.07, y, names[i], ha="right", va="center", fontsize=7.5, color=INK)
        axes.add_patch(
            Rectangle((left + unit * rows + 0.28, y - unit / 2), 0.28, unit, facecolor="#bcd3bb",
                      edgecolor="white", linewidth=0.8)
        )  # fmt: skip
    axes.text(left + 0.75 * unit * rows, top - 0.22 * unit * rows, "P", fontsize=15, color=INK)
    axes.text(left + unit * rows + 0.42, top + 0.1, "W", fontsize=12, ha="center", color=INK)
    axes.text(
        10.9, 3.92, "P: errors of pose, velocity (with an IMU),\nbiases and landmarks. "
        "W: the motion's\nnoise on each, only within a frame", ha="center", va="center",
        fontsize=7.5, color=INK, linespacing=1.35,
    )  # fmt: skip
    arrow(axes, (8.95, 2.3), (9.3, 2.3), (9.3, 3.15), (9.55, 3.15))
    box(axes, 9.55, 2.75, 2.7, 0.75, STATE)
    say(
        axes,
        10.9,
        3.125,
        "T$_{WB}$, v, biases, N landmarks",
        "in the camera: bearing, 1 / range",
        8.5,
    )


def draw_outputs(axes: Axes) -> None:
    """The way out."""
    title_y = 2.3
    axes.text(10.9, title_y, "what goes out", ha="center", fontsize=11, weight="bold", color=INK)
    for y, text, small in (
        (1.5, "pose, velocity, biases", "with covariance; asking changes nothing"),
        (0.8, "report and health", "of every frame, with reasons"),
        (0.1, "landmarks", "to the caller's map, when evicted"),
    ):
        box(axes, 9.55, y, 2.7, 0.6, OUTPUT)
        say(axes, 10.9, y + 0.3, text, small, 8.5)
    arrow(axes, (8.95, 0.74), (9.25, 0.74), (9.25, 1.1), (9.55, 1.1))
    arrow(axes, (8.95, 0.6), (9.25, 0.6), (9.25, 0.4), (9.55, 0.4))


def main() -> int:
    """Draws; the exit status."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("design.png")
    figure, axes = plt.subplots(figsize=(12.4, 7.3))
    axes.set_xlim(0, 12.4)
    axes.set_ylim(0, 7.3)
    axes.axis("off")
    for part in (draw_inputs, draw_frame, draw_state, draw_outputs):
        part(axes)
    figure.subplots_adjust(0, 0, 1, 1)
    figure.savefig(out, dpi=110, metadata={"Software": None})
    with Image.open(out) as picture:  # few colours: a third of the size
        small = picture.convert("RGB").quantize(64)
    small.save(out, optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
