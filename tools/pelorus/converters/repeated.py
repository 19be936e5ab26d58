# SPDX-License-Identifier: MIT
"""Leaves out frames that repeat the one before, when a driver resends a picture with a new time.

Such a frame would show that the body stood for a moment. It is left out and counted. A camera that
stands may show the same picture for long, if it has no noise (rendered ones): frames that repeat
after the first repeated one are kept while twists or gyro show no motion (`moves`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.finding import Finding
from pelorus.faults.two_views import two_views
from pelorus.io.tracks import Tracks
from pelorus.math.motion import Times
from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

Flags = NDArray[np.bool_]
SUBJECT = "repeated frames"
POINTS_LEAST = 3
FITS_D2, LIKE = 25.0, 0.7  # of three degrees of freedom; of the share elsewhere
MANY = 0.02  # share of the frames from which camera or recorder is reported as faulty
MOVES_M, TURNS_RAD = 0.005, 0.003  # from frame to frame


class Repeats:
    """Follows the pictures pair by pair, and decides which are left out."""

    def __init__(self, moves: Flags, t_ns: Times) -> None:
        self._t_ns = t_ns
        self._moves = moves
        self._before: tuple[NDArray[Any], NDArray[Any]] | None = None
        self._in_a_row = 0
        self._kept: list[int] = []
        self._seen = 0

    def leaves_out(self, left: NDArray[Any], right: NDArray[Any]) -> bool:
        """Returns whether this next pair repeats the left or the right picture before."""
        k, before = self._seen, self._before
        self._seen, self._before = k + 1, (left, right)
        same = before is not None and (
            np.array_equal(before[0], left) or np.array_equal(before[1], right)
        )
        self._in_a_row = self._in_a_row + 1 if same else 0
        out = same and (self._in_a_row == 1 or bool(self._moves[k]))
        if not out:
            self._kept.append(k)
        return out

    @property
    def kept_t_ns(self) -> Times:
        """Returns the times of the pairs that are kept."""
        return self._t_ns[self._kept]

    @property
    def findings(self) -> list[Finding]:
        return _findings(self._seen - len(self._kept), self._seen)


def left_out(
    moves: Flags, t_ns: Times, tracks: Tracks, camera: Camera
) -> tuple[Times, Tracks, list[Finding]]:
    """Returns times and tracks without repeated frames, and what was found.

    In a repeated frame the same tracks stand bit for bit where they stood before. It is left out if
    the tracks follow the same points afterwards; else it is stale (faults.stale).
    """
    count = tracks.frame_count
    pairs = tracks.pairs(1)
    same = (tracks.pixels[pairs.first] == tracks.pixels[pairs.second]).all(axis=1)
    repeats = np.bincount(pairs.frame + 1, same, count + 1)[:count]
    here = np.bincount(tracks.frame, minlength=count)
    before = np.concatenate(([0], here[:-1]))
    whole = (here >= POINTS_LEAST) & (repeats == here) & (before == here)
    first = whole & ~np.concatenate(([False], whole[:-1]))
    out = whole & (first | moves)
    if not out.any() or not _go_on(tracks, camera, np.nonzero(out)[0]):
        return t_ns, tracks, []
    number = np.cumsum(~out) - 1
    kept = ~out[tracks.frame]
    less = replace(tracks, frame_count=int((~out).sum()), frame=number[tracks.frame]).at(kept)
    return t_ns[~out], less, _findings(int(out.sum()), count)


def _go_on(tracks: Tracks, camera: Camera, repeats: NDArray[np.intp]) -> bool:
    """Returns whether points before and after the repeated frames are one rigid scene."""
    views = two_views(tracks, camera, 2)
    across = np.isin(tracks.frame[views.first], repeats - 1)
    if across.sum() < POINTS_LEAST or across.all():
        return True
    return bool(np.mean(views.d2[across] < FITS_D2) > LIKE * np.mean(views.d2[~across] < FITS_D2))


def _findings(left: int, of: int) -> list[Finding]:
    if not left:
        return []
    words = f"{left} of {of} frames repeat the picture before them, bit for bit"
    return [Finding(SUBJECT, left > MANY * of, words, "left out", measured=left <= MANY * of)]


def moves(t_ns: Times, own_ns: Times, turns: Floats, speeds: Floats | None) -> Flags:
    """Returns whether the body moves from the previous frame to each.

    It moves by the rates of turn of gyro or twists, or by the twists' velocities.
    """
    out = np.linalg.norm(_by_frames(own_ns, turns, t_ns), axis=1) > TURNS_RAD
    if speeds is not None:
        out |= np.linalg.norm(_by_frames(own_ns, speeds, t_ns), axis=1) > MOVES_M
    return np.asarray(out, np.bool_)


def _by_frames(own_ns: Times, rates: Floats, t_ns: Times) -> Floats:
    """Returns (k, 3) the rates' integral from the previous frame to each one."""
    seconds = (own_ns - own_ns[0]) * 1e-9
    steps = np.diff(seconds)[:, None]
    summed = np.concatenate((np.zeros((1, 3)), np.cumsum(rates[:-1] * steps, axis=0)))
    at = (t_ns - own_ns[0]) * 1e-9
    there = np.stack([np.interp(at, seconds, column) for column in summed.T], axis=-1)
    return np.diff(there, axis=0, prepend=there[:1])
