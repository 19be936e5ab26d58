# SPDX-License-Identifier: MIT
"""`pelorus explain`: first causes with their times, silence where nothing happened, bad logs.

tests/recordings/explain.py does the same with many drives, real ones too, and prints shares.
"""

from __future__ import annotations

import json
import re
import sys
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run as Command
from draws import draws
from pelorus.check import verdict as verdicts
from pelorus.errors import PelorusError
from pelorus.explain import Explanation, explain
from pelorus.explain.explanation import LINES
from pelorus.explain.log import Cause
from pelorus.math.motion import runs
from pelorus.report import answers, page
from pelorus.report.curves import Curves
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.mishaps import Mishaps
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire import schema
from pelorus.wire.evidence import Evidence
from pelorus.wire.frames import Header, Message, Pose, Report, Stereo, Twist
from pelorus.wire.frames import Imu as ImuReadings
from pelorus.wire.framing import messages_of
from replay_drive import ROOT, drive, encode, run

sys.path.insert(0, str(ROOT / "tests" / "recordings"))
from injected_events import EVENTS, S, moving

DRIVE = Options(seed=11, duration_s=30.0, speed_mps=2.5, lap_s=25.0)
WITHIN_S = 1.0
LATE = schema.number("status", "LATE")


@cache
def simulated(by_imu: bool = False, **mishaps: Any) -> list[Message]:
    options = replace(DRIVE, mishaps=Mishaps(**mishaps))
    if by_imu:
        options = replace(options, imu=SimulatedImu(imu_rate_hz=200))
    return list(simulate(options).recording.messages())


def log_of(messages: list[Message], folder: Path, *options: str) -> list[Message]:
    recording, log = folder / "in.plr", folder / "log.plr"
    recording.write_bytes(encode(messages))
    run(recording, "--quiet", *options, "--out", log)
    return messages_of(log)


def explained(messages: list[Message], folder: Path, *options: str) -> Explanation:
    return explain(log_of(messages, folder, *options))


# --- what happened --------------------------------------------------------------------------------


@pytest.mark.parametrize("by_imu", [False, True])
def test_of_a_clean_drive_it_is_said_that_nothing_happened(tmp_path: Path, by_imu: bool) -> None:
    found = explained(simulated(by_imu), tmp_path)
    assert found.first is None
    assert found.lines()[0].startswith("no event in ")
    assert len(found.lines()) == 1


@pytest.mark.parametrize("by_imu", [False, True], ids=["twists", "imu"])
@pytest.mark.parametrize("event", [e for e in EVENTS if not e.whole], ids=lambda e: e.name)
def test_the_first_cause_of_an_event_is_named_with_its_time(
    tmp_path: Path, event: Any, by_imu: bool
) -> None:
    if event.wheels is not None and event.wheels == by_imu:
        pytest.skip("an event of wheels")
    chance = np.random.default_rng(5)
    messages = simulated(by_imu)
    t = int(chance.choice(list(moving(messages))))
    changed = event.into(messages, t, chance)
    assert changed is not None
    found = explained(changed, tmp_path).first
    assert found is not None
    assert found.cause in event.causes
    assert abs(found.from_ns - t) <= WITHIN_S * S


@pytest.mark.parametrize(
    ("mishap", "cause", "at_s"),
    [
        ({"slip": 0.4, "slip_span": Span(17.0, 3.0)}, Cause.SLIP, 17.0),
        ({"slip": 1.8, "slip_span": Span(12.0, 4.0)}, Cause.SLIP, 12.0),
        ({"dead_encoder": Span(14.0, 6.0)}, Cause.DEAD_ODOMETRY, 14.0),
        ({"frozen": Span(19.0, 3.0)}, Cause.FROZEN_PICTURE, 19.0),
        ({"jump_m": 1.5, "jump_at_s": 16.0}, Cause.JUMP, 16.0),
    ],
)
def test_mishaps_of_the_simulation_are_named(
    tmp_path: Path, mishap: dict[str, Any], cause: Cause, at_s: float
) -> None:
    found = explained(simulated(**mishap), tmp_path)
    assert found.first is not None
    assert found.first.cause is cause
    assert abs(found.seconds(found.first.from_ns) - at_s) <= WITHIN_S


