# SPDX-License-Identifier: MIT
"""A pair whose rows show that its rectification is off needs larger noises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pelorus.check.outcome import Bench
from pelorus.check.parameters import Tuned, larger
from pelorus.check.tracks_noise import told_apart

SETTING = "pixel-sigma"


def with_shared_rows(bench: Bench, tuned: Tuned) -> Tuned:
    """The same with noises that leave a pixel what the rectification leaves it, too; all are made
    larger alike, so that the estimate stays (halves_alike.py).

    What all points share moves no half of them beside another. Where halves have told the noises
    the two are other errors, and their squares add up. Where they have not, what is in the given
    pixel-sigma already is not known: then it is at least as large, unless it is about that already.
    """
    shared_px = tuned.noise.rows_px
    if SETTING not in tuned.settings or not shared_px > 0:
        return tuned
    was_px = float(tuned.settings[SETTING])
    by_halves = tuned.halves is not None and tuned.halves.is_larger
    if not by_halves and not (shared_px > was_px and told_apart(shared_px, was_px)):
        return tuned
    sigma_px = float(np.hypot(was_px, shared_px)) if by_halves else shared_px
    settings = larger(bench.header, tuned.settings, bench.by_imu, sigma_px / was_px)
    after = bench.run(settings)
    if not after.pose_log_det > tuned.after.pose_log_det:
        return tuned
    return replace(tuned, settings=settings, after=after)
