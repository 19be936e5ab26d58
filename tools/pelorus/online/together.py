# SPDX-License-Identifier: MIT
"""Are the two pictures of a pair taken together, whatever their stamps say? Their rows tell."""

from __future__ import annotations

from collections import deque

import numpy as np

from pelorus.eyes.front_end import Seen
from pelorus.faults.sync import PictureDelay, apart
from pelorus.io.tracks import Tracks
from pelorus.wire.frames import Camera

FRAMES, EVERY = 40, 20  # looked at together, and so often


class Together:
    """Judges the last frames now and then; `found` is what they show, None while they are right."""

    def __init__(self, camera: Camera) -> None:
        self.found: PictureDelay | None = None
        self._camera = camera
        self._frames: deque[tuple[int, Seen]] = deque(maxlen=FRAMES)
        self._count = 0

    def add(self, t_ns: int, seen: Seen) -> None:
        """The points of the next frame."""
        self._frames.append((t_ns, seen))
        self._count += 1
        if self._count % EVERY == 0:
            self._look()

    def _look(self) -> None:
        all_seen = [seen for _, seen in self._frames]
        t_ns = np.array([t_ns for t_ns, _ in self._frames], np.int64)
        tracks = Tracks.of_frames([s.ids for s in all_seen], [s.pixels for s in all_seen])
        found = apart(tracks, t_ns, self._camera)
        self.found = found if found is not None and found.found else None
