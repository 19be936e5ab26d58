# SPDX-License-Identifier: MIT
"""`pelorus compare`: a log against the desk. What a board's log compares to is tests/target's."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run
from fake_board import FULL, FakeBoard, TcpBoard
from pelorus import __version__
from pelorus.flight.judge import fingerprint
from pelorus.frames import NO_BUDGET, Config, Kind, Message, Pose, Report, Stereo, Text, Twist
from pelorus.robot.status import HEALTH, REASONS, condition
from pelorus.robot.stream import start_from
from replay_drive import BIN, FRAMES, drive, encode, header, known, log_of, run, t_ns

ROOT = Path(__file__).resolve().parents[2]
SAME, DIFFERENT, NOT_COMPARABLE = 0, 1, 2
DAMAGED, NOT_READY = -15, -13  # plr_status
AT = 20  # the frame that something happens to, from 0; it is told as AT + 1
BOOT = Text("pelorus 0.1.0 on a board, build 0x1: power-on")

Compare = Callable[..., Any]


@pytest.fixture
def compare(pelorus: Run, tmp_path: Path) -> Compare:
    """Compare a log, given as messages or bytes."""

    def call(log: Iterable[Message] | bytes, *options: object) -> Any:
        path = tmp_path / "flight.plr"
        path.write_bytes(log if isinstance(log, bytes) else encode(log))
        return pelorus("compare", path, "--bin", BIN, *options)

    return call


def robots_log(
    folder: Path, messages: Sequence[Message], *options: str, program: str = "pelorus-replay"
) -> list[Message]:
    """What a filter takes and gives, without END."""
    source, log = folder / "robot.in.plr", folder / "robot.out.plr"
    source.write_bytes(encode(messages))
    assert run(source, "--quiet", "--out", log, *options, program=program).status == 0
    return [message for message in log_of(log) if message.kind != Kind.END]


@pytest.fixture
def log(tmp_path: Path) -> list[Message]:
    return robots_log(tmp_path, drive(), "--slots", "20", "--bias", "on")


def index(log: list[Message], kind: type[Message], k: int = AT) -> int:
    """Where the message of that kind and frame is."""
    return next(
        at
        for at, m in enumerate(log)
        if isinstance(m, kind) and m.t_ns == t_ns(k)  # type: ignore[attr-defined]
    )


def without(log: list[Message], *kinds: type[Message], k: int = AT) -> list[Message]:
    """The log without what one frame has of those kinds."""
    gone = {index(log, kind, k) for kind in kinds}
    return [message for at, message in enumerate(log) if at not in gone]


def changed(log: list[Message], kind: type[Message], **changes: object) -> list[Message]:
    at = index(log, kind)
    return [*log[:at], replace(log[at], **changes), *log[at + 1 :]]  # type: ignore[type-var]


# --- the same bits --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("program", "real"), [("pelorus-replay", "float32"), ("pelorus-replay-f64", "float64")]
)
def test_a_log_of_the_replay_has_its_bits_in_its_own_precision(
    compare: Compare, tmp_path: Path, program: str, real: str
) -> None:
    said = compare(robots_log(tmp_path, drive(), program=program))
    assert said.status == SAME, said.out + said.err
    assert f"the same bits: {FRAMES} of {FRAMES} frames" in said.out
    assert f"blocks of 8, {real}, {BIN / program}\n" in said.out
    assert "another version" not in said.out


def test_the_settings_of_the_log_hold(compare: Compare, log: list[Message]) -> None:
    assert compare(log).status == SAME
    settings = next(m for m in log if isinstance(m, Config))
    assert (settings.settings[4], settings.settings[3]) == (20, 1)


def test_the_robots_own_clock_is_not_compared(compare: Compare, log: list[Message]) -> None:
    assert compare(changed(log, Report, update_us=123456)).status == SAME


def test_a_log_that_was_cut_short_is_compared_up_to_there(
    compare: Compare, log: list[Message]
) -> None:
    under_way = log[: index(log, Stereo) + 1]
    said = compare(encode(under_way, end=False))
    assert said.status == SAME, said.out
    assert f"{AT} of {AT + 1} frames" in said.out
    assert "there is no END: the log was cut short" in said.out
    assert f"no answer came from frame {AT + 1} on" in said.out


def test_a_log_told_late_is_replayed_with_its_settings(
    compare: Compare, log: list[Message]
) -> None:
    """Where a robot's CONFIG came behind data, a plain replay would begin without it."""
    settings = next(at for at, m in enumerate(log) if isinstance(m, Config))
    late = [*log[:settings], *log[settings + 1 : settings + 4], log[settings], *log[settings + 4 :]]
    assert compare(late).status == SAME


def test_known_landmarks_that_the_robot_had_no_room_for_are_left_out(
    compare: Compare, tmp_path: Path
) -> None:
    settings = Config({2: 2})  # localization
    some, others = known()[:64], known()[64:]
    log = robots_log(tmp_path, [header(), settings, *some, *drive()[1:]])
    refusals = [Report(0, Kind.LANDMARK, FULL) for _ in others]
    at = 2 + len(some)
    assert compare([*log[:at], *others, *log[at:]]).status == DIFFERENT
    said = compare([*log[:at], *others, *refusals, *log[at:]])
    assert said.status == SAME, said.out


