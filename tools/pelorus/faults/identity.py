# SPDX-License-Identifier: MIT
"""Detects ids that do not stay with their points: slots that are reused, or row numbers.

A track that ends leaves its slot to the next point: from one frame to the next the id jumps, and
before and after the jump it follows a point well. A bad match looks different: the track comes
back. So does a point that was hidden, and is seen again where it must be.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from pelorus.faults.likelihood import of_share
from pelorus.faults.two_views import TwoViews
from pelorus.io.recording import Recording
from pelorus.io.tracks import Indices, Tracks
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.tracking.second_view import measured, predicted

Flags = NDArray[np.bool_]
ROWS_LEAST = 4
ROWS_SHARE, WRONG_TOGETHER = 0.9, 0.15
JUMP_PX, SOUND_D2 = 12.0, 16.0
JUMPS_LEAST, JUMPS_SHARE = 5, 0.2  # of the tracks that end
ELSEWHERE_SHARE = 0.6  # of the points that are seen again
BY_CHANCE, CHANCE = 0.1, 1e-3  # share of bad matches, and the probability of so many
POINTS_MIN = 6  # of a pair of frames
GAP_MOST = 5  # frames over which the images predict a point's place
ELSEWHERE = 0.08  # of the picture's width


def follow(tracks: Tracks, views: TwoViews) -> bool:
    """Returns whether ids stay with their points but for single ones.

    With row numbers, one row less makes all later ids other points.
    """
    bad = _wrong(tracks, views)
    pairs = np.bincount(views.frame)
    wrong = np.bincount(views.frame, bad, minlength=len(pairs))
    some = wrong > 0
    return not some.any() or float(np.mean(wrong[some] / pairs[some])) < WRONG_TOGETHER


def _wrong(tracks: Tracks, views: TwoViews) -> Flags:
    """Returns which pairs cannot be of one point of the world, at any noise."""
    step = tracks.pixels[views.second] - tracks.pixels[views.first]
    moved = np.linalg.norm(step[:, :2], axis=1)
    off_px = np.sqrt(views.d2) * views.sigma_px
    return np.asarray((off_px > JUMP_PX) & (moved > JUMP_PX))


def are_rows(tracks: Tracks) -> bool:
    """Returns whether ids are 0, 1, 2, ... in nearly every frame; a full table of slots is, too."""
    first, rows = [], []
    for a, b in pairwise(tracks.bounds().tolist()):
        if b - a > ROWS_LEAST:
            first.append(int(tracks.id[a]))
            rows.append(np.array_equal(tracks.id[a:b] - tracks.id[a], np.arange(b - a)))
    return bool(rows) and float(np.mean(rows)) > ROWS_SHARE and len(set(first)) <= 2


@dataclass(frozen=True)
class Jumps:
    """Tracks that continue at another place, against those that end."""

    jumps: int
    ends: int
    again: int  # points seen again after a few frames
    elsewhere: int  # of these, far from the predicted place

    @property
    def ratio(self) -> float:
        """Returns 2 ln of the likelihood ratio of so many jumps against the most by bad matches."""
        goes_on, ends = self.jumps + self.elsewhere, self.jumps + self.ends
        return max(
            of_share(self.elsewhere / max(self.again, 1), self.again, BY_CHANCE),
            of_share(min(goes_on / max(ends, 1), 1.0), ends, JUMPS_SHARE),
        )

    @property
    def are_slots(self) -> bool:
        goes_on = self.jumps + self.elsewhere
        most = self.elsewhere > ELSEWHERE_SHARE * self.again
        if most and scipy.special.bdtrc(self.elsewhere - 1, self.again, BY_CHANCE) < CHANCE:
            return True
        return self.jumps >= JUMPS_LEAST and goes_on > JUMPS_SHARE * (self.jumps + self.ends)


def jumps(recording: Recording, views: TwoViews) -> Jumps:
    """Counts the jumps; `views` are of neighbouring frames."""
    tracks = recording.tracks
    px = tracks.pixels
    same = (px[views.first] == px[views.second]).all(axis=1)
    bad = _wrong(tracks, views) & ~same
    sound = views.d2 < SOUND_D2
    begins, ends = np.zeros(len(tracks), bool), np.zeros(len(tracks), bool)
    begins[views.first[sound]] = True  # a sound pair begins with this row
    ends[views.second[sound]] = True
    jumped = bad & ends[views.first] & begins[views.second]
    seen_next = np.zeros(len(tracks), bool)
    seen_next[views.first] = True
    last = np.nonzero(ends & ~seen_next & (tracks.frame < tracks.frame_count - 1))[0]
    return Jumps(int(jumped.sum()), len(last), *_again(recording, views))


def _again(recording: Recording, views: TwoViews) -> tuple[int, int]:
    """Counts points that come back within a few frames, and those that come back elsewhere.

    The images' own motion predicts the place: twists in wrong units or axes would put every point
    elsewhere.
    """
    tracks, camera = recording.tracks, recording.header.camera
    order = np.lexsort((tracks.frame, tracks.id))
    one, two = order[:-1], order[1:]
    gap = tracks.frame[two] - tracks.frame[one]
    known = (tracks.id[one] == tracks.id[two]) & (gap > 1) & (gap <= GAP_MOST)
    untold = np.concatenate(([0], np.cumsum(views.counts < POINTS_MIN)))
    known &= untold[tracks.frame[two]] == untold[tracks.frame[one]]
    one, two = one[known], two[known]
    if not len(one) or not len(recording.twist_t_ns):
        return 0, 0
    motion = _between(views.motion, tracks.frame[one], tracks.frame[two])
    x = measured(camera, tracks.pixels[one])
    h = predicted(camera, x, *motion)
    off = np.linalg.norm((h - measured(camera, tracks.pixels[two]))[:, :2], axis=1)
    width = float(np.ptp(tracks.pixels[:, 0]))
    return len(one), int(np.sum(off > ELSEWHERE * width))


def _between(steps: Poses, first: Indices, last: Indices) -> Poses:
    """Returns the motion from one frame to another, GAP_MOST steps at most."""
    motion = Poses(np.tile(np.eye(3), (len(first), 1, 1)), np.zeros((len(first), 3)))
    for k in range(GAP_MOST):
        more = first + k < last
        step = steps.at(np.where(more, first + k, 0))
        on = se3.compose(step, motion)
        motion = Poses(
            np.where(more[:, None, None], on.R, motion.R), np.where(more[:, None], on.p, motion.p)
        )
    return motion
