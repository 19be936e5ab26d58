# SPDX-License-Identifier: MIT
"""Enlarges the noises until halves of the points give the same motion (apart.py).

The difference of the halves says by how much the covariance is too small, but not whose errors they
are: the pixels', or the twists', for two halves weigh the same wrong twist differently. So all
noises are enlarged by one factor, the variance of unit weight of geodesy (Baarda, Statistical
concepts in geodesy, 1967): the estimate depends on their ratios alone and stays, and its covariance
grows. A larger pixel-sigma alone would give more weight to the twists, whose errors the halves
cannot show.

The factor is predicted before it is tried: where errors are noise, halves differ with it as
expected. Where they do not, the cause is another one (cars, a scale, a clock), which no noise
covers. Larger noises must not make the filter surer either: it widens its covariance while pictures
and twists contradict each other (NOISE_MISFIT), and large noises can hide that they do.

Rows that show a rectification to be off tell whose error it is: there pixel-sigma alone grows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pelorus.check.apart import Inflated, Parts
from pelorus.check.options import Settings
from pelorus.check.outcome import Bench
from pelorus.check.parameters import Tuned, larger, unless_surer
from pelorus.check.tracks_noise import differs_clearly
from pelorus.wire.frames import Kind

PIXEL_SIGMA = "pixel-sigma"


def with_halves_alike(bench: Bench, tuned: Tuned) -> Tuned:
    """Returns the settings with noises that make the halves agree; unchanged on a known map."""
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
    """Returns the factor for the noises, and how far apart the halves are without and with it.

    `of` returns settings with noises enlarged by a factor. The result is 1 where chance explains
    the difference, or where the predicted factor does not make the halves agree.
    """
    before = parts.apart(of(1.0))
    stays = Inflated(1.0, before, before)
    if not before.ratio > before.by_chance:
        return stays
    times = float(np.sqrt(before.ratio / before.expected))
    after = parts.apart(of(times))
    return Inflated(times, before, after) if after.ratio <= after.by_chance else stays


def with_shared_rows(bench: Bench, tuned: Tuned) -> Tuned:
    """Returns the settings with at least the sigma that the rectification's error needs.

    It comes before halves of the points are compared, for here the source of the error is known.
    No sigma is taken that makes the filter surer.
    """
    shared_px = tuned.noise.rows_px
    if PIXEL_SIGMA not in tuned.settings or not shared_px > 0:
        return tuned
    was_px = float(tuned.settings[PIXEL_SIGMA])
    if not (shared_px > was_px and differs_clearly(shared_px, was_px)):
        return tuned
    return unless_surer(bench, tuned, tuned.settings | {PIXEL_SIGMA: f"{shared_px:.3g}"})
