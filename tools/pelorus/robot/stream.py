# SPDX-License-Identifier: MIT
"""Sends a recording to a board, frame by frame, and records both sides.

The rule of docs/PORTING.md, "Flow control": after each STEREO and each STATE the sender waits for
the REPORT that answers it, or for a time-out; it never waits without reading. A board that restarts
says so in a REPORT; it is then given HEADER, settings and its own last pose, and the drive goes on.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import BinaryIO

import numpy as np

from pelorus.errors import PelorusError
from pelorus.robot.link import Link
from pelorus.wire.frames import (
    Config,
    End,
    Header,
    Imu,
    Kind,
    Landmark,
    Message,
    Notice,
    Pose,
    Process,
    Reading,
    Report,
    Start,
    StartFlag,
    State,
    StateAction,
    Stereo,
    Text,
    Truth,
    Twist,
)
from pelorus.wire.framing import DELIMITER, Counts, Reader, Writer, encode, end_of
from pelorus.wire.schema import HEALTHS, REASONS, STATUSES
from pelorus.wire.settings import IDS

SETUP_KINDS = (Kind.HEADER, Kind.CONFIG, Kind.LANDMARK, Kind.START)


class FlightLog:
    """Records what host and board said to each other, in that order, for a replay.

    A board sends its settings in answer to the first data, and a replay must have them before: so
    the first data are held back until they come. Every message is handed to the system at once, so
    that a log that is cut short is complete up to there.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._writer = Writer(stream)
        self._held: list[Message] = []
        self._settled = False  # the settings are in the log, or will not come

    def keep(self, message: Message, heard: bool = False) -> None:
        """Adds a message that was sent, or received from the board: CONFIG has the settings."""
        if heard and isinstance(message, Config) and message.build_fingerprint:
            self._write(message)
            self.release()
        elif self._settled or (message.kind in SETUP_KINDS and not self._held):
            self._write(message)
        else:
            self._held.append(message)
            if isinstance(message, Report) and message.subject == Kind.STEREO:
                self.release()  # a frame was answered, without settings before

    def release(self) -> None:
        """Writes what is held back; from then on nothing is."""
        self._settled = True
        held, self._held = self._held, []
        for message in held:
            self._write(message)

    def end(self, heard: End | None = None) -> None:
        """Closes the recording with END; `heard` is the board's."""
        self.release()
        try:
            self._writer.end(heard)
            self._stream.flush()
        except OSError as error:
            raise self._trouble(error) from error

    def _write(self, message: Message) -> None:
        try:
            self._writer.write(message)
            self._stream.flush()
        except OSError as error:
            raise self._trouble(error) from error

    def _trouble(self, error: OSError) -> PelorusError:
        name = getattr(self._stream, "name", "the log")
        return PelorusError(f"{name}: cannot be written: {error.strerror}; the log ends there")


def condition(health: int, reasons: int) -> str:
    """Returns `plr_health` with its `plr_reason`: "degraded (the gate is locked)"."""
    words = [text for reason, text in REASONS.items() if reasons & reason]
    name = HEALTHS.get(health, f"health {health}")
    return f"{name} ({', '.join(words)})" if words else name


def refusal(subject: int, status: int, count: int) -> str:
    """Returns one line of a summary of refusals."""
    known = subject in list(Kind)
    what = Kind(subject).name if known else f"kind {subject}"
    if subject == 0:
        what = "frames"
    why = STATUSES.get(status, "no status of this version")
    return f"{count} {what}: {why} (status {status})"


ANSWER_S = 5.0  # a slow emulated board on a busy machine takes tenths
QUIET_S = 0.3
GREETING_S = 3.0  # a board may be busy
WARNING, ERROR = 1, 2  # severity of a TEXT
END_AGAIN_S = 1.0
STATE_S = 15.0  # a save takes as long as the flash: seconds
UNANSWERED_MAX = 5  # in a row: then no board is there
WINDOW_BYTES = 2048  # half of the board's receive ring


