# SPDX-License-Identifier: MIT
"""`pelorus check` of a drive whose calibration the filter estimates: one sentence, and no second
one of the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Once
from pelorus.check import verdict
from pelorus.check.calibration import CalibrationDoubts, Turned
from pelorus.check.estimated import Estimated, estimated, without_clock
from pelorus.check.verdict import Grade
from pelorus.commands.cli import main
from pelorus.native.replay import replayed
from pelorus.wire.frames import Header, Message
from pelorus.wire.framing import messages_of
from pelorus.wire.layout import Floats
from report_runs import built_programs

TURNED_RAD = np.radians(1.0)
CALIBRATE = ("--calibrate", "focal,baseline,turn")
SEARCHED = 0.003**2 * np.eye(3)  # covariance of a search's turn


@pytest.fixture(scope="module")
def turned(once: Once) -> Path:
    """A drive by twists with a camera that is turned by a degree, about all its axes alike."""
    twists = ("--seed", "5", "--duration", "60", "--twist-rate", "20", "--camera-turned", "1")
    return once("turned.plr", lambda out: main(["simulate", str(out), *twists]))


def log_of(recording: Path, *options: str) -> list[Message]:
    return replayed(built_programs().float32, messages_of(recording), [*CALIBRATE, *options])


def in_body(recording: Path) -> Floats:
    """The true turn about the body's axes."""
    header = next(m for m in messages_of(recording) if isinstance(m, Header))
    turn: Floats = np.asarray(header.R_CB).T @ np.full(3, TURNED_RAD / np.sqrt(3))
    return turn


def found(log: Sequence[Message], turn: Turned | None = None) -> Estimated:
    estimate = estimated(log, CalibrationDoubts(None, turn))
    assert estimate is not None
    return estimate


def test_a_turn_that_filter_and_search_see_is_told_once(turned: Path) -> None:
    log = log_of(turned, "--camera-turn-sigma", "0.01")
    search = Turned(in_body(turned), SEARCHED, adds=100.0)
    assert search.is_off
    own = found(log, search)
    assert own.answers_turn
    assert not own.is_doubtful
    said = list(verdict.of_calibration(CalibrationDoubts(None, search), own))
    assert [remark.grade for remark in said] == [Grade.GOOD]
    assert "corrected by turn of the camera about its" in said[0].text
    assert [r.grade for r in verdict.of_calibration(CalibrationDoubts(None, search))] == [
        Grade.CARE
    ]


def test_a_search_that_sees_another_turn_is_told(turned: Path) -> None:
    log = log_of(turned, "--camera-turn-sigma", "0.01")
    search = Turned(-in_body(turned), SEARCHED, adds=100.0)
    own = found(log, search)
    assert own.is_doubtful
    assert "the search sees the camera turned otherwise" in own.words()
    said = list(verdict.of_calibration(CalibrationDoubts(None, search), own))
    assert len(said) == 2


def test_a_turn_beyond_its_prior_names_the_setting(turned: Path) -> None:
    log = log_of(turned, "--camera-turn-sigma", "0.01")
    corrected = np.zeros(11)
    corrected[3] = 0.05
    own = found([*log, replace(found(log).estimate, corrected=corrected)])
    assert own.off == ("camera-turn-sigma",)
    assert "more than 4 sigma by camera-turn-sigma" in own.words()
    assert own.is_doubtful


def test_a_part_that_the_filter_put_back_is_named(turned: Path) -> None:
    log = log_of(turned, "--camera-turn-sigma", "0.01")
    estimate = found(log).estimate
    own = found([*log, replace(estimate, estimated=estimate.estimated & ~1)])
    assert own.refused == ("baseline",)
    assert "refused baseline" in own.words()
    assert own.is_doubtful


def test_a_calibration_that_is_right_is_said_to_be(turned: Path) -> None:
    own = found(log_of(turned, "--camera-turn-sigma", "0.01"))
    right = replace(own, estimate=replace(own.estimate, corrected=np.zeros(11)))
    assert "finds it right: baseline to" in right.words()
    assert (
        estimated(replayed(built_programs().float32, messages_of(turned), []), CalibrationDoubts())
        is None
    )


def test_the_clock_is_searched_by_a_filter_that_does_not_estimate_it() -> None:
    assert without_clock({"calibrate": "focal,clock"}) == {"calibrate": "focal"}
    assert without_clock({"calibrate": "clock"}) == {"calibrate": "off"}
    assert without_clock({"slots": "9"}) == {"slots": "9"}