def test_a_budget_of_the_robots_own_clock_is_kept(compare: Compare, tmp_path: Path) -> None:
    messages = drive()
    at = index(messages, Stereo)
    messages[at] = replace(messages[at], budget=5)  # type: ignore[type-var]
    log = robots_log(tmp_path, messages)
    sent = index(log, Stereo)
    log[sent] = replace(log[sent], budget=NO_BUDGET)  # type: ignore[type-var]
    assert compare(log).status == SAME


def test_a_frame_that_the_robot_refused_unread_is_left_out(
    compare: Compare, tmp_path: Path
) -> None:
    messages = drive()
    at = index(messages, Stereo)
    log = robots_log(tmp_path, [*messages[:at], *messages[at + 1 :]])
    behind = index(log, Twist, AT + 1)
    log[behind:behind] = [messages[at], Report(0, Kind.STEREO, FULL)]
    said = compare(log)
    assert said.status == SAME, said.out
    assert "1 of more observations than the robot has room for" in said.out


# --- other bits -----------------------------------------------------------------------------------


def with_one_bit(pose: Pose) -> Pose:
    """The lowest bit of x turned over."""
    (bits,) = struct.unpack("<Q", struct.pack("<d", pose.p_WB_m[0]))
    (x,) = struct.unpack("<d", struct.pack("<Q", bits ^ 1))
    return replace(pose, p_WB_m=np.array([x, *pose.p_WB_m[1:]]))


def test_one_bit_of_one_pose_is_found_and_measured(compare: Compare, log: list[Message]) -> None:
    at = index(log, Pose)
    pose = log[at]
    assert isinstance(pose, Pose)
    log[at] = with_one_bit(pose)
    said = compare(log)
    assert said.status == DIFFERENT, said.out
    assert f"different: {FRAMES - 1} of {FRAMES} frames" in said.out
    assert f"first     frame {AT + 1}, t 7.000000000 s, is the first that differs" in said.out
    step = np.spacing(abs(pose.p_WB_m[0]))
    assert f"POSE in position: {step:.3g} m, 0 deg, covariance 0 of" in said.out
    assert f"largest   position {step:.3g} m, at frame {AT + 1}" in said.out
    assert "largest   angle" not in said.out


def test_angle_and_covariance_are_measured_at_their_largest(
    compare: Compare, log: list[Message]
) -> None:
    angle = np.radians(2.0)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    pose = log[index(log, Pose)]
    assert isinstance(pose, Pose)
    told = changed(log, Pose, R_WB=pose.R_WB @ turn, covariance=1.5 * pose.covariance)
    said = compare(told)
    assert said.status == DIFFERENT
    assert "POSE in rotation, covariance: 0 m, 2 deg, covariance 0.5 of the variances" in said.out
    assert f"largest   angle 2 deg, at frame {AT + 1}" in said.out
    assert f"largest   covariance 0.5 of the variances, at frame {AT + 1}" in said.out


def test_a_report_that_counts_otherwise_is_told_with_what_the_robot_said(
    compare: Compare, log: list[Message]
) -> None:
    report = log[index(log, Report)]
    assert isinstance(report, Report)
    told = changed(log, Report, used=report.used - 1, gated=1, health=1, reasons=4)
    told.insert(index(told, Report) + 1, Text("something is odd", 1))
    said = compare(told)
    assert said.status == DIFFERENT
    assert f"REPORT used: the desk {report.used}, the robot {report.used - 1}" in said.out
    assert "REPORT gated: the desk 0, the robot 1" in said.out
    assert "health degraded (the gate is locked)" in said.out
    assert "said      something is odd" in said.out
    assert "POSE in" not in said.out


def test_a_refusal_of_the_robot_alone_is_told_as_such(compare: Compare, log: list[Message]) -> None:
    told = without(changed(log, Report, status=-7), Pose)
    said = compare(told)
    assert said.status == DIFFERENT
    assert "REPORT status: the desk 0, the robot -7" in said.out
    assert "the robot refused it: older than the last twist (status -7)" in said.out


def test_a_number_that_is_none_is_infinitely_far(compare: Compare, log: list[Message]) -> None:
    said = compare(changed(log, Pose, p_WB_m=np.full(3, np.nan)))
    assert said.status == DIFFERENT
    assert f"largest   position inf m, at frame {AT + 1}" in said.out


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
    log.append(Text("the recording is not complete: not everything arrived, 39 of 40 TWIST", 1))
    said = compare(log)
    assert said.status == NOT_COMPARABLE, said.out
    assert f"from frame {AT + 1} on the robot may have had other inputs" in said.out
    assert "the robot refused a message: damaged on the way (status -15)" in said.out
    assert f"frame {AT + 2}, t 7.100000000 s, is the first that differs" in said.out