def test_a_camera_that_pauses_and_odometry_that_pauses_are_told_apart(tmp_path: Path) -> None:
    from_ns, to_ns = 12 * S, 15 * S

    def without(kind: type) -> list[Message]:
        return [
            m
            for m in simulated()
            if not (isinstance(m, kind) and from_ns < getattr(m, "t_ns", 0) < to_ns)
        ]

    for kind, cause in ((Stereo, Cause.NO_FRAMES), (Twist, Cause.NO_READINGS)):
        found = explained(without(kind), tmp_path)
        assert found.first is not None
        assert found.first.cause is cause
        assert abs(found.seconds(found.first.from_ns) - 12.0) <= WITHIN_S


@pytest.mark.parametrize("by_s", [0.06, -0.07])
def test_a_step_of_less_than_a_frame_is_seen(tmp_path: Path, by_s: float) -> None:
    def stepped(m: Message) -> Message:
        if not isinstance(m, Stereo) or m.t_ns < 14 * S:
            return m
        return replace(m, t_ns=m.t_ns + round(by_s * S))

    found = explained([stepped(m) for m in simulated()], tmp_path)
    assert found.first is not None
    assert found.first.cause is Cause.CLOCK_STEP
    assert abs(found.seconds(found.first.from_ns) - 14.0) <= 0.2
    assert ("forward" if by_s > 0 else "back") in found.first.words


def test_frames_that_are_sorted_by_stamps_that_stepped_are_no_pause(tmp_path: Path) -> None:
    head, *rest = simulated()
    twists = [m for m in rest if isinstance(m, Twist)]
    frames = [
        replace(m, t_ns=m.t_ns + 2 * S) if m.t_ns >= 14 * S else m
        for m in rest
        if isinstance(m, Stereo)
    ]
    data: list[Twist | Stereo] = [*twists, *(m for m in frames if m.t_ns <= twists[-1].t_ns)]
    found = explained([head, *sorted(data, key=lambda m: m.t_ns)], tmp_path)
    assert found.first is not None
    assert found.first.cause is Cause.CLOCK_STEP
    assert "as if no time had passed" in found.first.words


def test_wheels_that_stand_are_no_dead_encoder(tmp_path: Path) -> None:
    options = replace(DRIVE, stop=Span(15.0, 10.0), bias_velocity_sigma_mps=0.0)
    messages = simulate(options).recording.messages()

    def at_rest(m: Message) -> Message:
        if not isinstance(m, Twist) or not 16 * S <= m.t_ns < 24 * S:
            return m
        return replace(m, v_B_mps=np.zeros(3))

    assert explained([at_rest(m) for m in messages], tmp_path).first is None


def test_settings_that_do_not_fit_are_told_as_such_and_not_as_an_event(tmp_path: Path) -> None:
    found = explained(simulated(), tmp_path, "--pixel-sigma", "0.08")
    assert found.episodes == ()
    assert found.first is not None
    assert found.first.cause is Cause.SETTINGS
    assert "pixel-sigma too small" in found.setup[0]


# --- how it is told -------------------------------------------------------------------------------


def test_readings_that_come_late_all_along_are_a_matter_of_settings(tmp_path: Path) -> None:
    messages = simulated(twist_delay_s=0.08)
    found = explained(messages, tmp_path)
    (words,) = [words for words in found.setup if "later than the frames" in words]
    told = re.search(r"come ([\d.]+) s later", words)
    assert told is not None
    assert float(told[1]) == pytest.approx(0.08, abs=0.011)
    assert "were refused: set twist-delay" in words
    assert explained(messages, tmp_path, "--twist-delay", "0.1").setup == ()


