# SPDX-License-Identifier: MIT
"""`pelorus compare`: a log against the desk. Where something is missing: test_compare_lost.py;
what a board's log compares to is tests/target's.
"""

from __future__ import annotations

import re
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run
from fake_board import FULL, FakeBoard, TcpBoard
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
from pelorus import ARITHMETIC, __version__
from pelorus.flight.judge import fingerprint
from pelorus.robot.stream import condition
from pelorus.wire.frames import NO_BUDGET, Config, Kind, Message, Pose, Report, Stereo, Text, Twist
from pelorus.wire.schema import HEALTHS, REASONS, STATUSES
from replay_drive import BIN, FRAMES, drive, encode, header, known

ROOT = Path(__file__).resolve().parents[2]

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
    assert "was the robot's image built from the desk's?" in said.out


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
    assert "health degraded (the gate rejected most matches in 10 successive frames" in said.out
    assert "said      something is odd" in said.out
    assert "POSE in" not in said.out


def test_a_refusal_of_the_robot_alone_is_told_as_such(compare: Compare, log: list[Message]) -> None:
    told = without(changed(log, Report, status=-7), Pose)
    said = compare(told)
    assert said.status == DIFFERENT
    assert "REPORT status: the desk 0, the robot -7" in said.out
    assert f"the robot refused it: {STATUSES[-7]} (status -7)" in said.out


def test_a_number_that_is_none_is_infinitely_far(compare: Compare, log: list[Message]) -> None:
    said = compare(changed(log, Pose, p_WB_m=np.full(3, np.nan)))
    assert said.status == DIFFERENT
    assert f"largest   position inf m, at frame {AT + 1}" in said.out


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
    said = pelorus("compare", tmp_path / "absent.plr", "--bin", BIN, status=NOT_COMPARABLE)
    assert "absent.plr: cannot be read" in said.err
    said = pelorus("compare", tmp_path / "absent.plr", "--bin", tmp_path, status=NOT_COMPARABLE)
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
        pelorus("stream", source, "--to", served.target, "--record", log)
    said = pelorus("compare", log, "--bin", BIN, status=DIFFERENT)
    assert "build 0x0000abcd, of another version: 32 landmarks, 128 observations" in said.out
    assert f"0 of {FRAMES} frames" in said.out
    assert "a build of another version or arithmetic gives other bits" in said.out


# --- the parts ------------------------------------------------------------------------------------


def test_the_fingerprint_is_the_librarys(log: list[Message]) -> None:
    settings = next(m for m in log if isinstance(m, Config))
    assert fingerprint(__version__, ARITHMETIC, settings) == settings.build_fingerprint
    other = replace(settings, block_observations=4)
    assert fingerprint(__version__, ARITHMETIC, other) != settings.build_fingerprint


def test_every_health_and_reason_has_words() -> None:
    text = (ROOT / "include" / "pelorus" / "types.h").read_text()
    assert len(re.findall(r"PLR_REASON_\w+ = 1 <<", text)) == len(REASONS)
    assert text.count("PLR_HEALTH_") == len(HEALTHS)
    assert condition(0, 0) == "good"
    assert (
        condition(2, 3)
        == "lost (fewer than 3 observations used, no observation used in the last 10 frames)"
    )
    assert condition(9, 0) == "health 9"
