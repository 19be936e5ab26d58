# SPDX-License-Identifier: MIT
"""Drawings without a time axis, as SVG: they need no script and no other package."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from pelorus.wire.layout import Floats

WIDTH, HEIGHT, LEFT, BOTTOM, TOP, RIGHT = 560, 240, 58, 34, 10, 10
TICKS = 5
DECADES_MOST = 8  # below the largest value; smaller ones are drawn as nothing


class PlotAxis:
    """Maps values to pixels along one side."""

    def __init__(self, low: float, high: float, span: tuple[float, float], log: bool) -> None:
        self._log = log
        if not high > low:
            low, high = low - 1.0, high + 1.0
        self._low = float(np.log10(low)) if log else low
        self._high = float(np.log10(high)) if log else high
        self._from, self._to = span

    def at(self, value: Floats | float) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.log10(value) if self._log else value
        share = (np.asarray(value) - self._low) / (self._high - self._low)
        return np.asarray(self._from + share * (self._to - self._from))

    def ticks(self) -> list[float]:
        if self._log:
            first, last = int(np.ceil(self._low - 1e-9)), int(np.floor(self._high + 1e-9))
            every = max((last - first) // TICKS, 1)
            return [float(10.0**k) for k in range(first, last + 1, every)]
        step = 10.0 ** np.floor(np.log10((self._high - self._low) / 2))
        while (self._high - self._low) / step > TICKS:
            step *= 2 if (self._high - self._low) / step <= 2 * TICKS else 5
        return [
            float(x) for x in np.arange(np.ceil(self._low / step), self._high / step + 1e-9) * step
        ]


def plot(
    x: Floats,
    lines: Sequence[tuple[str, Floats]],
    units: tuple[str, str],
    log: tuple[bool, bool] = (False, False),
) -> str:
    """Draws lines over x; `units` name the axes."""
    values = np.concatenate([y[np.isfinite(y)] for _, y in lines])
    values = values[values > 0] if log[1] else values
    if not len(values) or not len(x):
        return ""
    high = float(values.max())
    low = max(float(values.min()), high * 10.0**-DECADES_MOST) if log[1] else min(0.0, values.min())
    across = PlotAxis(float(x[0]), float(x[-1]), (LEFT, WIDTH - RIGHT), log[0])
    up = PlotAxis(low, high * (1 if log[1] else 1.05), (HEIGHT - BOTTOM, TOP), log[1])
    out = [_grid(across, up, units)]
    for k, (name, y) in enumerate(lines):
        with np.errstate(invalid="ignore"):
            shown = np.isfinite(y) & ((y >= low) | (not log[1]))
        points = " ".join(
            f"{a:.1f},{b:.1f}" for a, b in zip(across.at(x[shown]), up.at(y[shown]), strict=True)
        )
        out.append(f'<polyline class="s{k % 4}" points="{points}"/>')
        out.append(
            f'<text class="k{k % 4}" x="{WIDTH - RIGHT - 4}" y="{TOP + 16 * (k + 1)}" '
            f'text-anchor="end">{escape(name)}</text>'
        )
    return _svg(WIDTH, HEIGHT, "".join(out))


def _grid(across: PlotAxis, up: PlotAxis, units: tuple[str, str]) -> str:
    out = []
    for tick in across.ticks():
        x = float(across.at(tick))
        out.append(f'<line class="g" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
        out.append(
            f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 15}" text-anchor="middle">{tick:g}</text>'
        )
    for tick in up.ticks():
        y = float(up.at(tick))
        out.append(f'<line class="g" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        out.append(f'<text x="{LEFT - 5}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    out.append(
        f'<text x="{WIDTH / 2}" y="{HEIGHT - 3}" text-anchor="middle">{escape(units[0])}</text>'
    )
    out.append(f'<text x="2" y="{TOP + 2}">{escape(units[1])}</text>')
    return "".join(out)


def arrows(at: Floats, way: Floats, heat: Floats, size: tuple[float, float], times: float) -> str:
    """Draws arrows (n, 2) at places (n, 2) of a picture, enlarged `times`.

    Dots have the area of `heat` (n,), 1 at most.
    """
    scale = WIDTH / size[0]
    height = size[1] * scale
    radius = 12.0
    out = [f'<rect class="g" x="0.5" y="0.5" width="{WIDTH - 1}" height="{height - 1:.1f}"/>']
    for (x, y), (dx, dy), hot in zip(at * scale, way * scale * times, heat, strict=True):
        out.append(f'<circle class="h" cx="{x:.1f}" cy="{y:.1f}" r="{radius * np.sqrt(hot):.1f}"/>')
        out.append(
            f'<line class="s0" x1="{x:.1f}" y1="{y:.1f}" x2="{x + dx:.1f}" y2="{y + dy:.1f}"/>'
        )
        out.append(f'<circle class="d" cx="{x + dx:.1f}" cy="{y + dy:.1f}" r="2"/>')
    return _svg(WIDTH, height, "".join(out))


def _svg(width: float, height: float, content: str) -> str:
    return f'<svg class="drawing" viewBox="0 0 {width:g} {height:.1f}" role="img">{content}</svg>'
