# SPDX-License-Identifier: MIT
"""The firmware on its link: it answers, refuses, and survives whatever a wire can do to it."""

from __future__ import annotations

import random
import time

import pytest
from desk import digest
from pelorus.robot.emulator import Emulator
from pelorus.robot.link import Link
from pelorus.robot.stream import Streamer
from pelorus.wire.frames import Header, Kind, Message, Notice, Pose, Report, Stereo, Text, Twist
from pelorus.wire.framing import Reader, encode
from recordings import first_frames

FRAMES = 24
NOT_READY, MODE = -13, -9  # plr_status
SHORT_S = 1.0  # where no answer can come
HANG_S = 1800.0
QUIET_S = 6.0  # longer than any board's watchdog


@pytest.fixture(scope="module")
def messages(drive: list[Message]) -> list[Message]:
    return first_frames(drive, FRAMES)


def stereo_indices(messages: list[Message]) -> list[int]:
    return [at for at, message in enumerate(messages) if message.kind == Kind.STEREO]


def boots(streamer: Streamer) -> int:
    return streamer.outcome.boots


def answers_to(link: Link, sent: bytes, wanted: Kind | None = None) -> list[Message]:
    """What comes until a REPORT on that kind, or until a TEXT: the boot message ends with one."""
    reader, deadline, answers = Reader(), time.monotonic() + HANG_S, []
    outgoing = sent
    while time.monotonic() < deadline:
        fresh = [got.message for got in reader.feed(link.exchange(outgoing, 0.1))]
        outgoing = b""
        answers += fresh
        if wanted is None and any(isinstance(answer, Text) for answer in answers):
            break
        if any(isinstance(answer, Report) and answer.subject == wanted for answer in fresh):
            break
    return answers


def refusals(answers: list[Message], kind: Kind) -> set[int]:
    return {a.status for a in answers if isinstance(a, Report) and a.subject == kind}


def test_every_frame_is_answered_with_pose_and_report(
    link: Link, messages: list[Message], board: str
) -> None:
    streamer = Streamer(link)
    outcome = streamer.run(messages)
    times = [m.t_ns for m in messages if isinstance(m, Stereo)]
    assert [pose.t_ns for pose in outcome.poses] == times
    assert outcome.reports == {0: FRAMES}
    assert outcome.unanswered == 0
    assert not outcome.refused
    assert streamer.reader.counts.clean
    assert f" on {board}, build 0x" in outcome.texts[0].text


@pytest.mark.spread
def test_the_settings_in_force_come_with_the_build(link: Link, messages: list[Message]) -> None:
    config = Streamer(link).run(messages).config
    assert config is not None
    assert config.build_fingerprint != 0
    assert (config.max_landmarks, config.block_observations, config.real_bytes) == (32, 8, 4)
    assert config.settings[4] == 32  # slots


def test_garbage_between_frames_changes_no_bit(link: Link, messages: list[Message]) -> None:
    clean = digest(Streamer(link).run(messages).poses)
    noise = random.Random(1)
    streamer = Streamer(link)
    streamer.greet()
    for message in messages:
        link.exchange(noise.randbytes(noise.randrange(200)) + b"\0")
        streamer.send(message)
    streamer.finish()
    assert digest(streamer.outcome.poses) == clean
    assert boots(streamer) <= 1


@pytest.mark.spread
def test_garbage_into_a_frame_costs_that_frame_alone(link: Link, messages: list[Message]) -> None:
    hit = stereo_indices(messages)[10]
    streamer = Streamer(link)
    streamer.greet()
    for at, message in enumerate(messages):
        if at == hit:
            link.exchange(b"\x42 torn off in the middle of")
        streamer.answer_s = SHORT_S if at == hit else HANG_S
        streamer.send(message)
    streamer.finish()
    assert streamer.outcome.unanswered == 1
    assert len(streamer.outcome.poses) == FRAMES - 1
    assert streamer.outcome.restarts == 0


def test_random_bytes_neither_stop_nor_reset_it(link: Link, messages: list[Message]) -> None:
    noise = random.Random(2)
    for _ in range(24):
        link.exchange(noise.randbytes(1024))
    streamer = Streamer(link)
    outcome = streamer.run(messages)
    assert len(outcome.poses) == FRAMES
    assert boots(streamer) <= 1


