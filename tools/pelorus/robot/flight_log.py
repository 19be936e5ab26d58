# SPDX-License-Identifier: MIT
"""The flight recorder: what host and board said to each other, as a recording that can be replayed.

A board tells its settings in answer to the first data, and a replay must know them before: so the
first data is held back until they come. Every message is handed to the system at once, so that a
log which is cut short, by whatever, is whole up to there.
"""

from __future__ import annotations

from typing import BinaryIO

from pelorus.errors import PelorusError
from pelorus.frames import Config, End, Kind, Message, Report
from pelorus.wire import Writer

SETUP_KINDS = (Kind.HEADER, Kind.CONFIG, Kind.LANDMARK, Kind.START)


class FlightLog:
    """Takes messages in the order in which they are sent and heard."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._writer = Writer(stream)
        self._held: list[Message] = []
        self._settled = False  # the settings are in the log, or will not come

    def keep(self, message: Message, heard: bool = False) -> None:
        """Add a message that was sent, or heard from the board: its CONFIG has the settings."""
        if heard and isinstance(message, Config) and message.build_fingerprint:
            self._write(message)
            self.release()
        elif self._settled or (message.kind in SETUP_KINDS and not self._held):
            self._write(message)
        else:
            self._held.append(message)
            if isinstance(message, Report) and message.subject == Kind.STEREO:
                self.release()  # a frame was answered, and no settings came before

    def release(self) -> None:
        """Write what is held back; nothing is from here on."""
        self._settled = True
        held, self._held = self._held, []
        for message in held:
            self._write(message)

    def end(self, heard: End | None = None) -> None:
        """Close the recording with END; `heard` is the board's."""
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
