# SPDX-License-Identifier: MIT
"""Health as a time line: spells, their reasons, pauses."""

from __future__ import annotations

from pelorus.evaluate.health import HARMLESS, SHORT, Spell, TimeLine, reasons, time_line
from pelorus.wire import schema
from pelorus.wire.frames import Kind, Report

MS = 1_000_000


def reason(*names: str) -> int:
    return sum(schema.number("reason", name) for name in names)


def answers(*rows: tuple[int, int, int]) -> list[Report]:
    """(t in ms, health, reasons)."""
    return [Report(t * MS, Kind.STEREO, health=h, reasons=r) for t, h, r in rows]


def line(*rows: tuple[int, int, int]) -> TimeLine:
    found = time_line(answers(*rows))
    assert found is not None
    return found


def words(*rows: tuple[int, int, int]) -> list[str]:
    return [spell.words(0) for spell in line(*rows).spells]


def test_a_result_without_answers_has_no_time_line() -> None:
    assert time_line([Report(1, Kind.TWIST, health=2)]) is None


def test_a_good_result_has_no_spells() -> None:
    found = line(*((100 * k, 0, 0) for k in range(9)))
    assert found.spells == ()
    assert found.summary() == "good in 9 of 9 frames"


def test_a_spell_says_from_when_to_when_and_why() -> None:
    frozen = reason("FROZEN_IMAGE", "FEW_OBSERVATIONS")
    rows = [(100 * k, 2 if 370 <= k <= 401 else 0, frozen) for k in range(500)]
    assert words(*rows) == [
        "lost from 37.0 to 40.1 s (32 frames): identical pixels, fewer than 3 points used"
    ]


def test_causes_stand_before_symptoms_whatever_is_more_frequent() -> None:
    symptom, cause = reason("POSE_MAY_BE_WRONG"), reason("FROZEN_IMAGE")
    rows = [(100 * k, 1, symptom | (cause if k == 5 else 0)) for k in range(8)]
    (said,) = words(*rows)
    assert said.endswith(f": {SHORT['FROZEN_IMAGE']} (1 of them), {SHORT['POSE_MAY_BE_WRONG']}")


def test_flicker_is_one_spell_and_what_lies_apart_is_two() -> None:
    high = reason("NIS_HIGH")
    flicker = [(100 * k, k % 3 == 0, high) for k in range(1, 30)]
    assert [s.frames for s in line(*flicker).spells] == [9]
    apart = [(100 * k, k in (3, 14), high) for k in range(30)]
    assert [s.frames for s in line(*apart).spells] == [1, 1]


def test_a_moment_of_lost_within_degraded_is_told_by_itself() -> None:
    rows = [(100 * k, 2 if k in (10, 11) else 1, reason("NIS_HIGH")) for k in range(20)]
    found = line(*rows).spells
    assert [(s.health, s.frames) for s in found] == [(1, 18), (2, 2)]


def test_a_pause_in_the_frames_is_lost_for_want_of_frames() -> None:
    assert words((0, 0, 0), (100, 0, 0), (3100, 0, 0)) == ["lost from 0.1 to 3.1 s: no frames came"]


def test_the_first_frame_has_nothing_to_use_and_that_is_no_fault() -> None:
    few = reason("FEW_OBSERVATIONS")
    assert words((0, 1, few), (100, 0, 0)) == []
    assert words((0, 1, few), (100, 1, few), (200, 0, 0)) == [
        "degraded at 0.1 s (1 frame): fewer than 3 points used"
    ]
    assert len(words((0, 1, few | reason("NO_TWISTS")), (100, 0, 0))) == 1


def test_a_refused_frame_says_why_and_not_the_reasons_of_the_one_before() -> None:
    late = Report(5, Kind.STEREO, status=-6, health=1, reasons=reason("NIS_HIGH"))
    found = time_line([*answers((0, 0, 0)), late])
    assert found is not None
    assert [s.why for s in found.spells] == [("frame refused, time repeats or goes back",)]


def test_every_reason_has_words_and_the_harmless_ones_are_left_out() -> None:
    assert set(SHORT) <= set(schema.REASON_NAMES.values())
    for bit, name in schema.REASON_NAMES.items():
        assert len(reasons(bit)) == (not bit & HARMLESS), name
    assert reasons(1 << 30) == ("reason 30",)  # of a later version


def test_a_single_frame_has_one_time() -> None:
    assert Spell(1, 2500 * MS, 2500 * MS, 1, ("x",)).words(500 * MS) == (
        "degraded at 2.0 s (1 frame): x"
    )


def test_frames_before_the_start_are_not_counted() -> None:
    waits, few = reason("NOT_STARTED"), reason("FEW_OBSERVATIONS")
    rows = [(50 * k, 2, waits) for k in range(23)]
    found = line(*rows, (1150, 1, few), *((1200 + 50 * k, 0, 0) for k in range(8)))
    assert (found.frames, found.before_start, found.spells) == (9, 23, ())
    assert (
        found.summary() == "good in 8 of 9 frames, degraded in 1, after 23 frames before the start"
    )


def test_a_filter_that_never_starts_is_lost() -> None:
    found = line(*((50 * k, 2, reason("NOT_STARTED")) for k in range(23)))
    assert found.summary() == "good in 0 of 23 frames, lost in 23"


def test_a_filter_that_waits_again_later_is_lost_meanwhile() -> None:
    waits = reason("NOT_STARTED")
    found = line((0, 0, 0), *((50 * k, 2, waits) for k in range(1, 5)), (250, 0, 0))
    assert found.by_health["lost"] == 4