def test_a_cut_in_mid_frame_and_a_new_host_start_a_clean_drive(
    emulator: Emulator, messages: list[Message]
) -> None:
    link = emulator.connect()
    clean = digest(Streamer(link).run(messages).poses)
    dying = Streamer(link)
    dying.greet()
    for message in first_frames(messages, 15):
        dying.send(message)
    link.exchange(encode(messages[-1], 0)[:50])
    link.close()
    link = emulator.connect()
    again = Streamer(link)
    assert digest(again.run(messages).poses) == clean
    assert boots(again) == 0
    link.close()


def test_a_reset_of_the_board_costs_one_frame_and_keeps_the_pose(
    emulator: Emulator, link: Link, messages: list[Message]
) -> None:
    streamer = Streamer(link)  # that a board announces itself ends the wait for the old one
    streamer.greet()
    pressed = stereo_indices(messages)[20]
    for at, message in enumerate(messages):
        if at == pressed:
            emulator.reset()
        streamer.send(message)
    streamer.finish()
    outcome = streamer.outcome
    assert outcome.restarts == 1
    assert outcome.unanswered <= 1
    assert len(outcome.poses) >= FRAMES - 2
    step = outcome.poses[21].p_WB_m - outcome.poses[19].p_WB_m
    assert (step @ step) ** 0.5 < 5.0  # it went on from there, and did not start at the origin


def test_a_host_that_does_not_read_for_a_while_deadlocks_nothing(
    link: Link, messages: list[Message]
) -> None:
    """Everything at once, ignoring the rule of the flow control; then as it should be."""
    flood = b"".join(encode(message, number) for number, message in enumerate(messages * 3))
    link.exchange(flood)
    streamer = Streamer(link)
    assert len(streamer.run(messages).poses) == FRAMES


@pytest.mark.spread
def test_data_before_a_header_is_refused(link: Link, messages: list[Message]) -> None:
    boot = answers_to(link, b"")
    assert [message.__class__ for message in boot] == [Report, Text]
    assert isinstance(boot[0], Report)
    assert boot[0].notice == Notice.STARTED
    stereo = messages[stereo_indices(messages)[0]]
    twist = next(message for message in messages if isinstance(message, Twist))
    answers = answers_to(link, b"\0" + encode(twist, 0) + encode(stereo, 1), Kind.STEREO)
    assert refusals(answers, Kind.TWIST) == {NOT_READY}
    assert refusals(answers, Kind.STEREO) == {NOT_READY}


@pytest.mark.spread
def test_a_calibration_that_changes_in_mid_flight_is_refused(
    link: Link, messages: list[Message]
) -> None:
    streamer = Streamer(link)
    streamer.greet()
    for message in messages:
        streamer.send(message)
    header = next(message for message in messages if isinstance(message, Header))
    other = Header(header.camera, body_axes=header.body_axes, t_CB_m=header.t_CB_m + 1.0)
    assert refusals(answers_to(link, encode(other, 0), Kind.HEADER), Kind.HEADER) == {MODE}


@pytest.mark.spread
def test_an_overlong_frame_is_refused_and_the_next_one_taken(
    link: Link, messages: list[Message]
) -> None:
    streamer = Streamer(link)
    streamer.greet()
    for message in messages[:-1]:
        streamer.send(message)
    stereo = messages[-1]
    assert isinstance(stereo, Stereo)
    count = 2000
    overlong = Stereo(
        stereo.t_ns, stereo.ids.repeat(count)[:count], stereo.pixels.repeat(count, 0)[:count]
    )
    answers = answers_to(link, encode(overlong, 1), Kind.STEREO)
    assert refusals(answers, Kind.STEREO) != set()
    assert not any(isinstance(answer, Pose) for answer in answers)
    assert any(isinstance(a, Pose) for a in answers_to(link, encode(stereo, 2), Kind.STEREO))


def test_the_watchdog_is_fed_while_nothing_arrives(link: Link, messages: list[Message]) -> None:
    assert [message.kind for message in answers_to(link, b"")] == [Kind.REPORT, Kind.TEXT]  # boot
    assert link.exchange(b"", QUIET_S) == b""  # and no second one
    streamer = Streamer(link)
    assert len(streamer.run(messages).poses) == FRAMES
    assert boots(streamer) == 0