@dataclass
class StreamResult:
    """The result of a stream."""

    poses: list[Pose] = field(default_factory=list)  # one a frame
    reports: Counter[int] = field(default_factory=Counter)  # of STEREO, by status
    refused: Counter[tuple[int, int]] = field(
        default_factory=Counter
    )  # (subject, status) of others
    config: Config | None = None  # settings in force
    texts: list[Text] = field(default_factory=list)
    frames: int = 0  # STEREO sent
    unanswered: int = 0
    boots: int = 0  # times that the board reported a start
    restarts: int = 0  # those during the drive
    worst_update_us: int = 0
    states: list[Report] = field(default_factory=list)  # the answers to STATE
    state_trouble: str = ""  # why the last STATE failed


class Streamer:
    """Sends one drive over one link."""

    def __init__(
        self,
        link: Link,
        log: BinaryIO | None = None,
        on_pose: Callable[[Pose], None] = lambda _: None,
        answer_s: float | None = None,
        on_message: Callable[[Message], None] = lambda _: None,
    ) -> None:
        """Takes a link; `on_message` gets all that the log gets, in the same order."""
        self.outcome = StreamResult()
        self.reader = Reader()
        self._link = link
        self._log = None if log is None else FlightLog(log)
        self._on_pose = on_pose
        self._on_message = on_message
        self.answer_s = ANSWER_S if answer_s is None else answer_s
        self._sequence = 0
        self._sent: Counter[Kind] = Counter()
        self._setup: list[Message] = []
        self._unread_bytes = 0
        self._awaited: int | None = None  # time of the STEREO whose answer is awaited
        self._unanswered_in_a_row = 0
        self._end_heard: End | None = None  # the board's
        self._under_way = False
        self._board_is_new = False  # it reported a start, and has not been set up yet

    def run(self, messages: Iterable[Message]) -> StreamResult:
        """Sends everything; END goes last, whether it is among the messages or not."""
        try:
            self.greet()
            for message in messages:
                if message.kind == Kind.END:
                    continue
                if message.kind in (Kind.POSE, Kind.REPORT, Kind.TEXT):
                    continue  # another filter's answers, in a log
                self.send(message)
            self.finish()
        finally:
            if self._log is not None:
                self._log.release()
        return self.outcome

    def greet(self) -> None:
        """Ends whatever the board was doing, and lets it finish sending.

        END is answered with END. It is repeated while no answer comes: what arrives while a board
        boots is lost.
        """
        deadline = time.monotonic() + self.answer_s
        while self._end_heard is None and time.monotonic() < deadline:
            self._exchange(DELIMITER + encode(End(0, 0, 0, 0, 0), 0), 0.0)
            self._wait(
                lambda: self._end_heard is not None, min(END_AGAIN_S, deadline - time.monotonic())
            )
        self._await_quiet()
        self.outcome = StreamResult(texts=self.outcome.texts, boots=self.outcome.boots)
        self.reader.counts = Counts()  # of this drive alone
        self._sequence = 1
        self._end_heard = None
        self._under_way = True

    def _await_quiet(self) -> None:
        """Waits until the board has finished sending; a line that is never quiet is no board's."""
        patience_s = max(GREETING_S, self.answer_s)
        deadline = time.monotonic() + patience_s
        while self._exchange(b"", QUIET_S):
            if time.monotonic() >= deadline:
                raise PelorusError(
                    f"{self._link.what}: does not stop talking, for {patience_s:g} s; "
                    "is it a board with the firmware, at this baud rate?"
                )

    def _wait(self, done: Callable[[], bool], patience_s: float) -> None:
        """Receives until it is done or the time is up."""
        deadline = time.monotonic() + patience_s
        while not done() and (left := deadline - time.monotonic()) > 0:
            self._exchange(b"", left)

    def send(self, message: Message) -> None:
        """Sends one message; for a STEREO or a STATE, waits for the answer."""
        if self._board_is_new:
            self._start_over()
        if (message.kind in SETUP_KINDS or is_restore(message)) and not self.outcome.frames:
            self._setup.append(message)
        self._awaited = message.t_ns if isinstance(message, Stereo) else None
        self._put(message)
        if isinstance(message, Stereo):
            self.outcome.frames += 1
            self._await_answer(message.t_ns)
        elif isinstance(message, State):
            self._await_state(message)
        elif self._unread_bytes > WINDOW_BYTES:
            self._link_pause()

    def finish(self) -> None:
        """Sends END, and waits for the board's."""
        self._put(end_of(self._sent), logged=False)
        self._wait(lambda: self._end_heard is not None, self.answer_s)
        if self._log is not None:
            self._log.end(self._end_heard)

    def _put(self, message: Message, logged: bool = True) -> None:
        if logged:
            self._keep(message)
        frame = encode(message, self._sequence)
        self._sequence += 1
        self._sent[message.kind] += 1
        self._unread_bytes += len(frame)
        self._exchange(frame, 0.0)

    def _link_pause(self) -> None:
        """Gives a board time for messages without an answer, like many twists without a frame."""
        self._exchange(b"", 0.01)
        self._unread_bytes = 0

    def _await_answer(self, t_ns: int) -> None:
        self._wait(lambda: self._awaited is None or self._board_is_new, self.answer_s)
        if self._awaited is None:
            self._unread_bytes = 0
            self._unanswered_in_a_row = 0
            return
        self._note(f"no answer to the frame of {t_ns} ns: it, or the answer, was lost")
        self.outcome.unanswered += 1
        self._unanswered_in_a_row += 1
        if self._unanswered_in_a_row >= UNANSWERED_MAX:
            faults = [text.text for text in self.outcome.texts if text.severity == ERROR]
            raise PelorusError(
                f"{self._link.what}: {UNANSWERED_MAX} frames in a row without an answer; "
                + (
                    f"the board said: {faults[-1]}"
                    if faults
                    else "is the board running the firmware, at this baud rate?"
                )
            )

    def _await_state(self, state: State) -> None:
        """Waits for a STATE: a board that saves takes nothing, and what is sent meanwhile may be
        lost.

        Without the state from which it should continue the drive would be another one: it ends
        there.
        """
        answers, words = len(self.outcome.states), len(self.outcome.texts)
        patience_s = max(STATE_S, self.answer_s)
        self._wait(lambda: len(self.outcome.states) > answers or self._board_is_new, patience_s)
        self._unread_bytes = 0
        if len(self.outcome.states) > answers:
            self.outcome.state_trouble = self._why_not(self.outcome.states[-1], words)
        else:
            self.outcome.state_trouble = "the board did not answer when asked about its state"
            self._note(self.outcome.state_trouble)
        if self.outcome.state_trouble and is_restore(state):
            raise PelorusError(self.outcome.state_trouble)

    def _why_not(self, answer: Report, words_before: int) -> str:
        """Returns the board's own words since the request; empty if all is well."""
        if answer.status == 0:
            return ""
        words = [text.text for text in self.outcome.texts[words_before:] if text.severity]
        return words[-1] if words else refusal(Kind.STATE, answer.status, 1)

    def _exchange(self, outgoing: bytes, wait_s: float) -> bool:
        """Sends and receives; returns whether anything came."""
        came = False
        for piece in self._link.pieces(outgoing, wait_s, self.answer_s):
            came = True
            for received in list(self.reader.feed(piece)):
                self._take(received.message)
        return came

    def _take(self, message: Message) -> None:
        if self._under_way and message.kind != Kind.END:
            self._keep(message, heard=True)
        match message:
            case Pose() if message.after_stereo:
                self.outcome.poses.append(message)
                self._on_pose(message)
            case Report():
                self._take_report(message)
            case Config():
                self.outcome.config = message
            case Text():
                self.outcome.texts.append(message)
            case End():
                self._end_heard = message
            case _:
                pass  # landmarks: they are in the log

    def _take_report(self, report: Report) -> None:
        if report.notice == Notice.STARTED:
            self.outcome.boots += 1
            self._board_is_new = self._under_way
        if report.subject == Kind.STATE:
            self.outcome.states.append(report)
        if report.subject != Kind.STEREO:
            if report.status == 0:
                return
            self.outcome.refused[report.subject, report.status] += 1
            return
        self.outcome.reports[report.status] += 1
        self.outcome.worst_update_us = max(self.outcome.worst_update_us, report.update_us)
        if report.t_ns == self._awaited or (report.status and not report.t_ns):
            self._awaited = None  # a frame too long for the board is refused unread, without a time

    def _start_over(self) -> None:
        """Sets a board that lost its state up again, with its own last pose."""
        self._note("the board started anew: it is given its set-up again, and its last pose")
        self._board_is_new = False
        self.outcome.restarts += 1
        for message in self._setup:
            if isinstance(message, Header | Config | Landmark) or not self.outcome.poses:
                self._put(message)
            if isinstance(message, State) and not self.outcome.poses:
                self._await_state(message)
        if self.outcome.poses:
            self._put(start_from(self.outcome.poses[-1], self._is_inertial()))

    def _is_inertial(self) -> bool:
        """Returns whether an IMU moves the board, by its settings in force."""
        config = self.outcome.config
        return config is not None and config.settings.get(IDS["process"]) == Process.IMU

    def _note(self, remark: str) -> None:
        """Adds the host's own remark to the log."""
        self._keep(Text(remark, WARNING))

    def _keep(self, message: Message, heard: bool = False) -> None:
        if self._log is not None:
            self._log.keep(message, heard)
        self._on_message(message)


