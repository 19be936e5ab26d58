# SPDX-License-Identifier: MIT
"""The far end of a link, without a filter: it answers as a board does, or fails as a wire does.

It tells its settings in answer to the first STEREO, gives each POSE and REPORT, and END for END.
"""

from __future__ import annotations

import os
import select
import socket
import threading
import tty
from contextlib import suppress
from dataclasses import dataclass, field

from pelorus.wire.frames import Config, End, Kind, Message, Pose, Report, Stereo, Text
from pelorus.wire.framing import Reader, encode

STOP_S = 0.02  # how often it looks whether it is to stop
FULL = -10  # plr_status


@dataclass(frozen=True)
class Manner:
    """What kind of board it is."""

    silent: bool = False
    tells_settings: bool = True
    leaves_after: int | None = None  # answers to STEREO
    a_frame_late: bool = False  # its reports
    most_observations: int = 128
    slots: int = 32
    says: str = ""  # with its settings
    floods: bytes = b""  # these, for ever
    floods_after: int | None = None  # answers to STEREO; None: from the first byte heard on


@dataclass
class FakeBoard:
    """Serves one file descriptor after the other, in a thread of its own."""

    manner: Manner = Manner()
    heard: list[Message] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)

    def serve(self, fd: int, stop: threading.Event) -> None:
        """Until the other side or the board's manner ends it; the descriptor stays open."""
        reader = Reader()
        os.set_blocking(fd, not self.manner.floods)
        while not stop.is_set():
            self._flood(fd)
            if not select.select([fd], [], [], 0 if self._flooding else STOP_S)[0]:
                continue
            try:
                piece = os.read(fd, 4096)
            except OSError:
                return  # a pseudo-terminal whose other end was closed
            if not piece:
                return
            for received in reader.feed(piece):
                self.heard.append(received.message)
                if len(self.poses) == self.manner.leaves_after:
                    return
                if not self.manner.silent and not self._flooding:
                    os.write(fd, b"".join(encode(m, 0) for m in self._answer(received.message)))

    @property
    def _flooding(self) -> bool:
        return bool(self.manner.floods) and len(self.poses) >= (self.manner.floods_after or 0)

    def _flood(self, fd: int) -> None:
        if self._flooding:
            with suppress(OSError):  # a full wire, or one whose other end is gone
                os.write(fd, self.manner.floods)

    def _answer(self, message: Message) -> list[Message]:
        if isinstance(message, End):
            return [End(0, 0, 0, 0, 0)]
        if not isinstance(message, Stereo):
            return []
        if len(message.ids) > self.manner.most_observations:
            return [Report(0, Kind.STEREO, FULL)]
        answers: list[Message] = []
        if self.manner.tells_settings and not self.poses:
            answers = [
                Config(
                    {4: float(self.manner.slots)}, 0xABCD, 32, self.manner.most_observations, 8, 4
                )
            ]
        if self.manner.says and not self.poses:
            answers.append(Text(self.manner.says))
        self.poses.append(Pose(message.t_ns, real_bytes=4, after_stereo=True))
        reported = self.poses[-2:][0] if self.manner.a_frame_late else self.poses[-1]
        return [*answers, self.poses[-1], Report(reported.t_ns, Kind.STEREO)]


class Served:
    """A board at work while a block lasts; `target` is what `--to` takes."""

    def __init__(self, board: FakeBoard) -> None:
        self.board = board
        self.target = ""
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work)

    def __enter__(self) -> Served:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _work(self) -> None:
        raise NotImplementedError


class TcpBoard(Served):
    """It listens on a port of this machine, for one connection."""

    def __init__(self, board: FakeBoard) -> None:
        super().__init__(board)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(STOP_S)
        self.target = f"tcp:127.0.0.1:{self._listener.getsockname()[1]}"

    def _work(self) -> None:
        with self._listener:
            while not self._stop.is_set():
                try:
                    connection, _ = self._listener.accept()
                except TimeoutError:
                    continue
                with connection:
                    self.board.serve(connection.fileno(), self._stop)
                return


class TerminalBoard(Served):
    """A pseudo-terminal: the board has the one end, the device is the other."""

    def __init__(self, board: FakeBoard) -> None:
        super().__init__(board)
        self._ours, self.theirs = os.openpty()  # theirs stays open, so that no one hangs up
        self.device = os.ttyname(self.theirs)
        self.target = f"serial:{self.device}:115200"
        tty.setcbreak(self._ours)

    def _work(self) -> None:
        try:
            self.board.serve(self._ours, self._stop)
        finally:
            os.close(self._ours)

    def __exit__(self, *arguments: object) -> None:
        super().__exit__(*arguments)
        os.close(self.theirs)
