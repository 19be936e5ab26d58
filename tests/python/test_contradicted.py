# SPDX-License-Identifier: MIT
"""`pelorus check` writes no noises with which the filter contradicts what it took before."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from pelorus.check import verdict
from pelorus.check.contradicted import with_no_more_contradictions
from pelorus.check.outcome import NOTHING, Outcome
from pelorus.check.parameters import Tuned
from pelorus.check.tracks_noise import TrackNoise
from pelorus.frame_table import FrameTable
from pelorus.health import TimeLine
from pelorus.schema import HEALTHS

LIKELIEST = {"pixel-sigma": "0.2", "velocity-sigma": "0.1,0.2,0.3", "bias": "on"}


class Drive:
    """Vision contradicts the twists where pixel-sigma is below what the drive needs."""

    by_imu = False

    def __init__(self, needs_px: float) -> None:
        self.needs_px = needs_px

    def run(self, settings: dict[str, str]) -> Outcome:
        denied = float(settings["pixel-sigma"]) < self.needs_px
        return replace(NOTHING, contradicted=0.6 if denied else 0.02)


def tuned(needs_px: float, before: float = 0.0) -> Tuned:
    drive = Drive(needs_px)
    found = Tuned(
        LIKELIEST,
        replace(NOTHING, contradicted=before),
        drive.run(LIKELIEST),
        TrackNoise({}, float("nan")),
    )
    return with_no_more_contradictions(cast(Any, drive), found)


def test_noises_that_bring_contradictions_are_enlarged_alike_until_there_are_none() -> None:
    found = tuned(needs_px=0.35)
    assert float(found.settings["pixel-sigma"]) == pytest.approx(0.4)
    sigmas = [float(part) for part in found.settings["velocity-sigma"].split(",")]
    np.testing.assert_allclose(sigmas, (0.2, 0.4, 0.6), rtol=1e-3)
    assert found.settings["bias"] == "on"
    assert found.after.contradicted == 0.02
    assert "all noises are 2.0 times the likeliest ones" in found.doubts[0]
    assert "in 60% of the frames" in found.doubts[0]


@pytest.mark.parametrize(
    ("needs_px", "before"),
    [(0.1, 0.0), (0.35, 0.6), (5.0, 0.0)],
    ids=["none", "as before", "no noise helps"],
)
def test_else_the_likeliest_noises_stay(needs_px: float, before: float) -> None:
    found = tuned(needs_px, before)
    assert found.settings == LIKELIEST
    assert not found.doubts


@pytest.mark.parametrize(
    ("good", "grade"),
    [(99, verdict.Grade.GOOD), (60, verdict.Grade.CARE), (40, verdict.Grade.BAD)],
)
def test_a_filter_that_is_not_good_most_of_the_time_is_not_to_be_trusted(
    good: int, grade: verdict.Grade
) -> None:
    line = TimeLine(100, {HEALTHS[0]: good, HEALTHS[1]: 100 - good}, ())
    run = verdict.Run([], cast(FrameTable, None), line)
    (remark,) = verdict._health(run)
    assert remark.grade is grade
