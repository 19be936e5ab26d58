# SPDX-License-Identifier: MIT
"""The front end at the desk: pairs of pictures in, points with ids in both pictures out.

The library's own tracker follows the points, the same that a robot runs (pelorus/vision.h). It
takes most cameras as they are. Pictures of other lenses are rectified for it, and those with more
pixels than it was built for are shrunk.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.eyes.rectified import Evidence
from pelorus.io.tracks import Tracks
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.native import vision
from pelorus.program.extras import cv2
from pelorus.rig.rig import Rig
from pelorus.tracker import Seen as Found
from pelorus.tracker import Tracker, is_followed
from pelorus.tracking import visual_motion
from pelorus.tracking.images import PAIRS_MIN, Gray
from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

CORNERS = 100  # the filter's slots
EXPECTED_NS = 2_000_000_000  # a motion says nothing of a pair that is so much later
UNKNOWN_FOCAL = 0.7  # of the width: most cameras have 0.5 to 0.9; it tells the motion roughly
UNKNOWN_BASELINE_M = 0.1  # any: without a calibration it is the unit of length
Motion = tuple[Floats, Floats]


class Seen(NamedTuple):
    """Points of a rectified pair: ids (n,), pixels (n, 4) of uL vL uR vR."""

    ids: NDArray[np.uint32]
    pixels: NDArray[np.float32]


class Shown(NamedTuple):
    """A pair as the cameras took it, and how points are expected to have moved since the last."""

    t_ns: int
    left: Gray
    right: Gray
    motion: Motion | None = None


class _Look(NamedTuple):
    """A pair as a copy of the tracker finds it; `again`: points that were in the pair before."""

    tracker: Tracker
    seen: Seen
    again: int


class Eyes:
    """Follows points from pair to pair."""

    def __init__(
        self,
        camera: Camera | None,
        size: tuple[int, int],
        rig: Rig | None = None,
        *,
        corners: int = CORNERS,
        disparity_max_px: int = 0,
        first_look: int = 1,
    ) -> None:
        """Points are told in pixels of `camera`, into which `rig`, the cameras that take pictures
        of this size (width, height), is rectified. Without a rig the pictures are rectified; their
        camera need not be known.

        `first_look`: the first pair, a power of two, that is searched for signs of no rectified
        pair: see `require_rectified`.
        """
        width, height = size
        if camera is None:
            middle = (width - 1) / 2, (height - 1) / 2
            focal = UNKNOWN_FOCAL * width
            camera = Camera(focal, focal, *middle, UNKNOWN_BASELINE_M)
        most = vision.limits().pixels
        self._times = next(k for k in range(1, width + 1) if (width // k) * (height // k) <= most)
        taken = rig is not None and self._times == 1 and is_followed(rig.left, rig.right)
        how: dict[str, Any] = {
            "tracks": corners,
            "disparity_max_px": -(-disparity_max_px // self._times),
        }
        if rig is not None and taken:
            self._tracker = Tracker(rig, camera=camera, **how)
        else:
            small = width // self._times, height // self._times
            self._tracker = Tracker.rectified(_shrunk(camera, self._times), *small, **how)
        self._rectification = None if rig is None else rig.rectification()
        self._raw = taken
        self._evidence = Evidence(disparity_max_px, first_look)
        self._going = _Going(camera)

    def see(self, t_ns: int, left: Gray, right: Gray, motion: Motion | None = None) -> Seen:
        """Returns the points of the next pair, of pictures as the cameras took them.

        `motion` is how points are expected to have moved in the rectified camera, x_now = R x_then
        + p.
        """
        return self._seen(self._tracker.track(t_ns, *self._shown(left, right), motion=motion))

    def search(self, t_ns: int, left: Gray, right: Gray, motion: Motion | None) -> Seen:
        """Returns the same where there is time: after several looks at the pair.

        Of a `motion` with p = 0 only the turn is measured; the way goes on as the pictures showed
        it. `motion` is not relied upon: it is left out where more than twice as many points of the
        last pair are found again without it. Without it that look counts which finds most: where
        the motion goes on, where nothing is expected, or where it is what the better one showed.
        """
        shown = self._shown(left, right)
        going = self._going.until(t_ns)
        best = self._look(t_ns, shown, None)
        if going is not None:
            best = max(best, self._look(t_ns, shown, going), key=lambda look: look.again)
        if motion is not None:
            if going is not None and not motion[1].any():
                motion = motion[0], going[1]
            told = self._look(t_ns, shown, motion)
            best = best if best.again > 2 * told.again else told
        elif (shows := self._going.shown_by(best.seen)) is not None:
            best = max(best, self._look(t_ns, shown, shows), key=lambda look: look.again)
        self._tracker = best.tracker
        self._going.add(t_ns, best.seen)
        return best.seen

    def _look(self, t_ns: int, shown: tuple[Gray, Gray], motion: Motion | None) -> _Look:
        tracker = self._tracker.copy()
        seen = self._seen(tracker.track(t_ns, *shown, motion=motion))
        return _Look(tracker, seen, self._going.count(seen))

    def _shown(self, left: Gray, right: Gray) -> tuple[Gray, Gray]:
        """Returns the pair that the tracker takes; looks whether it is one."""
        pair, looks = (left, right), self._evidence.needs_next
        if self._rectification is not None and (looks or not self._raw):
            pair = self._rectification.pictures(left, right)
        if looks:
            self._evidence.add(*pair)
        else:
            self._evidence.skip()
        if self._raw:
            return left, right
        return _small(pair[0], self._times), _small(pair[1], self._times)

    def _seen(self, found: Found) -> Seen:
        pixels = (found.pixels + 0.5) * self._times - 0.5 if self._times > 1 else found.pixels
        return Seen(found.observations["id"].copy(), pixels)

    def require_rectified(self, where: tuple[Path, Path]) -> None:
        """Raises PelorusError if the pictures so far show that they are those of no rectified pair:
        swapped, of another calibration, or not taken together."""
        if self._evidence.corners:
            self._evidence.require_rectified(where)


class _Going:
    """Expects that the camera moves on as it did between the last two pairs, which the pictures
    alone show."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._last: tuple[int, Seen] | None = None
        self._rate: Floats | None = None  # of translation and rotation, for each ns

    def until(self, t_ns: int) -> Motion | None:
        """Returns the motion from the last pair to this time; None where it is not known."""
        if self._last is None or self._rate is None:
            return None
        after = t_ns - self._last[0]
        if not 0 < after <= EXPECTED_NS:
            return None
        expected = se3.exp(*np.split(self._rate * after, 2))
        return expected.R, expected.p

    def count(self, seen: Seen) -> int:
        """Returns how many of the last pair's points these are."""
        return 0 if self._last is None else len(np.intersect1d(self._last[1].ids, seen.ids))

    def shown_by(self, seen: Seen) -> Motion | None:
        """Returns the motion from the last pair to these points; None with too few."""
        if self._last is None:
            return None
        before = self._last[1]
        pair = Tracks.of_frames((before.ids, seen.ids), (before.pixels, seen.pixels))
        motion = visual_motion.of_pair(pair, self._camera)
        return None if motion is None else (motion.R, motion.p)

    def add(self, t_ns: int, seen: Seen) -> None:
        """Takes the points of a pair."""
        shows, self._rate = self.shown_by(seen), None
        if shows is not None and self._last is not None:
            self._rate = se3.log(Poses(*shows)) / (t_ns - self._last[0])
        self._last = t_ns, seen


