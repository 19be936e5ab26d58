# SPDX-License-Identifier: MIT
"""The tracks of a drive, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pelorus.errors import PelorusError
from pelorus.io.tracks import Tracks
from pelorus.tracking.images import PAIRS_MIN, Gray
from pelorus.wire.layout import Floats

from opencv_tracker import matching, patches
from opencv_tracker.matching import Mask, Points
from opencv_tracker.patches import Patches
from opencv_tracker.settings import Settings

ADMITTED_AFTER = PAIRS_MIN  # frames
LOOP_PX = 1.0  # flow in the right picture and the match from the left one must meet
MOVED_PX = 1.5  # by the patch of its birth a point may be so far from where the flow led
LIKENESS_MIN = 0.8  # to the patch of its birth


class Live(NamedTuple):
    """The tracks of a frame."""

    id: NDArray[np.int64]
    left: Points
    right: Points

    def where(self, good: Mask | NDArray[np.intp]) -> Live:
        return Live(self.id[good], self.left[good], self.right[good])


def _nothing() -> Live:
    return Live(np.empty(0, np.int64), matching.none(), matching.none())


@dataclass
class Tracker:
    """Follows points from pair to pair; `frames` has what each frame shows."""

    settings: Settings = field(default_factory=Settings)
    frames: list[Live] = field(default_factory=list)
    _before: tuple[Gray, Gray] | None = None
    _next_id: int = 0
    _births: Patches | None = None  # of the last frame's tracks

    def add(self, left: Gray, right: Gray) -> None:
        """The next frame."""
        live, soft = _nothing(), patches.smooth(left)
        if self._before is not None:
            live = self._followed(*self._before, left, right, soft)
        filled = self._filled(live, left, right)
        fresh = patches.cut(soft, filled.left[len(live.id) :], self.settings.window_px)
        self._births = fresh if self._births is None else patches.joined(self._births, fresh)
        self.frames.append(filled)
        self._before = left, right

    def _followed(self, left0: Gray, right0: Gray, left: Gray, right: Gray, soft: Floats) -> Live:
        """What of the last frame's tracks is seen again, in both pictures and without a doubt."""
        live, s = self.frames[-1], self.settings
        there, good = matching.flow(left0, left, live.left, s)
        rows, there = np.nonzero(good)[0], there[good]
        agree = matching.agreeing(live.left[rows], there, s)
        rows, there = rows[agree], there[agree]
        now, births = self._as_at_birth(soft, rows, there)
        on_right, found = matching.flow(right0, right, now.right, s)
        matched, good = matching.match(left, right, now.left, s, on_right)
        meets = np.linalg.norm(matched - on_right, axis=1) <= LOOP_PX
        sure = found & good & meets
        sure[sure] = _apart(now.left[sure], s.spacing_px / 2)
        kept = Live(now.id, now.left, matched).where(sure)
        self._births = patches.renewed(births.where(sure), soft, kept.left, s.window_px)
        return kept

    def _as_at_birth(
        self, soft: Floats, rows: NDArray[np.intp], there: Points
    ) -> tuple[Live, Patches]:
        """Where the points are by the patches of their births; gone are those that look unlike."""
        assert self._births is not None
        before = self.frames[-1].where(rows)
        found = patches.find(soft, self._births.where(rows), there, self.settings.window_px)
        moved = np.linalg.norm(found.points - there, axis=1)
        same = (found.likeness >= LIKENESS_MIN) & (moved <= MOVED_PX)
        now = Live(before.id, found.points.astype(np.float32), before.right)
        return now.where(same), found.patches.where(same)

    def _filled(self, live: Live, left: Gray, right: Gray) -> Live:
        fresh = matching.new_corners(left, live.left, self.settings)
        on_right, good = matching.match(left, right, fresh, self.settings)
        id = np.arange(self._next_id, self._next_id + int(good.sum()), dtype=np.int64)
        self._next_id += len(id)
        return Live(
            np.concatenate((live.id, id)),
            np.concatenate((live.left, fresh[good])),
            np.concatenate((live.right, on_right[good])),
        )

    def tracks(self) -> Tracks:
        """Those that lived for three frames at least, from their first frame on, numbered anew."""
        frame = np.repeat(np.arange(len(self.frames)), [len(f.id) for f in self.frames])
        id = np.concatenate([f.id for f in self.frames])
        pixels = np.concatenate([np.hstack((f.left, f.right)) for f in self.frames])
        lives = np.bincount(id, minlength=self._next_id) >= ADMITTED_AFTER
        kept = lives[id]
        number = np.cumsum(lives) - 1
        return Tracks.from_rows(
            len(self.frames), frame[kept], number[id[kept]], pixels[kept].astype(np.float64)
        )


def _apart(points: Points, distance_px: float) -> Mask:
    """Of points that have run together the older one: a track follows no other's patch."""
    far: Floats = np.linalg.norm(points[:, None].astype(np.float64) - points, axis=2)
    close: Mask = np.tril(far < distance_px, -1)
    return np.asarray(~close.any(axis=1), np.bool_)


def track(
    images: Iterable[tuple[Gray, Gray]], where: tuple[Path, Path], settings: Settings
) -> Tracks:
    """All of a drive; PelorusError where there is nothing to follow."""
    settings.check()
    tracker = Tracker(settings)
    for left, right in images:
        tracker.add(left, right)
    tracks = tracker.tracks()
    if not len(tracks):
        raise PelorusError(
            f"{where[0]}: no corner could be followed for {ADMITTED_AFTER} frames; pictures with "
            "texture that overlap from frame to frame are expected"
        )
    return tracks
