# SPDX-License-Identifier: MIT
"""The pixel-sigma with which halves of the points tell the same motion (apart.py)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pelorus.check.apart import Inflated, Parts
from pelorus.check.options import Settings
from pelorus.check.outcome import Bench
from pelorus.check.parameters import PIXEL, Tuned, starting
from pelorus.frames import Kind

ROUNDS, STEP_LEAST, STEP_MOST = 6, 1.15, 2.5
# Of the frames: where sigmas are honest 0 to 0.04 were seen, where they are not 0.5 to 1. The limit
# is the geometric mean of both: above, a larger pixel-sigma made NEES/6 worse (4.4, then 13).
CONTRADICTED_MOST = 0.14
NEAR = 1.1  # times the ratio that is due: there the search ends
LESS = 0.05  # so much nearer a larger sigma must bring them
PARAMETER = PIXEL["pixel"]


def with_halves_alike(bench: Bench, tuned: Tuned) -> Tuned:
    """The same with at least that sigma. As it is on a known map, and where vision often
    contradicts the twists: a larger pixel-sigma would leave more to them, and the covariances that
    are compared are wider already.
    """
    by_map = tuned.settings.get("mode", "slam") != "slam" or bench.holds(Kind.LANDMARK)
    if by_map or tuned.after.contradicted > CONTRADICTED_MOST:
        return tuned
    sigma_px = starting(bench.header, tuned.settings, PIXEL)["pixel"]
    offset_s = float(tuned.settings.get("camera-offset", "0"))
    settings = {k: v for k, v in tuned.settings.items() if k != "camera-offset"}
    found = inflate(bench.parts(offset_s), settings, sigma_px, PARAMETER.most)
    if not found.is_larger:
        return replace(tuned, halves=found)
    wider = tuned.settings | {PARAMETER.setting: f"{found.sigma_px:.3g}"}
    return replace(tuned, settings=wider, after=bench.run(wider), halves=found)


def inflate(parts: Parts, settings: Settings, sigma_px: float, most_px: float) -> Inflated:
    """The same sigma where chance may have moved the halves, or a larger one does not help."""

    def of(px: float) -> Inflated:
        apart = parts.apart({**settings, PARAMETER.setting: f"{px:.4g}"})
        return Inflated(sigma_px, px, apart, apart)

    first = best = of(sigma_px)
    if not first.after.ratio > first.after.by_chance:
        return first
    tried = best = first
    for _ in range(ROUNDS):
        due = tried.after.due
        step = float(np.clip(np.sqrt(tried.after.ratio / due), STEP_LEAST, STEP_MOST))
        last, tried = tried, of(min(tried.sigma_px * step, most_px))
        if tried.after.ratio < due / NEAR and last.after.ratio > due:
            tried = of(_between(last, tried))
        vain = not best.after.ratio - tried.after.ratio > LESS * best.after.ratio
        if vain and last is not best:  # twice
            break
        best = best if vain else tried
        if tried.after.ratio < NEAR * due or tried.sigma_px >= most_px:
            break
    return best._replace(before=first.before)


def _between(apart: Inflated, alike: Inflated) -> float:
    """Where the ratio is what is due, by a straight line in the logarithms."""
    x, y = (
        np.log([alike.sigma_px, apart.sigma_px]),
        np.log([alike.after.ratio, apart.after.ratio]),
    )
    return float(np.exp(np.interp(np.log(apart.after.due), y, x)))
