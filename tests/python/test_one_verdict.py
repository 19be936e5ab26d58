# SPDX-License-Identifier: MIT
"""One verdict of a run, whoever asks: `check`, `report`, `explain` and `try` say the same, with why
and what to set. tests/recordings/one_verdict.py asks it of as many drives as one likes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run as Command
from pelorus.check import verdict
from pelorus.check.known import Known
from pelorus.check.verdict import Grade
from pelorus.evaluate.health import SHORT, time_line
from pelorus.explain import explain
from pelorus.explain.log import Cause
from pelorus.native.replay import replayed
from pelorus.report.curves import Curves
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.mishaps import Mishaps
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire import schema
from pelorus.wire.frames import End, Kind, Message, Report, Stereo, Text, Truth
from pelorus.wire.framing import write_file
from replay_drive import BIN
from report_runs import built_programs

DRIVE = Options(seed=31, duration_s=20.0, lap_s=15.0, speed_mps=2.0)


def recorded(options: Options = DRIVE) -> list[Message]:
    return list(simulate(options).recording.messages())


def log_of(messages: list[Message], *options: str) -> list[Message]:
    return replayed(built_programs().float32, messages, options)


@pytest.fixture(scope="module")
def clean() -> list[Message]:
    """A log; no test changes it."""
    return log_of(recorded())


def with_reasons(log: list[Message], frames: range, reason: str, health: int) -> list[Message]:
    """The same log, in which the filter says this of these frames."""
    out, k = list[Message](), -1
    for m in log:
        k += isinstance(m, Report) and m.subject == Kind.STEREO
        if isinstance(m, Report) and m.subject == Kind.STEREO and k in frames:
            m = replace(m, reasons=schema.number("reason", reason), health=health)  # noqa: PLW2901
        out.append(m)
    return out


def said(found: dict[str, Any]) -> list[Any]:
    return [found[name] for name in ("verdict", "grade", "why", "what_to_set")]


def test_four_commands_have_one_verdict(tmp_path: Path, pelorus: Command) -> None:
    drive, conf = tmp_path / "d.plr", tmp_path / "tuned.conf"
    simulate(DRIVE).recording.write(drive)
    given = ("--bin", BIN, "--set", "pixel-sigma=0.3")
    page = tmp_path / "check.html"
    found = json.loads(pelorus("check", drive, "--out", conf, "--page", page, "--json", *given).out)
    before = json.loads(pelorus("explain", drive, "--json", *given).out)
    assert before["verdict"] == found["as_given"]
    tuned = ("--config", conf, "--bin", BIN)
    report = json.loads(pelorus("report", drive, "--out", tmp_path / "out", "--json", *tuned).out)
    after = json.loads(pelorus("explain", drive, "--json", *tuned).out)
    assert said(found) == said(report) == said(after)
    words = found["verdict"][0].upper() + found["verdict"][1:]
    for path in (page, tmp_path / "out/report.html"):
        assert f'<div class="verdict {found["grade"]}"><strong>{words}</strong>' in path.read_text()
    assert conf.read_text().startswith(f"# pelorus check d.plr: {found['verdict']}\n")


def test_a_divergence_is_an_event_of_its_own_and_spoils_the_verdict(
    clean: list[Message],
) -> None:
    found = explain(with_reasons(clean, range(100, 103), "NOT_POSITIVE", 2))
    assert [episode.first.cause for episode in found.episodes] == [Cause.DIVERGED]
    assert "one event (diverged)" in found.lines()[0]
    assert "a variance ceased to be positive in 3 frames" in "\n".join(found.lines())
    assert not found.unexplained
    assert found.verdict.grade is Grade.BAD
    assert "it diverged in 3 frames, first at 10." in found.verdict.doubts[0]


def test_a_divergence_is_told_however_many_other_events_there_are(
    clean: list[Message],
) -> None:
    found = explain(with_reasons(clean, range(150, 152), "NOT_POSITIVE", 2))
    (diverged,) = found.episodes
    other = replace(diverged, first=diverged.first._replace(cause=Cause.SLIP))
    many = replace(found, episodes=(*(other,) * 9, diverged))
    assert "10 events, 1 of them diverged" in many.lines()[0]
    assert any(line.startswith("10. ") and ": diverged" in line for line in many.lines())
    assert len(many.lines()) <= 20


def test_a_reason_is_told_with_the_frames_that_had_it(clean: list[Message]) -> None:
    log = with_reasons(clean, range(60, 100), "TWIST_CONTRADICTED", 1)
    log = with_reasons(log, range(99, 100), "FEW_OBSERVATIONS", 1)
    line = time_line(log)
    assert line is not None
    (spell,) = line.spells
    other, few = SHORT["TWIST_CONTRADICTED"], SHORT["FEW_OBSERVATIONS"]
    assert spell.words(0).endswith(f"(40 frames): {other} (39 of them), {few} (1 of them)")
    same = time_line(with_reasons(clean, range(60, 100), "TWIST_CONTRADICTED", 1))
    assert same is not None
    assert same.spells[0].words(0).endswith(f"(40 frames): {other}")


@pytest.mark.parametrize("lasts_s", [4.0, 6.0])
def test_a_slip_lasts_as_long_as_the_wheels_slip_and_not_as_the_doubt(
    lasts_s: float,
) -> None:
    slip = Mishaps(slip=0.5, slip_span=Span(20.0, lasts_s))
    options = replace(DRIVE, seed=11, duration_s=45.0, lap_s=25.0, speed_mps=2.5, mishaps=slip)
    found = explain(log_of(recorded(options)))
    (first, *_) = [e.first for e in found.episodes]
    assert first.cause is Cause.SLIP
    assert (first.to_ns - first.from_ns) * 1e-9 == pytest.approx(lasts_s, abs=1.0)


def test_what_the_recording_says_of_itself_is_told(clean: list[Message]) -> None:
    words = "the clock of the camera is 30 ms off"
    assert f"the recording says: {words}" in explain([clean[0], Text(words), *clean[1:]]).remarks


def test_frames_before_an_imu_has_started_are_not_drawn_as_lost() -> None:
    log = log_of(recorded(replace(DRIVE, duration_s=6.0, imu=SimulatedImu(imu_rate_hz=200))))
    waiting = schema.number("reason", "NOT_STARTED")
    log = [
        replace(m, reasons=waiting, health=2)
        if isinstance(m, Report) and m.subject == Kind.STEREO and m.t_ns < 2_000_000_000
        else m
        for m in log
    ]
    curves = Curves(log)
    packed = curves.packer
    shown: list[Any] = []
    keep = packed.add_exactly
    packed.add_exactly = lambda values, kind: shown.append(values) or keep(values, kind)  # type: ignore[method-assign, func-returns-value]
    told = curves.json()
    health = np.asarray(shown[1])
    assert told["words"]["health"][int(health[0])] == "not started"
    assert set(health[30:]) <= {0.0, 1.0}


# --- what the verdict is made of ------------------------------------------------------------------


def graded(log: list[Message], words: str) -> Grade:
    """Returns the grade of the one remark with these words, whatever the recording itself shows."""
    (remark,) = [
        remark
        for remark in verdict.verdict_of(verdict.JudgedRun.of(log), Known()).remarks
        if words in remark.text
    ]
    return remark.grade


@pytest.mark.parametrize(
    ("share", "grade"), [(0.01, Grade.GOOD), (0.09, Grade.CARE), (0.5, Grade.BAD)]
)
def test_a_gate_that_rejects_far_more_than_is_expected_is_not_called_good(
    clean: list[Message], share: float, grade: Grade
) -> None:
    log = [
        replace(m, matched=1000, gated=round(1000 * share)) if isinstance(m, Report) else m
        for m in clean
    ]
    assert graded(log, f"the gate rejects {share:.1%} of the matches") is grade


def test_a_filter_that_is_surer_than_it_says_is_no_doubt(clean: list[Message]) -> None:
    less = [
        replace(m, innovation_d2=m.innovation_d2 / 4) if isinstance(m, Report) else m for m in clean
    ]
    more = [
        replace(m, innovation_d2=m.innovation_d2 * 4) if isinstance(m, Report) else m for m in clean
    ]
    assert graded(less, "(innovations)") is Grade.GOOD
    assert graded(more, "(innovations)") is Grade.CARE
    assert not any("would be about right" in r.text for r in verdict.verdict_of_log(more).remarks)


def test_the_recordings_truth_is_part_of_the_verdict(clean: list[Message]) -> None:
    assert graded(clean, "beside the recording's truth") is Grade.GOOD
    off = [
        replace(m, p_WB_m=np.asarray(m.p_WB_m) + 1e-7 * m.t_ns * 1e-3)
        if isinstance(m, Truth)
        else m
        for m in clean
    ]
    assert graded(off, "beside the recording's truth") is Grade.BAD


def test_notes_of_the_search_decide_nothing() -> None:
    remarks = [
        verdict.Remark(Grade.GOOD, "a"),
        verdict.Remark(Grade.BAD, "b", is_note=True),
    ]
    assert verdict.overall(remarks) is Grade.GOOD
    assert remarks[1].mark == "note"


def late_by(shift_ns: int, messages: Sequence[Message]) -> list[Message]:
    return [
        replace(m, t_ns=m.t_ns + shift_ns) if isinstance(m, Stereo) else m
        for m in messages
        if not isinstance(m, End)
    ]


def test_a_late_camera_is_told_with_the_offset_until_that_is_set(
    tmp_path: Path, pelorus: Command
) -> None:
    path = tmp_path / "late.plr"
    options = Options(duration_s=30.0, speed_mps=1.5, lap_s=12.0, seed=8)
    late = late_by(55_000_000, list(simulate(options).recording.messages()))
    write_file(path, sorted(late, key=lambda m: getattr(m, "t_ns", -1)), len(late))
    before = json.loads(pelorus("explain", path, "--json").out)
    offset = before["what_to_set"]["camera-offset"]
    assert float(offset) == pytest.approx(-0.055, abs=0.004)
    assert any("(camera-offset)" in words for words in before["why"])
    after = json.loads(pelorus("explain", path, "--json", "--set", f"camera-offset={offset}").out)
    assert "camera-offset" not in after["what_to_set"]
    assert not any("(camera-offset)" in words for words in after["why"])


def test_noises_are_advised_only_where_none_have_been_chosen(
    tmp_path: Path, pelorus: Command
) -> None:
    path, drive = tmp_path / "quiet.plr", simulate(DRIVE).recording
    large = replace(drive.header.noise, pixel_sigma_px=5.0, velocity_sigma_mps=0.5)
    drive.with_header(noise=large).write(path)
    assert verdict.NOISES in pelorus("explain", path).out
    assert verdict.NOISES not in pelorus("explain", path, "--set", "pixel-sigma=4").out
