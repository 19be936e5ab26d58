# SPDX-License-Identifier: MIT
"""Records what host and board said to each other, for a replay.

A board sends its settings in answer to the first data, and a replay must have them before: so the
first data are held back until they come. Every message is handed to the system at once, so that a
log that is cut short is complete up to there.
"""

from __future__ import annotations

from typing import BinaryIO

from pelorus.errors import PelorusError
from pelorus.wire.frames import Config, End, Kind, Message, Report
from pelorus.wire.framing import Writer

SETUP_KINDS = (Kind.HEADER, Kind.CONFIG, Kind.LANDMARK, Kind.START)


class FlightLog:
    """Takes messages in the order in which they are sent and received."""

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
