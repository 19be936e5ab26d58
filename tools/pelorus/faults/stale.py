# SPDX-License-Identifier: MIT
"""Detects stale tracks.

A tracker that re-detects may keep all live ids at their previous pixels for one frame, and then
follow whatever is there: from that frame on each id is another point of the world. In such a frame
every live track repeats its four numbers bit for bit although the image must have moved. A camera
at rest, or a single track that happens to repeat, is none. Remedy: a new id from there on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.finding import Finding
from pelorus.io.recording import Recording
from pelorus.io.tracks import Pairs, Tracks, project
from pelorus.tracking.visual_motion import seen_pairs

SUBJECT = "stale tracks"
MOVED_MIN_PX = 0.1  # median image motion that the twists must predict
LIVE_MIN = 3  # tracks that must repeat together


def mend(recording: Recording) -> tuple[Recording, Finding]:
    """Gives the tracks of stale frames new ids."""
    pairs = recording.tracks.pairs(1)
    repeats = _repeats(recording.tracks, pairs)
    frames = _stale_frames(recording, pairs, repeats)
    stale = pairs.second[repeats & frames[recording.tracks.frame[pairs.second]]]
    if not len(stale):
        evidence = f"no moving frame repeats all its pixels ({int(repeats.sum())} single repeats)"
        return recording, Finding(SUBJECT, False, evidence, "nothing to mend")
    tracks = _split(recording.tracks, stale)
    moved = _predicted_px(recording)
    evidence = (
        f"in {int(frames.sum())} of {recording.tracks.frame_count} frames all live tracks repeat "
        f"their pixels bit for bit ({len(stale)} observations, "
        f"{100 * len(stale) / len(recording.tracks):.1f} %), though the twists move the image by "
        f"{np.nanmedian(moved[frames]):.1f} px there"
    )
    action = f"{len(stale)} tracks split: a new id from the repeated pixel on"
    return replace(recording, tracks=tracks), Finding(SUBJECT, True, evidence, action)


def _repeats(tracks: Tracks, pairs: Pairs) -> NDArray[np.bool_]:
    same = tracks.pixels[pairs.first] == tracks.pixels[pairs.second]
    return np.asarray(same.all(axis=1))


def _stale_frames(
    recording: Recording, pairs: Pairs, repeats: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Returns (T,) frames in which all live tracks repeat while the body moves."""
    count = recording.tracks.frame_count
    frame = recording.tracks.frame[pairs.second]
    live = np.bincount(frame, minlength=count)
    repeated = np.bincount(frame, repeats, minlength=count)
    moves = np.nan_to_num(_predicted_px(recording)) > MOVED_MIN_PX
    return np.asarray((live >= LIVE_MIN) & (repeated == live) & moves)


def _predicted_px(recording: Recording) -> NDArray[np.float64]:
    """Returns (T,) the median image motion since the previous frame by the twists, px.

    It compares where a point is seen with where the motion brings it, so pixel noise does not
    enter.
    """
    camera = recording.header.camera
    seen = seen_pairs(recording.tracks, camera, 1)
    first = replace(seen, pixels=project(camera, seen.q_C))
    moved = first.reproject(camera, recording.camera_motion(1))
    return np.concatenate(([np.nan], first.median_by_frame(moved, at_least=LIVE_MIN)))


def _split(tracks: Tracks, stale: NDArray[np.intp]) -> Tracks:
    """Gives each stale row a new id, which later rows of that track keep."""
    order = np.lexsort((tracks.frame, tracks.id))
    begins = np.zeros(len(tracks), bool)
    begins[stale] = True
    breaks = np.cumsum(begins[order])  # over all tracks in the order (id, frame)
    id = tracks.id[order]
    first_of_id = np.concatenate(([True], id[1:] != id[:-1]))
    before = np.maximum.accumulate(np.where(first_of_id, breaks - begins[order], 0))
    new = np.where(breaks > before, tracks.id.max() + breaks, id)
    out = np.empty_like(tracks.id)
    out[order] = new
    return tracks.with_ids(out)
