# SPDX-License-Identifier: MIT
"""`pelorus check` writes nothing that suits one half of a drive alone, and no noises that are too
narrow for what is off for longer than a step.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pelorus.check import biases, halves_alike, outcome, tuning, verdict
from pelorus.check.held import held_against
from pelorus.check.outcome import NOTHING, Outcome
from pelorus.check.parameters import Tuned, larger
from pelorus.check.tracks_noise import TrackNoise
from pelorus.evaluate.frame_table import FrameTable
from pelorus.evaluate.health import TimeLine
from pelorus.faults.fault import Fault
from pelorus.wire.frames import Kind, Report
from pelorus.wire.schema import HEALTHS, number
from replay_drive import header

WHITE, DRIFTS = TrackNoise({1: 1.0, 5: 1.0}, 1.0), TrackNoise({1: 0.3, 5: 0.6}, 1.63)
GIVEN = {"pixel-sigma": "1", "velocity-sigma": "0.1", "bias": "off", "twist-timing": "start"}
FOUND = {
    "pixel-sigma": "0.4",
    "velocity-sigma": "0.05,0.2,0.05",
    "gyro-sigma": "0.01",
    "bias": "on",
    "twist-timing": "end",
}


class Drive:
    """A bench on which settings cost what is said, by half, and pixel-sigmas below `needs_px` are
    contradicted.
    """

    by_imu = False
    header = header()

    def __init__(self, needs_px: float = 0.0, halves: dict[str, tuple[float, float]] = {}) -> None:  # noqa: B006
        self.needs_px = needs_px
        self.halves = halves

    def run(self, settings: dict[str, str]) -> Outcome:
        return self.run_all([settings])[0]

    def run_all(self, many: list[dict[str, str]], what: str = "") -> list[Outcome]:
        assert what in ("", "both halves")
        return [self._outcome(settings) for settings in many]

    def _outcome(self, settings: dict[str, str]) -> Outcome:
        pixel = settings.get("pixel-sigma", "2")
        cost = self.halves.get(pixel, (float(pixel),) * 2)[int(settings.get(outcome.PART, "0"))]
        denied = 0.08 if float(pixel) < self.needs_px else 0.02
        return replace(NOTHING, cost=cost, matched=1000, contradicted=denied)


def found(drive: Drive, noise: TrackNoise = WHITE, **more: Any) -> Tuned:
    words = ["a", "clock"]
    runs = drive.run(GIVEN), drive.run(FOUND)
    tuned = Tuned(FOUND, *runs, noise, words, of_clock=["clock"], **more)
    return held_against(cast(Any, drive), GIVEN, tuned)


def test_noises_that_are_likelier_in_both_halves_and_contradict_nothing_are_written() -> None:
    held = found(Drive())
    assert held.settings == FOUND
    assert not held.doubts


def test_noises_that_suit_one_half_of_the_drive_alone_are_not_written() -> None:
    held = found(Drive(halves={"0.4": (0.1, 1.1)}))
    assert held.settings == GIVEN | {"twist-timing": "end"}  # of which a parabola has judged
    assert "yours stay" in held.said[0]
    assert "clock" in held.said


def test_with_noises_that_bring_contradictions_none_is_written_below_the_given_one() -> None:
    held = found(Drive(needs_px=0.5))
    assert held.settings["pixel-sigma"] == "1"
    assert held.settings["velocity-sigma"] == "0.1,0.2,0.1"  # what is too small by itself is not
    assert held.settings["gyro-sigma"] == "0.01"
    assert held.settings["bias"] == "off"
    assert held.settings["twist-timing"] == "end"
    assert held.after.contradicted == 0.02
    assert "in 8% of the frames, with yours in 2%" in held.doubts[0]
    as_before = found(Drive(needs_px=5.0))
    assert as_before.settings == FOUND


@pytest.mark.parametrize("noise", [WHITE, DRIFTS])
def test_beside_a_fault_that_lasts_no_noise_is_written_below_the_given_one(
    noise: TrackNoise,
) -> None:
    held = found(Drive(), noise, lasting=["the gyro lags"])
    if noise.drifts:  # there no noise was fitted to steps
        assert held.settings == FOUND
        return
    assert held.settings["pixel-sigma"] == "1"
    assert held.doubts[0].startswith("the gyro lags. That is off for longer than a step")


def test_faults_that_last_are_those_that_are_neither_clocks_nor_gaps() -> None:
    lasting = [
        n for n in ("scale", "clock-turns", "clock", "time-gap", "untold") if Fault(n, "").lasts
    ]
    assert lasting == ["scale", "clock-turns"]


# --- where tracks drift ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given_px", "given_mps", "written_px", "written_mps"),
    [(1.41, 0.1, 1.41, 0.1), (5.0, 0.4, 1.63, 0.08), (0.4, 0.05, 1.63, 0.05)],
    ids=["about as found", "far larger", "smaller"],
)
def test_what_drifting_tracks_tell_replaces_only_what_is_clearly_off(
    monkeypatch: pytest.MonkeyPatch,
    given_px: float,
    given_mps: float,
    written_px: float,
    written_mps: float,
) -> None:
    spread = SimpleNamespace(velocity_mps=0.08, gyro_radps=0.01)
    monkeypatch.setattr(tuning, "difference_of_a_reading", lambda _: spread)
    bench = SimpleNamespace(examined=None, run=lambda _: NOTHING)
    start = {"pixel": given_px, "velocity": given_mps, "gyro": 0.01}
    values = tuning._of_drifting_tracks(cast(Any, bench), {}, start, DRIFTS).values
    assert values == {"pixel": written_px, "velocity": written_mps, "gyro": 0.01}


def test_a_sigma_that_is_about_what_the_rows_leave_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TrackNoise, "rows_px", 2.3)
    less_sure = replace(NOTHING, pose_log_det=0.0)
    bench = SimpleNamespace(run=lambda _: less_sure)
    for given, written in (("2", "2"), ("1", "2.3")):
        tuned = Tuned({"pixel-sigma": given}, NOTHING, NOTHING, DRIFTS)
        kept = halves_alike.with_shared_rows(cast(Any, bench), tuned)
        assert kept.settings["pixel-sigma"] == written
        surer = replace(tuned, after=replace(NOTHING, pose_log_det=1.0))  # as it was
        assert halves_alike.with_shared_rows(cast(Any, bench), surer) is surer


def test_all_noises_are_made_larger_alike() -> None:
    """So the estimate, which depends on their ratios, stays."""
    given = {
        "pixel-sigma": "2",
        "velocity-sigma": "0.1,0.2,0.3",
        "velocity-sigma-z": "0.4",
        "track-drift": "1",
        "slots": "50",
    }
    assert larger(header(), given, False, 1.5) == {
        "pixel-sigma": "3",
        "velocity-sigma": "0.15,0.3,0.6",
        "gyro-sigma": "0.015",
        "track-drift": "1.5",
        "bias-velocity-sigma": "0.0075",
        "bias-gyro-sigma": "0.015",
        "slots": "50",
    }
    by_imu = larger(header(), {}, True, 2.0)
    assert by_imu["accel-noise"] == "0.02"
    assert not any(name.startswith("bias") for name in by_imu)


@pytest.mark.parametrize(
    ("given", "size", "changed"),
    [
        ({"bias-gyro-sigma": "0.03", "bias-velocity-sigma": "0.001"}, 0.0095, {}),
        ({"bias-gyro-sigma": "0.001"}, 0.0095, {"bias-gyro-sigma": "0.0095"}),
        (
            {"bias": "off"},
            0.004,
            {"bias": "on", "bias-velocity-sigma": "0", "bias-gyro-sigma": "0.004"},
        ),
        ({"bias": "on"}, 0.0, {}),
    ],
    ids=["allowed", "too narrow", "off", "none told"],
)
def test_priors_of_biases_that_allow_what_drifting_tracks_tell_stay(
    monkeypatch: pytest.MonkeyPatch, given: dict[str, str], size: float, changed: dict[str, str]
) -> None:
    told = {"bias-gyro-sigma": biases.CommonBias(size, 1e-4)}
    monkeypatch.setattr(biases, "_halves", lambda *_: told)
    for frames, expected in ((200, given | changed), (199, given)):
        examined = SimpleNamespace(frame_t_ns=np.arange(frames) * 100_000_000)
        bench = SimpleNamespace(examined=examined, header=header())
        settings, _ = biases.gyro_bias_in_drift(cast(Any, bench), given, {})
        assert settings == expected


def test_a_bias_that_a_bent_picture_may_be_is_not_switched_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        biases, "_halves", lambda *_: {"bias-gyro-sigma": biases.CommonBias(0.002, 1e-4)}
    )
    examined = SimpleNamespace(frame_t_ns=np.arange(200) * 100_000_000)
    bench = SimpleNamespace(examined=examined, header=header())
    turns_px = 0.002 * header().camera.fx_px * 0.1
    off = {"bias": "off"}
    bent, words = biases.gyro_bias_in_drift(cast(Any, bench), off, {}, 1.1 * turns_px)
    assert bent == off
    assert "rectification" in words
    flat, _ = biases.gyro_bias_in_drift(cast(Any, bench), off, {}, 0.9 * turns_px)
    assert flat["bias"] == "on"


# --- the verdict ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("good", "why", "grade"),
    [
        (99, "TWIST_CONTRADICTED", verdict.Grade.GOOD),
        (60, "TWIST_CONTRADICTED", verdict.Grade.CARE),
        (40, "TWIST_CONTRADICTED", verdict.Grade.BAD),
        (40, "BIAS_OFF_PRIOR", verdict.Grade.CARE),  # the bias itself is graded, too
        (40, "NO_TWISTS", verdict.Grade.CARE),  # of odometry that is sent while the robot moves
    ],
)
def test_a_filter_that_doubts_most_of_the_time_is_not_to_be_trusted(
    good: int, why: str, grade: verdict.Grade
) -> None:
    bad = Report(0, Kind.STEREO, health=1, reasons=number("reason", why))
    line = TimeLine(100, {HEALTHS[0]: good, HEALTHS[1]: 100 - good}, ())
    run = verdict.JudgedRun([bad] * (100 - good), cast(FrameTable, None), line)
    (remark,) = verdict._health(run)
    assert remark.grade is grade
