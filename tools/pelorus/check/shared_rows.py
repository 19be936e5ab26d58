# SPDX-License-Identifier: MIT
"""A pair whose rows show that its rectification is off needs a larger pixel-sigma."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pelorus.check.outcome import Bench
from pelorus.check.parameters import Tuned
from pelorus.check.tracks_noise import told_apart

SETTING = "pixel-sigma"


def with_shared_rows(bench: Bench, tuned: Tuned) -> Tuned:
    """The same with the sigma that the rectification leaves, too.

    What all points share moves no half of them beside another (halves_alike.py): the two are other
    errors, and their squares add up. Where halves were not compared, what is in it already is not
    known: then it is at least as large, unless it is about that already.
    """
    shared_px = tuned.noise.rows_px
    if SETTING not in tuned.settings or not shared_px > 0:
        return tuned
    was_px = float(tuned.settings[SETTING])
    if tuned.halves is None and not (shared_px > was_px and told_apart(shared_px, was_px)):
        return tuned
    sigma_px = shared_px if tuned.halves is None else float(np.hypot(was_px, shared_px))
    settings = tuned.settings | {SETTING: f"{sigma_px:.3g}"}
    return replace(tuned, settings=settings, after=bench.run(settings))
