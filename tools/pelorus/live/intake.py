# SPDX-License-Identifier: MIT
"""Takes what a camera gives while the last picture is still being followed: in a thread, so that no
driver's queue overflows. A recorded camera waits for its reader, and needs none.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from typing import NamedTuple

from pelorus.errors import PelorusError
from pelorus.live.camera import Camera, Measured, Picture

PICTURES_MOST = 6  # that may wait to be followed: three pairs
SILENCE_S = 5.0  # then the camera counts as gone
LOOK_S = 0.2  # so often it is asked whether to stop


class Arrival(NamedTuple):
    """A measurement; `too_slow`: more pictures wait behind it than may."""

    measured: Measured
    too_slow: bool


class Intake:
    """Iterates over a camera's measurements until it ends, or until `stop` is set."""

    def __init__(self, camera: Camera, silence_s: float = SILENCE_S) -> None:
        self.stop = threading.Event()
        self._camera, self._silence_s = camera, silence_s
        self._queue: queue.SimpleQueue[Measured | BaseException | None] = queue.SimpleQueue()
        self._pictures = 0  # in the queue; each side writes, and the GIL keeps the sum

    def __iter__(self) -> Iterator[Arrival]:
        if self._camera.recorded:
            for one in self._camera.measured():
                if self.stop.is_set():
                    return
                yield Arrival(one, False)
            return
        thread = threading.Thread(target=self._read, name="camera", daemon=True)
        thread.start()
        try:
            yield from self._arrivals()
        finally:
            self.stop.set()
            self._camera.close()
            thread.join(timeout=self._silence_s)

    def _read(self) -> None:
        try:
            for one in self._camera.measured():
                if self.stop.is_set():
                    break
                self._pictures += isinstance(one, Picture)
                self._queue.put(one)
        except BaseException as error:
            self._queue.put(error)
            return
        self._queue.put(None)

    def _arrivals(self) -> Iterator[Arrival]:
        silent_s = 0.0
        while not self.stop.is_set():
            try:
                one = self._queue.get(timeout=LOOK_S)
            except queue.Empty:
                silent_s += LOOK_S
                if silent_s >= self._silence_s:
                    raise PelorusError(
                        f"{self._camera.name}: has given nothing for {self._silence_s:g} s: is it "
                        "still connected and powered (cable, hub, dmesg)? start again"
                    ) from None
                continue
            silent_s = 0.0
            if one is None:
                return
            if isinstance(one, BaseException):
                raise one
            self._pictures -= isinstance(one, Picture)
            yield Arrival(one, self._pictures > PICTURES_MOST)
