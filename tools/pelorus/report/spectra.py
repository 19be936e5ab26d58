# SPDX-License-Identifier: MIT
"""Draws what has no time axis, as SVG, which needs no script and no other package.

It is the spectrum of the IMU's vibration, and the pixel residuals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

import numpy as np
import scipy

from pelorus.explain.log import FilterLog
from pelorus.report.page import Drawing
from pelorus.report.residuals import Residuals, residuals
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


SEGMENT = 1024  # readings of a spectrum
LEAST = 64
CELLS = (12, 8)  # of the picture
IN_CELL = 4
BINS = 61
ROBUST = 1.4826


def drawings(log: FilterLog) -> Iterator[Drawing]:
    """Yields all drawings for which this log has data."""
    if log.by_imu:
        yield from _spectra(log)
    found = residuals(log)
    if len(found.off):
        yield _histogram(found)
        yield from _over_picture(log, found)


def _spectra(log: FilterLog) -> Iterator[Drawing]:
    order = np.argsort(log.reading_ns, kind="stable")
    t_ns = log.reading_ns[order]
    if len(t_ns) < LEAST:
        return
    rate_hz = 1e9 / float(np.median(np.diff(t_ns)))
    about = (
        f"Of {len(t_ns)} readings at {rate_hz:.0f} Hz (Welch). Peaks are motors, propellers, a "
        "loose mount; what lies above half the rate folds back. The noise that is set is flat."
    )
    for name, unit, columns in (
        ("Vibration: specific force", "m/s²/√Hz", slice(0, 3)),
        ("Vibration: turn rate", "rad/s/√Hz", slice(3, 6)),
    ):
        f, power = scipy.signal.welch(
            log.readings[order][:, columns], rate_hz, nperseg=min(SEGMENT, len(t_ns)), axis=0
        )
        lines = [(axis, np.sqrt(power[1:, k])) for k, axis in enumerate("xyz")]
        drawn = plot(f[1:], lines, ("Hz", unit), (True, True))
        if drawn:
            yield Drawing(name, about, drawn)


def _sigma(off: Floats) -> float:
    return ROBUST * float(np.median(np.abs(off - np.median(off))))


def _histogram(found: Residuals) -> Drawing:
    names = ("left u", "left v", "right u", "right v")
    spread = max(_sigma(found.off[:, k]) for k in range(4))
    edges = np.linspace(-5 * spread - 1e-3, 5 * spread + 1e-3, BINS + 1)
    lines = [
        (
            f"{name}: {np.median(found.off[:, k]):+.2f} ± {_sigma(found.off[:, k]):.2f} px",
            np.histogram(found.off[:, k], edges)[0].astype(np.float64),
        )
        for k, name in enumerate(names)
    ]
    about = (
        f"Of {len(found.off)} observations: where a point is seen, less where the ten frames "
        "before say that it should be. Median and robust sigma; the arrows show what points share."
    )
    drawn = plot((edges[1:] + edges[:-1]) / 2, lines, ("px", "observations"))
    return Drawing("Residuals", about, drawn)


def _over_picture(log: FilterLog, found: Residuals) -> Iterator[Drawing]:
    width, height = float(log.header.image_width_px), float(log.header.image_height_px)
    if not (width and height):
        most = np.nanmax(found.pixels, axis=0)
        width, height = float(max(most[0], most[2])) + 1, float(max(most[1], most[3])) + 1
    size = np.array([width, height], np.float64)
    for name, columns in (("left", slice(0, 2)), ("right", slice(2, 4))):
        pixels, off = found.pixels[:, columns], found.off[:, columns]
        cell = np.floor(pixels / size * CELLS).astype(int).clip(0, np.array(CELLS) - 1)
        which = cell[:, 0] * CELLS[1] + cell[:, 1]
        kept = [k for k in np.unique(which) if np.count_nonzero(which == k) >= IN_CELL]
        if not kept:
            continue
        at = np.array([pixels[which == k].mean(axis=0) for k in kept])
        way = np.array([np.median(off[which == k], axis=0) for k in kept])
        count = np.array([np.count_nonzero(which == k) for k in kept], np.float64)
        longest = float(np.linalg.norm(way, axis=1).max())
        times = float(f"{0.05 * width / max(longest, 1e-6):.1g}")
        about = (
            f"Median residual of each part of the {name} picture, {times:g} times as long (the "
            f"longest is {longest:.2f} px); dots are by the number of points. Arrows that turn or "
            "grow outwards are a lens or a rectification that is off."
        )
        drawn = arrows(at, way, count / count.max(), (width, height), times)
        yield Drawing(f"Residuals over the {name} picture", about, drawn)