def _shrunk(camera: Camera, times: int) -> Camera:
    """Returns the camera of pictures in which squares of so many pixels a side became one."""
    four = camera.fx_px, camera.fy_px, camera.cx_px + 0.5, camera.cy_px + 0.5
    fx, fy, cx, cy = (number / times for number in four)
    return replace(camera, fx_px=fx, fy_px=fy, cx_px=cx - 0.5, cy_px=cy - 0.5)


def _small(picture: Gray, times: int) -> Gray:
    """Returns the means of squares of so many pixels a side."""
    if times == 1:
        return picture
    rows, columns = (side // times for side in picture.shape)
    whole = picture[: rows * times, : columns * times]
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA), np.uint8)


def track(pairs: Iterable[Shown], eyes: Eyes, where: tuple[Path, Path]) -> Tracks:
    """Returns the tracks of a drive; raises PelorusError where there is nothing to follow."""
    seen = [eyes.search(*pair) for pair in pairs]
    eyes.require_rectified(where)
    tracks = Tracks.of_frames([one.ids for one in seen], [one.pixels for one in seen])
    _, number, lives = np.unique(tracks.id, return_inverse=True, return_counts=True)
    if not (lives >= PAIRS_MIN).any():
        raise PelorusError(
            f"{where[0]}: no corner could be followed for {PAIRS_MIN} frames; pictures with "
            "texture that overlap from frame to frame are expected"
        )
    return tracks.with_ids(number.astype(np.int64))
