# SPDX-License-Identifier: MIT
"""Detects an IMU that reaches the end of its range, where a reading is only a lower bound.

Where it clips, the largest number occurs many times, more often than slightly smaller ones; a
motion that merely reverses there leaves more of these. Parts have ranges of round numbers: near one
of them fewer readings suffice.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pelorus.faults.finding import Finding
from pelorus.io.recording import Recording
from pelorus.math.inertial import Inertial
from pelorus.wire.layout import Floats

SAME = 1e-5  # of the largest number, for rounding
BELOW = 0.95  # share of it from which numbers count as slightly smaller
NAMED_LEAST, OTHERS_LEAST = 5, 20  # readings at the end of a range that parts have, or of another
NAMED_NEAR = 0.015
STEPS_LEAST = 100  # in last digits: at rest a coarse number occurs often, too
DEG, G = np.pi / 180, 9.80665
GYRO_RANGES = DEG * np.array([125, 245, 250, 300, 400, 450, 500, 1000, 2000, 4000])
ACCEL_RANGES = G * np.array([2, 3, 4, 6, 8, 12, 16, 24, 30, 32, 40, 64])
INSIDE = 0.999  # factor of the range in the setting


def with_ranges(recording: Recording, raw: Inertial) -> tuple[Recording, list[Finding]]:
    """Returns the recording with gyro-range and accel-range set where the sensor clips.

    `raw` are the readings before they were corrected.
    """
    settings, findings = dict(recording.settings), []
    parts = (
        ("gyro-range", "rad/s", raw.w_B_radps, recording.inertial.w_B_radps, GYRO_RANGES),
        ("accel-range", "m/s^2", raw.a_B_mps2, recording.inertial.a_B_mps2, ACCEL_RANGES),
    )
    for name, unit, given, used, ranges in parts:
        clipped = clips(given, ranges)
        if not clipped.any() or name in settings:
            continue
        end = float(np.abs(given[clipped]).max())
        settings[name] = round(INSIDE * float(np.abs(used[clipped]).min()), 4)
        evidence = f"{int(clipped.any(axis=1).sum())} readings stand at the end, {end:.4g} {unit}"
        action = f"{name} = {settings[name]:g} is set: the filter refuses readings there. A sensor "
        action += "of a larger range, or a softer mounting, would lose none"
        findings.append(Finding(name, False, evidence, action, measured=True))
    return replace(recording, settings=settings), findings


def clips(x: Floats, ranges: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Returns (n, 3) which numbers are at the end of the range."""
    size = np.abs(x)
    end = float(size.max(initial=0.0))
    at_end = size >= end * (1 - SAME)
    named = bool((np.abs(ranges / max(end, 1e-9) - 1) < NAMED_NEAR).any())
    count = int(at_end.sum())
    below = int(((size >= BELOW * end) & ~at_end).sum())
    enough = count >= (NAMED_LEAST if named else OTHERS_LEAST)
    told = enough and count > (below if named else 2 * below)
    return at_end if told and end > STEPS_LEAST * _step(size) else np.zeros_like(at_end)


def _step(size: Floats) -> float:
    """Returns the resolution: the usual step between neighbouring numbers."""
    steps = np.diff(np.unique(size))
    return float(np.median(steps)) if len(steps) else np.inf