def test_a_twist_that_the_robot_missed_is_found_in_its_last_words(
    compare: Compare, tmp_path: Path
) -> None:
    log, _ = lost_on_the_way(tmp_path, Twist)
    assert compare(log).status == DIFFERENT  # nothing says that one is missing
    words = "the recording is not complete: not everything arrived, 39 of 40 TWIST"
    said = compare([*log, Text(words, 1)])
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
    return [*first, *died, BOOT, half[1], note, second[0], half[0], *second[1:]]


def test_each_life_of_a_robot_is_compared_by_itself(compare: Compare, tmp_path: Path) -> None:
    said = compare(restarted(tmp_path))
    assert said.status == SAME, said.out
    assert "lost" not in said.out
    assert f"part 1 of 2, frames 1 to {AT + 2}\n" in said.out
    assert f"part 2 of 2, frames {AT + 3} to {FRAMES}: the robot started anew" in said.out
    assert f"{FRAMES - 1} of {FRAMES} frames" in said.out


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


# --- what is no such log --------------------------------------------------------------------------


def test_outputs_alone_cannot_be_replayed(compare: Compare, log: list[Message]) -> None:
    outputs = [m for m in log if m.kind in (Kind.CONFIG, Kind.POSE, Kind.REPORT)]
    said = compare(outputs)
    assert said.status == NOT_COMPARABLE
    assert "flight.plr: holds answers but no STEREO, so no inputs to replay" in said.err
    assert "pelorus stream --record" in said.err


def test_inputs_alone_are_no_log(compare: Compare) -> None:
    said = compare(drive())
    assert said.status == NOT_COMPARABLE
    assert "flight.plr: holds no POSE and no REPORT" in said.err


def test_without_a_header_or_the_robots_settings_no_replay_is_the_same_filter(
    compare: Compare, log: list[Message]
) -> None:
    said = compare(log[1:])
    assert said.status == NOT_COMPARABLE
    assert "holds no HEADER frame" in said.err
    said = compare([m for m in log if m.kind != Kind.CONFIG])
    assert said.status == NOT_COMPARABLE
    assert "holds no CONFIG of the robot's build" in said.err


@pytest.mark.parametrize(
    ("content", "what"),
    [(b"", "the file is empty"), (b"%PDF-1.4 not a recording\n" * 50, "this is no .plr recording")],
)
def test_a_foreign_file_is_named(compare: Compare, content: bytes, what: str) -> None:
    said = compare(content)
    assert said.status == NOT_COMPARABLE
    assert said.out == ""
    assert "flight.plr: " in said.err
    assert what in said.err


def test_a_file_that_is_not_there_and_a_folder_without_programs_are_named(
    pelorus: Run, tmp_path: Path
) -> None:
    said = pelorus("compare", tmp_path / "absent.plr", "--bin", BIN)
    assert said.status == NOT_COMPARABLE
    assert "absent.plr: cannot be read" in said.err
    said = pelorus("compare", tmp_path / "absent.plr", "--bin", tmp_path)
    assert said.status == NOT_COMPARABLE
    assert "holds no pelorus-replay" in said.err


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"block_observations": 4}, "takes 4 observations a block and the desk's 8"),
        ({"settings": {4: 5000.0}}, "the robot's slots is 5000, the desk's"),
        ({"settings": {99: 1.0}}, "the robot's setting 99 is 1, the desk's no such setting"),
    ],
)
def test_a_build_that_the_desk_cannot_be_is_told(
    compare: Compare, log: list[Message], change: dict[str, Any], what: str
) -> None:
    at = next(at for at, m in enumerate(log) if isinstance(m, Config))
    settings = log[at]
    assert isinstance(settings, Config)
    log[at] = replace(settings, **change)
    said = compare(log)
    assert said.status == NOT_COMPARABLE
    assert what in said.err


def test_a_recorded_stream_is_compared_frame_by_frame(tmp_path: Path, pelorus: Run) -> None:
    """Its board has no filter: what it answers is not what the desk computes."""
    source, log = tmp_path / "drive.plr", tmp_path / "flight.plr"
    source.write_bytes(encode(drive()))
    with TcpBoard(FakeBoard()) as served:
        assert pelorus("stream", source, "--to", served.target, "--record", log).status == 0
    said = pelorus("compare", log, "--bin", BIN)
    assert said.status == DIFFERENT, said.err
    assert "build 0x0000abcd, of another version: 32 landmarks, 128 observations" in said.out
    assert f"0 of {FRAMES} frames" in said.out


# --- the parts ------------------------------------------------------------------------------------


def test_the_fingerprint_is_the_librarys(log: list[Message]) -> None:
    settings = next(m for m in log if isinstance(m, Config))
    assert fingerprint(__version__, settings) == settings.build_fingerprint
    other = replace(settings, block_observations=4)
    assert fingerprint(__version__, other) != settings.build_fingerprint


def test_every_health_and_reason_has_words() -> None:
    text = (ROOT / "include" / "pelorus" / "types.h").read_text()
    assert text.count("PLR_REASON_") == len(REASONS)
    assert text.count("PLR_HEALTH_") == len(HEALTH)
    assert condition(0, 0) == "good"
    assert (
        condition(2, 3) == "lost (fewer than 3 observations used, none used in the last 10 frames)"
    )
    assert condition(9, 0) == "health 9"
