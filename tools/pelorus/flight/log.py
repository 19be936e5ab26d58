# SPDX-License-Identifier: MIT
"""Reads a robot's log: frames with their answers, and known losses.

A log is read as parts. A board that restarts forgets everything but what it is then given, so each
of its lives is a drive of its own, from its HEADER to the next REPORT of a restart.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from pelorus.errors import PelorusError
from pelorus.robot.stream import is_restore
from pelorus.wire.frames import (
    Config,
    End,
    Header,
    Kind,
    Landmark,
    Message,
    Notice,
    Pose,
    Report,
    Role,
    State,
    StateAction,
    Stereo,
    Text,
)
from pelorus.wire.framing import SEQUENCE_MODULUS, Received, header_of, read_file
from pelorus.wire.message import DATA_KINDS
from pelorus.wire.schema import STATUSES, number
from pelorus.wire.settings import IDS, mode_in_force

# Statuses of data that were damaged on the way.
NOT_ARRIVED = tuple(number("status", name) for name in ("ARGUMENT", "CORRUPT", "FOREIGN"))
FULL = number("status", "FULL")
RIGHT = "`pelorus stream --record` and `pelorus-replay --out` write what a replay needs"


@dataclass(eq=False)
class Frame:
    """A STEREO with the filter's answer to it."""

    number: int  # in the log, from 1
    stereo: Stereo
    pose: Pose | None = None
    report: Report | None = None
    words: list[str] = field(default_factory=list)  # TEXT from it to the next frame

    @property
    def answered(self) -> bool:
        return self.pose is not None or self.report is not None

    @property
    def unread(self) -> bool:
        """Returns whether it had more observations than the robot takes, and was refused."""
        return self.report is not None and not self.report.t_ns and self.report.status == FULL

    def within_budget(self) -> Stereo:
        """Returns it as the robot took it: a time budget may have allowed fewer observations."""
        if self.report is None or self.report.budget >= self.stereo.budget:
            return self.stereo
        return replace(self.stereo, budget=self.report.budget)


NOWHERE = 0  # of a loss at an unknown place


class Loss(NamedTuple):
    """Data that the robot or the log did not receive."""

    at: int  # number of the first frame that it may have affected, or NOWHERE
    words: str


@dataclass(eq=False)
class Part:
    """The inputs and answers of one life of a filter."""

    messages: list[Message]
    frames: list[Frame]
    losses: list[Loss]
    config: Config | None  # in force
    restored: bool  # it continued from a state that the log lacks

    @property
    def answered(self) -> list[Frame]:
        return [frame for frame in self.frames if frame.answered]

    @property
    def unanswered(self) -> list[Frame]:
        """Returns the frames without an answer that precede an answered one."""
        last = max((frame.number for frame in self.answered), default=0)
        return [f for f in self.frames if not f.answered and f.number < last]

    @property
    def last_words(self) -> list[Frame]:
        """Returns the frames at the end without an answer."""
        last = max((frame.number for frame in self.answered), default=0)
        return [f for f in self.frames if not f.answered and f.number > last]

    def inputs(self, left_out: Iterable[Frame] = ()) -> list[Message]:
        """Returns the inputs of a replay: what the filter took, after its settings."""
        absent = {id(f.stereo) for f in (*left_out, *(f for f in self.frames if f.unread))}
        absent |= {id(landmark) for landmark in self._landmarks_without_room()}
        taken = [m for m in self.messages if _is_input(m) and id(m) not in absent]
        first = next(at for at, m in enumerate(taken) if m.kind in DATA_KINDS or is_restore(m))
        settings = [] if self.config is None else [self.config]
        limited = {id(f.stereo): f.within_budget() for f in self.frames}
        return [*taken[:first], *settings, *(limited.get(id(m), m) for m in taken[first:])]

    def _landmarks_without_room(self) -> list[Message]:
        """Returns known landmarks that a board refused, which has less room than the desk."""
        known = [m for m in self.messages if isinstance(m, Landmark) and _is_input(m)]
        refused = sum(
            isinstance(m, Report) and m.subject == Kind.LANDMARK and m.status == FULL
            for m in self.messages
        )
        return list(known[max(len(known) - refused, 0) :])


@dataclass(frozen=True)
class RobotLog:
    """The parts of a file that contain frames, and remarks on the whole."""

    path: Path
    parts: list[Part]
    frames: int
    remarks: list[str]


def read_log(path: Path) -> RobotLog:
    """Reads a log of inputs and outputs; raises PelorusError where it is none."""
    received, counts = read_file(path)
    messages = [frame.message for frame in received]
    kinds = {message.kind for message in messages}
    if not kinds & {Kind.POSE, Kind.REPORT}:
        raise PelorusError(
            f"{path}: holds no POSE and no REPORT: a recording, but no filter's log; {RIGHT}"
        )
    if Kind.STEREO not in kinds:
        raise PelorusError(f"{path}: holds answers but no STEREO, so no inputs to replay; {RIGHT}")
    header_of(received, path)
    before, end = _up_to_end(received)
    parts, frames = _parts(before, end)
    remarks = [] if counts.ended else ["there is no END: the log was cut short"]
    if counts.ended and len(before) + 1 < len(received):
        remarks.append("goes on behind END; that was not read")
    if not counts.clean:
        remarks.append(f"the log is damaged: {counts.damaged} frames, {counts.missing} missing")
    return RobotLog(path, parts, frames, remarks)


def frames_of(messages: Iterable[Message]) -> list[Frame]:
    """Returns the STEREO frames among messages, with their answers."""
    walk = _Walk(0)
    for message in messages:
        walk.take(message)
    return walk.frames


