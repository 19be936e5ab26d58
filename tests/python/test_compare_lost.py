# SPDX-License-Identifier: MIT
"""`pelorus compare` where something is missing: a frame, an answer, some of the log, a state."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from flight_logs import (
    AT,
    DIFFERENT,
    NOT_COMPARABLE,
    SAME,
    Compare,
    changed,
    index,
    robots_log,
    without,
)
from pelorus.robot.stream import start_from
from pelorus.wire.frames import (
    End,
    Kind,
    Message,
    Notice,
    Pose,
    Report,
    State,
    StateAction,
    Stereo,
    Text,
    Twist,
)
from replay_drive import FRAMES, drive, encode, header, t_ns

DAMAGED, NOT_READY, FOREIGN = -15, -13, -16  # plr_status
STARTED = Report(0, notice=Notice.STARTED)
BOOT = [STARTED, Text("pelorus 0.1.0 on a board, build 0x1: power-on")]
A_TWIST_LESS = End(0, 0, 0, 0, 0, differs=1, arrived=(39, 0, 0, 0, 0))  # of 40


# --- what was lost --------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [Pose, Report])
def test_half_an_answer_is_missed_and_the_rest_compared(
    compare: Compare, log: list[Message], kind: type[Message]
) -> None:
    said = compare(without(log, kind))
    assert said.status == NOT_COMPARABLE
    assert f"does not hold the {kind.kind.name} of frame {AT + 1}" in said.out
    assert f"to the end: {FRAMES - 1} of {FRAMES} frames are the same" in said.out


def test_a_lost_answer_is_missed_and_the_rest_compared(
    compare: Compare, log: list[Message]
) -> None:
    said = compare(without(log, Pose, Report))
    assert said.status == NOT_COMPARABLE
    assert f"does not hold the answer to frame {AT + 1}; what it holds has the same" in said.out
    assert f"{FRAMES - 1} of {FRAMES} frames" in said.out


def lost_on_the_way(tmp_path: Path, kind: type[Message]) -> tuple[list[Message], Message]:
    """The log of a robot that did not get one message, and that message, which the log holds."""
    messages = drive()
    at = index(messages, kind)
    log = robots_log(tmp_path, [*messages[:at], *messages[at + 1 :]])
    log.insert(index(log, Pose, AT - 1) + 2, messages[at])
    return log, messages[at]


def test_a_frame_that_did_not_reach_the_robot_is_left_out(compare: Compare, tmp_path: Path) -> None:
    said = compare(lost_on_the_way(tmp_path, Stereo)[0])
    assert said.status == SAME, said.out
    assert f"frame {AT + 1}: it did not reach the robot, and the replay leaves it out" in said.out
    assert f"at frame {AT + 1}: no answer to frame {AT + 1}" in said.out
    assert f"{FRAMES - 1} of {FRAMES} frames" in said.out


def test_a_twist_that_was_damaged_on_the_way_ends_what_can_be_compared(
    compare: Compare, tmp_path: Path
) -> None:
    log, twist = lost_on_the_way(tmp_path, Twist)
    log.insert(log.index(twist) + 1, Report(0, 0, DAMAGED))
    log.insert(index(log, Twist, 3), Report(0, 0, DAMAGED))  # of noise, which cost nothing
    said = compare(encode(log, end=A_TWIST_LESS))
    assert said.status == NOT_COMPARABLE, said.out
    assert "at frame 4: the robot refused a message: damaged: bytes fail their check" in said.out
    assert f"from frame {AT + 1} on the robot may have had other inputs" in said.out
    assert "the robot refused a message: damaged: bytes fail their check (status -15)" in said.out
    assert f"frame {AT + 2}, t 7.100000000 s, is the first that differs" in said.out


def test_a_twist_that_the_robot_missed_is_found_in_its_count_at_the_end(
    compare: Compare, tmp_path: Path
) -> None:
    log, _ = lost_on_the_way(tmp_path, Twist)
    assert compare(log).status == DIFFERENT  # nothing says that one is missing
    said = compare(encode(log, end=A_TWIST_LESS))
    assert said.status == NOT_COMPARABLE
    words = "the robot's count at the end lacks messages that the log holds: 1"
    assert f"lost      somewhere: {words}\n" in said.out
    assert f"somewhere the robot may have had other inputs than the log holds ({words})" in said.out


def test_a_difference_before_a_loss_is_a_difference(compare: Compare, log: list[Message]) -> None:
    told = without(changed(log, Report, used=1), Pose, Report, k=AT + 5)
    assert compare(told).status == DIFFERENT


def test_a_log_that_lost_an_input_is_compared_up_to_there(
    compare: Compare, log: list[Message]
) -> None:
    content = bytearray(encode(log))
    start = content.index(encode([log[0]], end=False)[:8])
    assert start == 0
    ends = [at for at, byte in enumerate(content) if byte == 0]
    content[ends[index(log, Twist) - 1] + 20] ^= 1
    said = compare(bytes(content))
    assert said.status == NOT_COMPARABLE, said.out
    assert "the log is damaged: 1 frames, 1 missing" in said.out
    assert f"at frame {AT + 1}: the log lacks 1 of its frames there" in said.out
    assert f"from frame {AT + 1} on the robot may have had other inputs" in said.out


def test_damage_to_what_is_no_input_and_no_answer_costs_nothing(
    compare: Compare, log: list[Message]
) -> None:
    log.insert(index(log, Report) + 1, Text("some words"))
    content = encode(log).replace(b"some words", b"some wor8s")
    said = compare(content)
    assert said.status == SAME, said.out
    assert "the log is damaged: 1 frames, 1 missing" in said.out


# --- lives and states -----------------------------------------------------------------------------


def restarted(tmp_path: Path) -> list[Message]:
    """The log of a robot that started anew behind frame AT, as `pelorus stream` writes it."""
    messages = drive()
    cut = index(messages, Stereo) + 1
    first = robots_log(tmp_path, messages[:cut])
    last = [m for m in first if isinstance(m, Pose)][-1]
    second = robots_log(tmp_path, [header(), start_from(last), *messages[cut + 3 :]])
    died = messages[cut : cut + 3]  # taken by nobody
    half = [Report(t_ns(AT + 1), Kind.STEREO, NOT_READY), Report(0, 0, DAMAGED)]
    note = Text("the board started anew", 1)
    return [*first, *died, *BOOT, half[1], note, second[0], half[0], *second[1:]]


def test_each_life_of_a_robot_is_compared_by_itself(compare: Compare, tmp_path: Path) -> None:
    said = compare(restarted(tmp_path))
    assert said.status == SAME, said.out
    assert "lost" not in said.out
    assert f"part 1 of 2, frames 1 to {AT + 2}\n" in said.out
    assert f"part 2 of 2, frames {AT + 3} to {FRAMES}: the robot started anew" in said.out
    assert f"{FRAMES - 1} of {FRAMES} frames" in said.out


def test_settings_that_were_told_once_hold_in_a_second_life(
    compare: Compare, tmp_path: Path
) -> None:
    log = restarted(tmp_path)
    settings = [at for at, message in enumerate(log) if message.kind == Kind.CONFIG]
    assert len(settings) == 2
    assert compare(log[: settings[1]] + log[settings[1] + 1 :]).status == SAME


def test_a_difference_in_a_second_life_keeps_the_logs_numbers(
    compare: Compare, tmp_path: Path
) -> None:
    log = restarted(tmp_path)
    at = index(log, Report, FRAMES - 1)
    report = log[at]
    assert isinstance(report, Report)
    log[at] = replace(report, used=1)
    said = compare(log)
    assert said.status == DIFFERENT
    assert f"frame {FRAMES}, t 8.900000000 s, is the first that differs" in said.out


@pytest.fixture
def state(tmp_path: Path) -> Path:
    kept = tmp_path / "robot.state"
    robots_log(tmp_path, drive()[: 1 + 3 * AT], "--save-state", str(kept))
    return kept


def test_a_drive_from_a_saved_state_needs_that_state(
    compare: Compare, tmp_path: Path, state: Path
) -> None:
    rest = [header(), *drive()[1 + 3 * AT :]]
    log = robots_log(tmp_path, rest, "--load-state", str(state))
    said = compare(log)
    assert said.status == NOT_COMPARABLE
    assert "went on from a saved state, which the log does not hold" in said.err
    assert "--load-state" in said.err
    assert compare(log, "--load-state", state).status == SAME
    assert compare(log, "--load-state", tmp_path / "absent").status == NOT_COMPARABLE


@pytest.mark.parametrize(("answer", "verdict"), [(0, NOT_COMPARABLE), (FOREIGN, SAME)])
def test_a_restore_that_was_refused_has_changed_nothing(
    compare: Compare, log: list[Message], answer: int, verdict: int
) -> None:
    asked = [State(t_ns(0), StateAction.RESTORE), Report(t_ns(0), Kind.STATE, answer)]
    first = index(log, Twist, 0)
    assert compare([*log[:first], *asked, *log[first:]]).status == verdict


def test_a_state_that_was_saved_costs_nothing(compare: Compare, tmp_path: Path) -> None:
    log = robots_log(tmp_path, drive(), "--save-state", str(tmp_path / "robot.state"))
    assert any(isinstance(m, Report) and m.subject == Kind.STATE for m in log)
    assert compare(log).status == SAME


def test_a_log_that_began_otherwise_is_told_how(compare: Compare, tmp_path: Path) -> None:
    messages = [m for m in drive() if m.kind != Kind.TRUTH or m.t_ns > t_ns(3)]  # type: ignore[attr-defined]
    log = robots_log(tmp_path, messages, "--start", "truth")
    said = compare(log)
    assert said.status == DIFFERENT
    assert "pelorus-replay that wrote the log was given --start" in said.out
    assert compare(log, "--start", "truth").status == SAME
    assert compare(log, "--start", "anywhere").status == NOT_COMPARABLE
