# SPDX-License-Identifier: MIT
"""Enlarges pixel-sigma where the rows of a pair show that its rectification is off."""

from __future__ import annotations

from pelorus.check.outcome import Bench
from pelorus.check.parameters import Tuned, unless_surer
from pelorus.check.tracks_noise import differs_clearly

SETTING = "pixel-sigma"


def with_shared_rows(bench: Bench, tuned: Tuned) -> Tuned:
    """Returns the settings with at least the sigma that the rectification's error needs.

    It comes before halves of the points are compared (halves_alike.py), for here the source of the
    error is known. No sigma is taken that makes the filter surer.
    """
    shared_px = tuned.noise.rows_px
    if SETTING not in tuned.settings or not shared_px > 0:
        return tuned
    was_px = float(tuned.settings[SETTING])
    if not (shared_px > was_px and differs_clearly(shared_px, was_px)):
        return tuned
    return unless_surer(bench, tuned, tuned.settings | {SETTING: f"{shared_px:.3g}"})
