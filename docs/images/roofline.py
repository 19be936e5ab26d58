#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Draws docs/images/roofline.png from what `pelorus-bench --floor` printed (docs/BENCHMARKS.md).

usage: roofline.py [FILE.png]
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

PAGE = Path(__file__).resolve().parents[1] / "BENCHMARKS.md"
INK, SOFT = "#22303c", "#6b7a87"
# A batch of 24 rows reads and writes each element of P, eight bytes, for 24 multiply-adds.
MULTIPLY_ADDS_A_BYTE = 24 / 8
COLUMNS = 9


def table() -> tuple[float, list[list[float]]]:
    """Returns the peak in multiply-adds a nanosecond, and the table's rows as numbers."""
    text = PAGE.read_text()
    peak = re.search(r"Peak of this build's vectors: ([\d.]+) billion", text)
    if not peak:
        raise ValueError(f"{PAGE}: the line that begins with the peak is missing")
    lines = text[peak.end() :].splitlines()
    rows = [
        [float(x.strip(" *M")) for x in line.split("|")[1:-1]]
        for line in lines
        if re.match(r"\| \d", line)
    ]
    return float(peak[1]), [row for row in rows if len(row) == COLUMNS]


def main() -> None:
    """Draws the picture."""
    peak, rows = table()
    n = [row[0] for row in rows]
    work = [1e3 * row[1] for row in rows]  # thousands, so that rates by us are billions a second
    fig, ax = plt.subplots(figsize=(8, 4.2), dpi=110)
    ax.axhline(peak, color=INK, lw=1.5)
    ax.annotate(
        f"peak of the vectors, {peak:.0f}",
        (n[0], peak),
        (0, 5),
        textcoords="offset points",
        color=INK,
    )
    roof = [MULTIPLY_ADDS_A_BYTE * row[2] for row in rows]
    ax.plot(n, roof, color=SOFT, ls="--", marker="s", ms=4)
    ax.annotate(
        "what reading and writing P allows",
        (n[-1], roof[-1]),
        (-8, 7),
        textcoords="offset points",
        color=SOFT,
        ha="right",
    )
    for column, label, colour in (
        (4, "the downdate alone", "#2b7a5b"),
        (5, "frame by twists", "#2c5f9e"),
        (7, "frame by an IMU", "#b0553a"),
    ):
        rate = [w / row[column] for w, row in zip(work, rows, strict=True)]
        ax.plot(n, rate, color=colour, marker="o", ms=5, label=label)
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="N, landmarks, all of them seen",
        ylabel="the downdate's multiply-adds, billions a second",
    )
    ax.set_xticks(n, [f"{x:.0f}" for x in n])
    ax.set_xticks([], minor=True)
    ax.set_yticks(
        [2, 5, 10, 20, 50, 100, 200, 500], ["2", "5", "10", "20", "50", "100", "200", "500"]
    )
    ax.set_yticks([], minor=True)
    ax.grid(visible=True, color="#e4e8ec")
    ax.legend(loc="lower right", frameon=False)
    fig.tight_layout()
    fig.savefig(
        Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("roofline.png")
    )


if __name__ == "__main__":
    main()