def is_restore(message: Message) -> bool:
    """Returns whether a drive begins with this message as with a START."""
    return isinstance(message, State) and message.action == StateAction.RESTORE


def start_from(pose: Pose, inertial: bool = False) -> Start:
    """Returns a START that continues from a pose; with an IMU also from its velocity and biases."""
    start = Start(
        t_ns=pose.t_ns,
        R_WB=np.asarray(pose.R_WB),
        p_WB_m=np.asarray(pose.p_WB_m),
        flags=StartFlag.COVARIANCE,
        covariance=np.asarray(pose.covariance),
    )
    if not inertial or (pose.bias_variance <= 0).any():
        return start
    return replace(
        start,
        flags=StartFlag.COVARIANCE | StartFlag.BIAS_PRIOR,
        bias_mean=np.asarray(pose.bias),
        bias_variance=np.asarray(pose.bias_variance),
        velocity=np.asarray(pose.v_B_mps),
        velocity_variance=np.asarray(pose.velocity_covariance)[[0, 2, 5]],
    )


# --- a kept state ---------------------------------------------------------------------------------


def restored(messages: list[Message], moved: tuple[float, float] = (0.0, 0.0)) -> list[Message]:
    """Returns the drive with a restore right before its data, instead of its START.

    `moved` is how far the robot may have moved since it was saved: sigmas in m and rad.
    """
    first, t_ns = _data(messages)[0]
    setup = [message for message in messages[:first] if message.kind != Kind.START]
    state = State(t_ns, StateAction.RESTORE, np.repeat(np.square(moved), 3))
    return [*setup, state, *messages[first:]]


def saved(messages: list[Message]) -> list[Message]:
    """Returns the drive with a save after its data."""
    last, t_ns = _data(messages)[-1]
    return [*messages[: last + 1], State(t_ns, StateAction.SAVE), *messages[last + 1 :]]


def _data(messages: list[Message]) -> list[tuple[int, int]]:
    """Returns the indices of the data, and their times."""
    data = Twist | Imu | Reading | Truth | Stereo
    found = [(at, message.t_ns) for at, message in enumerate(messages) if isinstance(message, data)]
    if not found:
        raise PelorusError("the recording holds no data, so there is no state to save or restore")
    return found