def _up_to_end(received: list[Received]) -> tuple[list[Received], End | None]:
    for at, frame in enumerate(received):
        if isinstance(frame.message, End):
            return received[:at], frame.message
    return received, None


def _parts(received: Sequence[Received], end: End | None) -> tuple[list[Part], int]:
    boots = [
        at
        for at, frame in enumerate(received)
        if isinstance(frame.message, Report) and frame.message.notice == Notice.STARTED
    ]
    edges = [0, *boots, len(received)]
    parts: list[Part] = []
    frames, config = 0, None
    for first, last in pairwise(edges):
        before = received[first - 1].sequence if first else None
        part = _part(received[first:last], before, frames, end if last == edges[-1] else None)
        config = part.config = part.config or config  # of the same board
        frames += len(part.frames)
        if part.frames:
            parts.append(part)
    return parts, frames


def _part(
    received: Sequence[Received], before: int | None, frames_before: int, end: End | None
) -> Part:
    messages = [frame.message for frame in received]
    walk = _Walk(frames_before)
    expected = None if before is None else (before + 1) % SEQUENCE_MODULUS
    for sequence, message in ((frame.sequence, frame.message) for frame in received):
        gap = 0 if expected is None else (sequence - expected) % SEQUENCE_MODULUS
        if 0 < gap < SEQUENCE_MODULUS // 2:
            walk.lose(f"the log lacks {gap} of its frames there")
        expected = (sequence + 1) % SEQUENCE_MODULUS
        walk.take(message)
    in_force = (m for m in messages if isinstance(m, Config) and m.build_fingerprint)
    restored = _is_restored(messages)
    part = Part(messages, walk.frames, walk.losses, next(in_force, None), restored)
    part.losses += [
        Loss(f.number, f"no answer to frame {f.number}: it, or the answer, was lost on the way")
        for f in part.unanswered
    ]
    absent = _not_arrived(part, end)
    if absent > len(part.losses):
        words = f"the robot's count at the end lacks messages that the log holds: {absent}"
        part.losses.append(Loss(NOWHERE, words))
    part.losses.sort()
    return part


class _Walk:
    """Goes through a part and assigns each answer to its frame."""

    def __init__(self, frames_before: int) -> None:
        self.frames: list[Frame] = []
        self.losses: list[Loss] = []
        self._before = frames_before
        self._begun = False  # a HEADER has come
        self._waiting: defaultdict[int, deque[Frame]] = defaultdict(deque)  # by time
        self._offset_ns = 0  # of a POSE to its frame, by the settings in force

    def lose(self, words: str) -> None:
        """Records a loss here, which may affect the frame that is not answered yet.

        Before the HEADER a filter takes nothing, so nothing is lost on it.
        """
        if not self._begun:
            return
        last = self.frames[-1] if self.frames else None
        under_way = last is not None and not last.answered
        number = self._before + len(self.frames) + (0 if under_way else 1)
        self.losses.append(Loss(number, words))

    def take(self, message: Message) -> None:
        match message:
            case Header():
                self._begun = True
            case Stereo():
                self.frames.append(Frame(self._before + len(self.frames) + 1, message))
                self._waiting[message.t_ns].append(self.frames[-1])
            case Config() if message.build_fingerprint:
                self._offset_ns = _camera_offset_ns(message)
            case Pose() if message.after_stereo:
                waiting = self._waiting[message.t_ns - self._offset_ns]
                if waiting:
                    waiting[0].pose = message
                else:
                    self.lose("an answer to a frame that the log does not hold")
            case Report() if message.subject == Kind.STEREO:
                self._take_report(message)
            case Report() if message.status in NOT_ARRIVED and message.subject != Kind.STATE:
                why = f"{STATUSES[message.status]} (status {message.status})"
                self.lose(f"the robot refused a message: {why}")
            case Text() if self.frames:
                self.frames[-1].words.append(message.text)
            case _:
                pass

    def _take_report(self, report: Report) -> None:
        waiting = self._waiting[report.t_ns]
        if waiting:
            waiting.popleft().report = report
        elif report.t_ns and not report.status:
            self.lose("an answer to a frame that the log does not hold")
        elif self.frames and not self.frames[-1].answered:  # refused unread, so without a time
            self.frames[-1].report = report


def _is_input(message: Message) -> bool:
    if isinstance(message, Config):
        return not message.build_fingerprint
    if isinstance(message, Landmark):
        return message.role == Role.KNOWN
    return is_restore(message) or message.kind in (*DATA_KINDS, Kind.HEADER, Kind.START)


def _camera_offset_ns(config: Config) -> int:
    """Returns the offset as the session rounds it; in mapping frames keep their time."""
    offset_s = config.settings.get(IDS["camera-offset"], 0.0)
    if mode_in_force([config]) == "mapping":
        return 0
    return int(math.copysign(int(abs(offset_s) * 1e9 + 0.5), offset_s))


def _is_restored(messages: Sequence[Message]) -> bool:
    """Returns whether the filter said so, or was asked to and did not refuse."""
    if any(isinstance(m, Report) and m.notice == Notice.RESTORED for m in messages):
        return True
    asked = [m.t_ns for m in messages if isinstance(m, State) and m.action == StateAction.RESTORE]
    refused = [m for m in messages if isinstance(m, Report) and m.subject == Kind.STATE]
    return bool(asked) and not any(r.status and r.t_ns in asked for r in refused)


def _not_arrived(part: Part, end: End | None) -> int:
    """Returns how many logged inputs did not reach the robot, by its count at the end."""
    if end is None:
        return 0
    held = Counter(m.kind for m in part.messages if _is_input(m))
    return sum(max(held[kind] - count, 0) for kind, count in end.incomplete.items())
