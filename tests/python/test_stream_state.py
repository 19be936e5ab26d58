# SPDX-License-Identifier: MIT
"""`pelorus stream --save-state` and `--restore-state`, to a board that is none. What a real one
keeps is tests/target's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from fake_board import FakeBoard, TcpBoard
from pelorus.errors import PelorusError
from pelorus.robot import stream
from pelorus.robot.stream import restored, saved
from pelorus.wire.frames import Config, Kind, Message, Report, Start, State, StateAction, Text
from pelorus.wire.schema import STATUSES
from replay_drive import FRAMES, drive, encode, known, log_of, t_ns

CORRUPT, FOREIGN = -15, -16  # plr_status


@dataclass
class KeepingBoard(FakeBoard):
    """One that answers STATE."""

    status: int = 0
    words: str = "state saved: generation 3"
    answers_state: bool = True

    def _answer(self, message: Message) -> list[Message]:
        if not isinstance(message, State):
            return super()._answer(message)
        if not self.answers_state:
            return []
        words: list[Message] = [Text(self.words, int(self.status != 0))] if self.words else []
        return [*words, Report(message.t_ns, Kind.STATE, self.status)]

    def states(self) -> list[State]:
        return [message for message in self.heard if isinstance(message, State)]


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "drive.plr"
    messages = drive()
    messages[1:1] = [Config({4: 8.0}), *known()[:3], Start(t_ns(0))]
    path.write_bytes(encode(messages))
    return path


# --- where it stands in the drive -----------------------------------------------------------------


def test_a_save_goes_behind_the_data_and_before_the_end(recording: Path, pelorus: Run) -> None:
    board = KeepingBoard()
    with TcpBoard(board) as served:
        said = pelorus("stream", recording, "--to", served.target, "--save-state")
    assert "state saved: generation 3" in said.out
    assert [message.kind for message in board.heard[-2:]] == [Kind.STATE, Kind.END]
    assert board.states() == [State(t_ns(FRAMES - 1), StateAction.SAVE)]
    assert "refused" not in said.out


def test_a_restore_takes_the_place_of_the_start(recording: Path, pelorus: Run) -> None:
    board = KeepingBoard(words="state restored: generation 3")
    with TcpBoard(board) as served:
        pelorus("stream", recording, "--to", served.target, "--restore-state")
    kinds = [message.kind for message in board.heard if message.kind != Kind.END]
    assert kinds[:7] == [
        *(Kind.HEADER, Kind.CONFIG, Kind.LANDMARK, Kind.LANDMARK, Kind.LANDMARK),
        *(Kind.STATE, Kind.TWIST),
    ]
    assert Kind.START not in kinds
    assert board.states() == [State(t_ns(0), StateAction.RESTORE)]


def test_how_far_it_may_have_moved_goes_along_as_variances(recording: Path, pelorus: Run) -> None:
    board = KeepingBoard()
    with TcpBoard(board) as served:
        asked = ("--restore-state", "--moved", "0.5", "0.1")
        pelorus("stream", recording, "--to", served.target, *asked)
    expected = [0.25, 0.25, 0.25, 0.01, 0.01, 0.01]
    assert np.allclose(board.states()[0].moved_variance, expected, rtol=1e-12)


def test_a_start_among_the_data_stays() -> None:
    messages = drive()
    messages[40:40] = [Start(t_ns(13))]
    assert [m.kind for m in restored(messages)].count(Kind.START) == 1


def test_the_log_has_question_and_answer_behind_the_settings(
    recording: Path, tmp_path: Path, pelorus: Run
) -> None:
    log = tmp_path / "flight.plr"
    with TcpBoard(KeepingBoard()) as served:
        asked = ("--save-state", "--record", log)
        pelorus("stream", recording, "--to", served.target, *asked)
    kinds = [message.kind for message in log_of(log)]
    assert kinds[-4:] == [Kind.STATE, Kind.TEXT, Kind.REPORT, Kind.END]
    assert "STATE" in pelorus("info", log).out


# --- what goes wrong ------------------------------------------------------------------------------


def test_a_save_that_fails_is_an_error_with_the_boards_words(recording: Path, pelorus: Run) -> None:
    board = KeepingBoard(status=-17, words="state not saved: the storage reports a failure")
    with TcpBoard(board) as served:
        said = pelorus("stream", recording, "--to", served.target, "--save-state", status=1)
    assert "state not saved: the storage reports a failure" in said.err
    assert f"{FRAMES} answered with a pose" in " ".join(said.out.split())


def test_a_restore_that_fails_ends_the_drive_before_it_begins(
    recording: Path, pelorus: Run
) -> None:
    board = KeepingBoard(
        status=CORRUPT, words="state not restored: damaged: bytes fail their check"
    )
    with TcpBoard(board) as served:
        said = pelorus("stream", recording, "--to", served.target, "--restore-state", status=1)
    assert "state not restored: damaged: bytes fail their check" in said.err
    assert not any(message.kind == Kind.TWIST for message in board.heard)


def test_a_board_that_knows_no_state_is_told_from_its_refusal(
    recording: Path, pelorus: Run
) -> None:
    with TcpBoard(KeepingBoard(status=FOREIGN, words="")) as served:
        said = pelorus("stream", recording, "--to", served.target, "--restore-state", status=1)
    assert f"STATE: {STATUSES[FOREIGN]}" in said.err


def test_a_board_that_does_not_answer_is_not_waited_for_for_ever(
    recording: Path, pelorus: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream, "STATE_S", 0.2)
    with TcpBoard(KeepingBoard(answers_state=False)) as served:
        asked = ("--save-state", "--answer", "0.2")
        said = pelorus("stream", recording, "--to", served.target, *asked, status=1)
    assert "did not answer when asked about its state" in said.err


def test_options_that_contradict_each_other_are_refused(recording: Path, pelorus: Run) -> None:
    for words, wrong in (
        (("--restore-state", "--compare"), "leave --restore-state out"),
        (("--moved", "1", "1"), "it needs --restore-state"),
    ):
        said = pelorus("stream", recording, "--to", "tcp:127.0.0.1:1", *words, status=1)
        assert wrong in " ".join(said.err.split())


def test_a_recording_without_data_has_no_state() -> None:
    for change in (restored, saved):
        with pytest.raises(PelorusError, match="holds no data"):
            change(drive()[:1])
