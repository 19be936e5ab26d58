# SPDX-License-Identifier: MIT
"""A state that outlives a reset: a drive is cut, and goes on with the bits of one that was not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from desk import digest
from pelorus.errors import PelorusError
from pelorus.robot.emulator import Emulator
from pelorus.robot.link import Link
from pelorus.robot.stream import Streamer, StreamResult, restored, saved
from pelorus.wire.frames import Header, Kind, Message, Pose, Start, State, StateAction, Stereo
from recordings import first_frames

FRAMES, CUT, LOST = 30, 12, 5  # LOST frames come between the save and the reset
NOT_READY, CORRUPT, FOREIGN, IO = -13, -15, -16, -17  # plr_status
RETAINED = {"mps2_an386": 0x203C0000, "mps2_an500": 0x203C0000, "mps3_an547": 0x20040000}
SLOT = 128 * 1024  # half of the region
INTO_THE_STATE = 100
WITHOUT_FLASH = "stm32f405"  # QEMU does not model its controller
KEEPS = pytest.mark.boards(*RETAINED)


@pytest.fixture(scope="module")
def messages(drive: list[Message]) -> list[Message]:
    return first_frames(drive, FRAMES)


def rest_of(messages: list[Message], frames: int) -> list[Message]:
    """HEADER and CONFIG, and what comes after so many frames."""
    setup = [m for m in messages if m.kind in (Kind.HEADER, Kind.CONFIG)]
    return setup + messages[len(first_frames(messages, frames)) :]


def saved_and_reset(emulator: Emulator, link: Link, messages: list[Message]) -> list[Pose]:
    """Drive, save, drive on, and press the reset button; the poses up to the save."""
    streamer = Streamer(link)
    streamer.greet()
    for message in saved(first_frames(messages, CUT)):
        streamer.send(message)
    assert [answer.status for answer in streamer.outcome.states] == [0]
    kept = list(streamer.outcome.poses)
    for message in rest_of(messages, CUT)[1 : 1 + LOST * len(messages) // FRAMES]:
        streamer.send(message)
    assert len(streamer.outcome.poses) > CUT
    emulator.reset()
    return kept


def told(outcome: StreamResult) -> str:
    return " | ".join(text.text for text in outcome.texts)


# --- boards that keep it --------------------------------------------------------------------------


@KEEPS
def test_a_drive_that_was_cut_goes_on_with_the_bits_of_one_that_was_not(
    emulator: Emulator, link: Link, messages: list[Message]
) -> None:
    whole = Streamer(link).run(messages)
    kept = saved_and_reset(emulator, link, messages)
    after = Streamer(link).run(restored(rest_of(messages, CUT)))
    assert after.boots >= 1
    assert "state restored: generation 1, " in told(after)
    assert not after.refused
    assert len(kept + after.poses) == FRAMES
    assert digest(kept + after.poses) == digest(whole.poses)


@pytest.mark.spread
@KEEPS
def test_each_reset_finds_the_newest_state(
    emulator: Emulator, link: Link, messages: list[Message]
) -> None:
    whole = Streamer(link).run(messages)
    poses = saved_and_reset(emulator, link, messages)
    for frames in (CUT + 6, CUT + 12):
        part = first_frames(rest_of(messages, frames - 6), 6)
        outcome = Streamer(link).run(saved(restored(part)))
        assert [answer.status for answer in outcome.states] == [0, 0]
        poses += outcome.poses
        emulator.reset()
    assert digest(poses) == digest(whole.poses[: CUT + 12])


@pytest.mark.spread
@KEEPS
def test_what_may_have_moved_meanwhile_widens_the_covariance(
    emulator: Emulator, link: Link, messages: list[Message]
) -> None:
    kept = saved_and_reset(emulator, link, messages)
    rest = first_frames(rest_of(messages, CUT), 1)
    after = Streamer(link).run(restored(rest, moved=(1.0, 0.1)))
    stood = kept[-1].covariance[0]
    assert after.poses[0].covariance[0] > stood


@pytest.mark.spread
@KEEPS
def test_without_a_restore_the_drive_begins_as_ever(
    emulator: Emulator, link: Link, messages: list[Message]
) -> None:
    whole = Streamer(link).run(messages)
    saved_and_reset(emulator, link, messages)
    assert digest(Streamer(link).run(messages).poses) == digest(whole.poses)


@pytest.mark.spread
@KEEPS
def test_another_calibration_is_refused_and_a_start_taken(
    emulator: Emulator, link: Link, messages: list[Message]
) -> None:
    saved_and_reset(emulator, link, messages)
    header = next(message for message in messages if isinstance(message, Header))
    other = replace(header, t_CB_m=header.t_CB_m + 0.1)
    rest = [other, *rest_of(messages, CUT)[1:]]
    streamer = Streamer(link)
    with pytest.raises(PelorusError, match=r"state not restored: .* one calibration"):
        streamer.run(restored(rest))
    assert [answer.status for answer in streamer.outcome.states] == [FOREIGN]
    first = next(message for message in rest if isinstance(message, Stereo))
    for message in (Start(first.t_ns, p_WB_m=np.array([7.0, 0, 0])), first):
        streamer.send(message)
    assert streamer.outcome.poses[-1].p_WB_m[0] == pytest.approx(7.0, abs=0.01)


@pytest.mark.spread
@KEEPS
def test_a_damaged_state_is_refused_and_the_one_before_it_taken(
    board: str, firmware: Path, messages: list[Message]
) -> None:
    """QEMU's loader puts four bytes into the slot at every reset."""
    for slot, saves, status in ((0, 1, CORRUPT), (1, 2, 0)):
        address = RETAINED[board] + slot * SLOT + INTO_THE_STATE
        damage = ("-device", f"loader,addr={address:#x},data=0xdeadbeef,data-len=4")
        with Emulator(board, firmware, damage) as emulator:
            link = emulator.connect()
            for _ in range(saves):
                outcome = Streamer(link).run(saved(first_frames(messages, CUT)))
                assert [answer.status for answer in outcome.states] == [0]
            emulator.reset()
            streamer = Streamer(link)
            if status == CORRUPT:
                with pytest.raises(PelorusError, match="state not restored: "):
                    streamer.run(restored(rest_of(messages, CUT)))
            else:
                outcome = streamer.run(restored(rest_of(messages, CUT)))
                assert "generation 1, " in told(outcome)
                assert "the other slot holds a damaged one" in told(outcome)
            assert [answer.status for answer in streamer.outcome.states] == [status]
            link.close()