def test_frames_that_are_refused_are_told_with_what_lets_them_in(tmp_path: Path) -> None:
    late = list(simulate(replace(DRIVE, camera_delay_s=0.07)).recording.messages())
    messages = log_of(late, tmp_path)
    reports = [m for m in messages if isinstance(m, Report) and m.status == LATE]
    assert {schema.HEALTHS[m.health] for m in reports} == {"lost"}
    found = explain(messages)
    assert found.episodes == ()
    (words,) = found.setup
    assert re.match(
        r"\d+ of \d+ frames were refused: .* twists .* 0\.07. s: set twist-delay", words
    )
    assert explained(late, tmp_path, "--twist-delay", "0.1").setup == ()


def test_a_few_frames_that_were_refused_are_a_remark(tmp_path: Path) -> None:
    messages = simulated()
    frames = [k for k, m in enumerate(messages) if isinstance(m, Stereo)]
    for k in frames[50:60]:  # each behind the next one's readings
        messages = [*messages[:k], *messages[k + 1 : k + 9], messages[k], *messages[k + 9 :]]
    found = explained(messages, tmp_path)
    assert found.setup == ()
    assert any(re.match(r"\d+ of \d+ frames were refused: ", words) for words in found.remarks)


@pytest.mark.parametrize(
    ("wrong", "by", "told"),
    [
        ("baseline_error_percent", 20.0, "along the way"),
        ("camera_turned_deg", 8.0, "across the way"),
    ],
)
def test_a_bias_tells_a_wrong_scale_from_a_turned_camera(
    tmp_path: Path, wrong: str, by: float, told: str
) -> None:
    found = explained(simulated(**{wrong: by}), tmp_path)
    assert found.lines()[0].startswith("no event in 30.0 s, but something is wrong all along; ")
    assert [words for words in found.setup if told in words], found.setup


def test_the_end_of_the_readings_is_no_step_of_a_clock(tmp_path: Path) -> None:
    late = replace(DRIVE, camera_delay_s=0.25)
    found = explained(list(simulate(late).recording.messages()), tmp_path)
    assert found.episodes == ()


def test_health_that_nothing_explains_is_told(tmp_path: Path) -> None:
    messages = log_of(simulated(), tmp_path)
    reports = [k for k, m in enumerate(messages) if isinstance(m, Report) and m.observations]
    for k in reports[100:110]:
        report = messages[k]
        assert isinstance(report, Report)
        messages[k] = replace(report, health=1, reasons=schema.number("reason", "NIS_HIGH"))
    found = explain(messages)
    assert found.episodes == ()
    (line,) = found.lines()[1:]
    assert line.startswith("not explained: degraded from 10.")
    assert "(10 frames): innovations larger than the noise explains" in line
    assert found.json()["not_explained"] == [line.removeprefix("not explained: ")]
    answer = answers.of_explanation(found, "odd")
    assert answer.grade == found.verdict.mark
    assert [event.lines for event in answer.events] == [(line,)]


def test_a_log_full_of_events_is_told_in_twenty_lines(tmp_path: Path) -> None:
    messages = simulated()
    dark = [
        replace(m, ids=m.ids[:0], pixels=m.pixels[:0])
        if isinstance(m, Stereo) and m.t_ns % (11 * S) < 2 * S and m.t_ns > 5 * S
        else m
        for m in messages
    ]
    found = explained(dark, tmp_path)
    assert len(found.episodes) == 2
    many = replace(found, episodes=found.episodes * 30, setup=("settings",) * 3)
    assert len(many.lines()) <= LINES
    assert "more: --json has all of them" in many.lines()[-1]
    assert len(many.json()["episodes"]) == 60


def test_the_command_tells_a_log_and_replays_a_recording(pelorus: Command, tmp_path: Path) -> None:
    messages = simulated(slip=0.4, slip_span=Span(17.0, 3.0))
    log_of(messages, tmp_path)
    verdict, *lines = pelorus("explain", tmp_path / "log.plr").out.splitlines()
    assert verdict.partition(", to ")[0] in verdicts.VERDICTS.values()
    while lines[0].startswith("   "):  # why
        lines.pop(0)
    assert lines[0].startswith("one event (slip) in ")
    assert lines[1].startswith("1. 17.")
    assert "the odometry says" in lines[1]
    assert lines[2].startswith("   before: health good, ")
    said = json.loads(pelorus("explain", tmp_path / "in.plr", "--json").out)
    assert said["first_cause"]["cause"] == "slip"
    assert said["first_cause"]["from_s"] == pytest.approx(17.0, abs=WITHIN_S)


