# SPDX-License-Identifier: MIT
"""A pair whose rows show that its rectification is off needs a larger pixel-sigma."""

from __future__ import annotations

from dataclasses import replace

from pelorus.check.outcome import Bench
from pelorus.check.parameters import Tuned

SETTING = "pixel-sigma"


def with_shared_rows(bench: Bench, tuned: Tuned) -> Tuned:
    """The same with at least the sigma that the rectification leaves."""
    least_px = tuned.noise.rows_px
    if SETTING not in tuned.settings or float(tuned.settings[SETTING]) >= least_px:
        return tuned
    settings = tuned.settings | {SETTING: f"{least_px:.3g}"}
    return replace(tuned, settings=settings, after=bench.run(settings))
