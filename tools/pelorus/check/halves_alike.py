# SPDX-License-Identifier: MIT
"""The noises with which halves of the points tell the same motion (apart.py).

How far halves differ says by how much the covariance is too small; it does not say whose errors
they are. They may be the pixels', or the twists', for two halves weigh the same wrong twist
differently. So all noises are made larger by one factor, the variance of unit weight of geodesy
(Baarda, Statistical concepts in geodesy, 1967): an estimate depends on their ratios alone, so it
stays where it is, and its covariance grows. A larger pixel-sigma alone would leave more to the
twists, of whose errors halves of the points know nothing.

The factor is known before it is tried: where errors are noise, halves with it differ as they
should. Where they do not, something else moves them (cars, a scale, a clock), and no noises stand
for that. Nor may larger noises make the filter surer: it widens its covariance by itself while
pictures and twists contradict each other (NOISE_MISFIT), and wide noises can hide that they do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pelorus.check.apart import Inflated, Parts
from pelorus.check.options import Settings
from pelorus.check.outcome import Bench
from pelorus.check.parameters import Tuned, larger, unless_surer
from pelorus.frames import Kind


def with_halves_alike(bench: Bench, tuned: Tuned) -> Tuned:
    """The same with at least those noises. As it is on a known map."""
    if tuned.settings.get("mode", "slam") != "slam" or bench.holds(Kind.LANDMARK):
        return tuned
    offset_s = float(tuned.settings.get("camera-offset", "0"))

    def of(times: float) -> dict[str, str]:
        return larger(bench.header, tuned.settings, bench.by_imu, times)

    def without_offset(times: float) -> Settings:
        return {k: v for k, v in of(times).items() if k != "camera-offset"}

    found = inflate(bench.parts(offset_s), without_offset)
    if found.is_larger:
        wider = unless_surer(bench, tuned, of(found.times))
        if wider is not tuned:
            return replace(wider, halves=found)
    return replace(tuned, halves=found._replace(times=1.0, after=found.before))


def inflate(parts: Parts, of: Callable[[float], Settings]) -> Inflated:
    """`of`: settings with noises so many times as large. 1 where chance may have moved the halves,
    or where the factor that is expected does not bring them together.
    """
    before = parts.apart(of(1.0))
    stays = Inflated(1.0, before, before)
    if not before.ratio > before.by_chance:
        return stays
    times = float(np.sqrt(before.ratio / before.due))
    after = parts.apart(of(times))
    return Inflated(times, before, after) if after.ratio <= after.by_chance else stays