def test_a_log_without_evidence_or_end_or_readings_says_so(tmp_path: Path) -> None:
    log = log_of(drive(), tmp_path)
    whole = explain(log)
    assert whole.remarks == ()
    bare = explain([m for m in log if not isinstance(m, Evidence)])
    assert "no EVIDENCE" in bare.remarks[0]
    cut = explain(log[: len(log) // 2])
    assert "cut short" in cut.remarks[0]
    assert "no twists" in explain([m for m in log if not isinstance(m, Twist)]).remarks[0]


def test_damaged_frames_of_a_log_are_told(pelorus: Command, tmp_path: Path) -> None:
    log_of(drive(), tmp_path)
    spoilt = bytearray((tmp_path / "log.plr").read_bytes())
    spoilt[len(spoilt) // 2] ^= 0x55
    (tmp_path / "spoilt.plr").write_bytes(spoilt)
    said = pelorus("explain", tmp_path / "spoilt.plr")
    assert re.search(r"spoilt.plr: (one frame is|\d frames are) damaged and left out", said.err)
    assert "in 3.9 s" in said.out
    assert "damaged" not in pelorus("explain", tmp_path / "log.plr").err


def test_logs_that_tell_nothing_are_refused(pelorus: Command, tmp_path: Path) -> None:
    with pytest.raises(PelorusError, match="no answer of a filter"):
        explain(drive())
    empty = tmp_path / "empty.plr"
    empty.write_bytes(b"")
    assert "the file is empty" in pelorus("explain", empty, status=1).err
    assert "there is no such file" in pelorus("explain", tmp_path / "no.plr", status=1).err


def test_a_robot_that_answers_late_is_explained_alike(tmp_path: Path) -> None:
    log = log_of(simulated(slip=0.4, slip_span=Span(17.0, 3.0)), tmp_path)
    late, held = list[Message](), list[Message]()
    for m in log:  # answers stand behind the next frame
        if isinstance(m, Pose | Report | Evidence):
            held.append(m)
            continue
        late.append(m)
        if isinstance(m, Stereo):
            late[-1:] = [m, *held[:-3]] if len(held) > 3 else [m]
            held = held[-3:]
    found, due = explain([*late, *held]), explain(log)
    assert found.first == due.first
    assert [e.first for e in found.episodes] == [e.first for e in due.episodes]


@pytest.mark.parametrize("by_imu", [False, True])
@pytest.mark.parametrize("seed", draws(range(6)))
def test_whatever_stands_in_a_log_no_number_warns(tmp_path: Path, seed: int, by_imu: bool) -> None:
    chance = np.random.default_rng(seed)
    wild = np.array([np.nan, np.inf, -np.inf, 1e38, -1e38, 0.0, 1e7])

    def spoilt(m: Message) -> Message:
        if chance.random() > 0.05:
            return m
        if isinstance(m, Stereo) and len(m.ids):
            pixels = m.pixels.copy()
            pixels[chance.integers(len(pixels), size=5)] = chance.choice(wild, (5, 4))
            return replace(m, pixels=pixels)
        if isinstance(m, Twist):
            return replace(m, v_B_mps=chance.choice(wild * 1e200, 3))
        if isinstance(m, ImuReadings):
            return replace(m, w_B_radps=chance.choice(wild, m.w_B_radps.shape))
        return m

    log = log_of([spoilt(m) for m in simulated(by_imu)], tmp_path)
    chosen = [m for m in log if chance.random() > 0.01 or isinstance(m, Header)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = explain(chosen)
        json.dumps(found.json(), allow_nan=False)
        assert 1 <= len(found.lines()) <= LINES
        page.write(tmp_path / "p.html", answers.of_explanation(found, "x"), Curves(chosen))


def test_runs_are_first_and_last_of_each_stretch() -> None:
    flags = np.array([True, True, False, True, False, False, True])
    assert runs(flags) == [(0, 1), (3, 3), (6, 6)]
    assert runs(np.zeros(3, bool)) == []