# --- every board ----------------------------------------------------------------------------------


@pytest.mark.spread
def test_after_power_on_there_is_nothing_to_restore(link: Link, messages: list[Message]) -> None:
    streamer = Streamer(link)
    with pytest.raises(PelorusError, match="state not restored: nothing was ever saved"):
        streamer.run(restored(messages))
    assert [answer.status for answer in streamer.outcome.states] == [NOT_READY]
    whole = Streamer(link).run(messages)  # and the board is as good as before
    assert len(whole.poses) == FRAMES


def test_a_save_changes_no_bit_of_the_drive(
    board: str, link: Link, messages: list[Message]
) -> None:
    """On a board whose flash controller is not there it fails in bounded time, and says so."""
    whole = Streamer(link).run(messages)
    asked: list[Message] = []
    for message in messages:
        asked.append(message)
        if isinstance(message, Stereo):
            asked.append(State(message.t_ns, StateAction.SAVE))
    outcome = Streamer(link).run(asked)
    status = IO if board == WITHOUT_FLASH else 0
    assert [answer.status for answer in outcome.states] == [status] * FRAMES
    assert [answer.t_ns for answer in outcome.states] == [pose.t_ns for pose in outcome.poses]
    assert digest(outcome.poses) == digest(whole.poses)
    assert outcome.restarts == 0
    assert outcome.boots <= 1  # that of its start
    if status == IO:
        assert "state not saved: " in told(outcome)
