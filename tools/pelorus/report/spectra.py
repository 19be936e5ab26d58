# SPDX-License-Identifier: MIT
"""Draws the spectrum of the IMU's vibration, and the pixel residuals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy

from pelorus.explain.log import FilterLog
from pelorus.report.drawings import arrows, plot
from pelorus.report.page import Drawing
from pelorus.report.residuals import Residuals, residuals
from pelorus.wire.layout import Floats

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
