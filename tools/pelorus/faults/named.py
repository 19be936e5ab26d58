# SPDX-License-Identifier: MIT
"""Names everyday faults: what is most likely wrong with a recording, and how to mend it.

An absolute test comes first: one rigid scene must explain the points of two frames, and one
rotation and scale the motions of camera and body. Where that fails nothing is called good, and
where no known fault explains it, that is said instead of a guess. Nothing is changed here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pelorus.evaluate.inertial_survey import longest_run, readings_of
from pelorus.faults import identity, sync
from pelorus.faults.fault import Fault
from pelorus.faults.geometry import Judged, geometry
from pelorus.faults.handeye import first_part
from pelorus.faults.likelihood import of_share
from pelorus.faults.moving import Moving, moving
from pelorus.faults.resolution import of_resolution
from pelorus.faults.seen import CameraMotion, pauses
from pelorus.faults.two_views import TwoViews, two_views
from pelorus.faults.wheels import of_wheels
from pelorus.io.recording import Recording
from pelorus.math.motion import Times
from pelorus.wire.frames import Imu, Message, Stereo, Twist

Flags = NDArray[np.bool_]
SWAPPED_SHARE = 0.5
ROW_GAP_PX = 2.0  # a rectified pair has a median below one
ROW_BIN, ROW_BINS = 50, 4  # observations, and parts of the picture, by which rows are compared
ROW_OFF_PX = 1.0
OF_MEDIAN = 1.858  # standard error of a median of n, times root n, relative to the median deviation
FROZEN_FRAMES = 3
MOVES_M, TURNS_RAD = 0.005, 0.003  # from frame to frame
GAP_TIMES = 10.0
GAP_WAY = 0.02  # share of the way that may be missing in gaps of twists or readings
FROM_TIMES, SPANS_APART = 10, 50.0
TWISTS, READINGS, FRAMES = "twists", "readings", "frames"
USUAL_MOST_NS, USUAL_LEAST_NS = 20e9, {TWISTS: 5e4, READINGS: 2e4, FRAMES: 5e5}


def judged_of(messages: Sequence[Message], recording: Recording) -> Judged:
    """Examines a file's times as they are, and the recording that a filter would use."""
    frames = np.array([m.t_ns for m in messages if isinstance(m, Stereo)], np.int64)
    if len(recording.inertial.t_ns):
        imu = [m for m in messages if isinstance(m, Imu)]
        readings = readings_of(imu).t_ns if imu else frames[:0]
        return _judged({READINGS: readings, FRAMES: frames}, recording)
    twists = np.array([m.t_ns for m in messages if isinstance(m, Twist)], np.int64)
    return _judged({TWISTS: twists, FRAMES: frames}, recording)


def faults_in(recording: Recording) -> list[Fault]:
    """Returns the faults of a recording that is not written yet."""
    return judged(recording).faults


def judged(recording: Recording) -> Judged:
    """Returns the faults, and how well they are known."""
    frames = recording.frame_t_ns
    if len(recording.inertial.t_ns):
        return _judged({READINGS: recording.inertial.t_ns, FRAMES: frames}, recording)
    return _judged({TWISTS: recording.twist_t_ns, FRAMES: frames}, recording)


def _judged(times_ns: Mapping[str, Times], recording: Recording) -> Judged:
    """Returns the faults, if any: first what spoils the result, then by likelihood."""
    times = [fault for name, t_ns in times_ns.items() for fault in _times(name, t_ns)]
    times += _spans(*times_ns.items())
    short = first_part(recording)
    pixels = list(of_resolution(short)) or _of_pair(short)
    if pixels or any(fault.name in ("time-unit", "time-apart") for fault in times):
        return Judged([*pixels, *times])  # what follows would build on it
    views = two_views(short.tracks, short.header.camera, 1)
    moved = cache(lambda: moving(short.tracks, short.header.camera, views))
    ids = list(_ids(short, views, moved))
    if ids:
        return Judged([*ids, *times])
    found = geometry(short, views, moved)
    body_t_ns = next(iter(times_ns.values()))
    times = [_beside_way(fault, short, views, body_t_ns) for fault in times]
    faults = [*found.faults, *_frozen(recording), *times]
    if found.agreed is not None and not found.faults:  # what is off there would be told twice
        faults += of_wheels(short, views)
    faults = sorted(faults, key=lambda fault: not fault.grave)
    return Judged(faults, found.agreed, views)


# --- time -----------------------------------------------------------------------------------------


def _times(name: str, t_ns: Times) -> Iterator[Fault]:
    steps = np.diff(t_ns)
    back, same = int(np.sum(steps < 0)), int(np.sum(steps == 0))
    if back or same:
        words = f"the times of {name} go back {back} times and repeat {same}"
        yield Fault("time-order", words, stops=False)
    ahead = steps[steps > 0]
    usual = float(np.median(ahead)) if len(ahead) else 0.0
    gaps = int(np.sum(ahead > max(GAP_TIMES * usual, 1e9)))
    if gaps and usual < 1e9:
        longest = float(ahead.max()) * 1e-9
        words = f"{gaps} gaps in the {name}, the longest of {longest:.1f} s"
        yield Fault("time-gap", words, stops=False)
    if usual > USUAL_MOST_NS or 0 < usual < USUAL_LEAST_NS[name]:
        yield Fault(
            "time-unit",
            f"{usual * 1e-9:.3g} s from one of the {name} to the next: is the time in other "
            "units (ms, us)?",
        )


def _beside_way(fault: Fault, recording: Recording, views: TwoViews, t_ns: Times) -> Fault:
    """Returns the fault, made harmless if the robot stands in the gap.

    Many odometry drivers publish only while the robot moves. The images show it, as far as they are
    examined; t_ns are the times of the twists or readings.
    """
    frames = recording.frame_t_ns
    if fault.name != "time-gap" or f"gaps in the {FRAMES}" in fault.words:
        return fault
    if len(t_ns) < 2 or t_ns[np.argmax(np.diff(t_ns)) + 1] > frames[-1]:
        return fault
    seen = CameraMotion.of(recording, views)
    within = pauses(t_ns, frames[:-1], frames[1:])
    way = np.where(seen.usable[:, None], seen.rates[:, :3], 0.0) * seen.tau_s[:, None]
    which = np.cumsum(np.diff(within, prepend=False) & within)
    lost = [way[within & (which == k)].sum(axis=0) for k in np.unique(which[within])]
    lost_m = float(sum(np.linalg.norm(x) for x in lost))
    if (within & ~seen.usable).any():
        unknown = "no track spans them: how far the camera goes in them cannot be told"
        words = f"{fault.words}; {unknown}"
        return replace(fault, words=words, grave=False)
    words = f"{fault.words}; by the pictures the camera goes {lost_m:.2g} m in them"
    all_m = float(np.sum(np.linalg.norm(way, axis=1)))
    return replace(fault, words=words, grave=lost_m > GAP_WAY * all_m)


def _spans(body: tuple[str, Times], camera: tuple[str, Times]) -> Iterator[Fault]:
    """Yields a fault if the streams differ in length or time, and so are not of one drive."""
    if min(len(body[1]), len(camera[1])) < FROM_TIMES:
        return
    lengths = [float(t_ns.max() - t_ns.min()) * 1e-9 for _, t_ns in (body, camera)]
    words = f"the {body[0]} span {lengths[0]:.4g} s, the {camera[0]} {lengths[1]:.4g} s"
    ratio = max(lengths) / max(min(lengths), 1e-9)
    if ratio > SPANS_APART and min(abs(np.log(ratio / x)) for x in (1e3, 1e6, 1e9)) < np.log(2):
        yield Fault("time-unit", f"{words}: is one of the clocks in other units (ms, us)?")
    elif body[1].max() < camera[1].min() or camera[1].max() < body[1].min():
        yield Fault("time-apart", f"{words}, and they do not overlap: clocks of their own?")


# --- pixels and ids -------------------------------------------------------------------------------


def _of_pair(recording: Recording) -> list[Fault]:
    """Returns faults between left and right; different moments also explain different rows."""
    wrong = list(_pixels(recording))
    if any(fault.name != "unrectified" for fault in wrong):
        return wrong
    found = sync.apart(recording.tracks, recording.frame_t_ns, recording.header.camera)
    return wrong if found is None or not found.found else [found.fault]


def _pixels(recording: Recording) -> Iterator[Fault]:
    u_l, v_l, u_r, v_r = recording.tracks.pixels.T
    disparity, rows = u_l - u_r, v_l - v_r
    gap = float(np.median(np.abs(rows)))
    points = len(np.unique(recording.tracks.id))  # each of them is off alike in all its frames
    if np.mean(disparity < 0) > SWAPPED_SHARE and gap < ROW_GAP_PX:
        yield Fault(
            "left-right",
            f"{np.mean(disparity < 0):.0%} of the disparities are negative: left and right are "
            "swapped",
            ratio=of_share(float(np.mean(disparity < 0)), points, SWAPPED_SHARE),
        )
        return
    if gap > ROW_GAP_PX and np.median(np.abs(disparity)) < ROW_GAP_PX:
        words = f"rows differ by {gap:.0f} px where columns should: u and v are swapped"
        far = float(np.mean(np.abs(rows) > ROW_GAP_PX))
        yield Fault("u-v", words, ratio=of_share(far, points, 0.5))
        return
    off, ratio = _row_offset(recording, points)
    if gap > ROW_GAP_PX or off > ROW_OFF_PX:
        yield Fault(
            "unrectified",
            f"a point's rows differ by {gap:.1f} px, by {off:.1f} px in whole parts of the "
            "picture: the pair is not rectified, or left and right are of different moments",
            ratio=ratio,
        )


def _row_offset(recording: Recording, points: int) -> tuple[float, float]:
    """Returns the rows' error, px, and its likelihood ratio.

    The first is the RMS over parts of the picture of the rows' median difference; the second is 2
    ln of the ratio of these medians against none, by their spread over the points in a part.
    """
    px = recording.tracks.pixels
    rows = px[:, 1] - px[:, 3]
    parts = np.zeros(len(px), np.int64)
    for axis in (0, 1):
        edges = np.quantile(px[:, axis], np.arange(1, ROW_BINS) / ROW_BINS)
        parts = parts * ROW_BINS + np.searchsorted(edges, px[:, axis])
    own = [rows[parts == k] for k in range(ROW_BINS * ROW_BINS)]
    some = [values for values in own if len(values) >= ROW_BIN]
    if not some:
        return 0.0, 0.0
    medians = np.array([np.median(values) for values in some])
    spread = [np.median(np.abs(x - m)) for x, m in zip(some, medians, strict=True)]
    count = points / len(px) * np.array([len(values) for values in some])
    sigma = OF_MEDIAN * np.array(spread) / np.sqrt(count) + 1e-3
    return float(np.sqrt(np.mean(medians**2))), float(np.sum((medians / sigma) ** 2))


def _ids(recording: Recording, views: TwoViews, moved: Callable[[], Moving]) -> Iterator[Fault]:
    """Yields a fault if ids are a frame's row numbers, reused slots, or never seen again."""
    tracks = recording.tracks
    if not len(tracks.pairs(1).first):
        yield Fault("ids-new", "no id is seen in two frames in a row: ids must follow a point")
        return
    if identity.are_rows(tracks) and not identity.follow(tracks, views):
        yield Fault("ids-rows", "the ids are 0, 1, 2, ... in every frame: they are row numbers")
        return
    found = identity.jumps(recording, views)
    if found.are_slots and not moved().more_than_usual:  # fast points seem to jump
        yield Fault(
            "ids-slots",
            f"{found.jumps} tracks go on with another point from one frame to the next, "
            f"{found.elsewhere} of {found.again} come back elsewhere, {found.ends} end: the ids "
            f"({len(np.unique(tracks.id))}) are slots, not points",
            ratio=found.ratio,
        )


def _frozen(recording: Recording) -> Iterator[Fault]:
    """Yields a fault if the same picture repeats though twists or gyro show that the body moves."""
    pairs = recording.tracks.pairs(1)
    same = (recording.tracks.pixels[pairs.first] == recording.tracks.pixels[pairs.second]).all(1)
    count = np.bincount(pairs.frame, minlength=recording.tracks.frame_count)
    repeated = np.bincount(pairs.frame, same, minlength=recording.tracks.frame_count)
    frozen = (count >= 3) & (repeated == count)
    moves = _moves(recording)
    frozen[: len(moves)] &= moves
    longest = longest_run(frozen)
    if longest >= FROZEN_FRAMES:
        t = (recording.frame_t_ns - recording.frame_t_ns[0]) * 1e-9
        at = t[np.nonzero(frozen)[0]]
        yield Fault(
            "frozen",
            f"{int(frozen.sum())} frames repeat the picture before them while the body moves, the "
            f"first at {at[0]:.1f} s: the camera or the tracker is frozen there",
            stops=False,
        )


def _moves(recording: Recording) -> Flags:
    """Returns whether the body moves from each frame to the next; with an IMU, whether it turns."""
    readings = recording.inertial
    if not len(readings.t_ns):
        return np.asarray(np.linalg.norm(recording.body_motion(1).p, axis=1) > MOVES_M)
    w = readings.w_B_radps - np.median(readings.w_B_radps, axis=0)
    steps = np.diff(readings.t_ns, prepend=readings.t_ns[:1]) * 1e-9
    angle = np.cumsum(w * steps[:, None], axis=0)
    at = np.searchsorted(readings.t_ns, recording.frame_t_ns).clip(0, len(angle) - 1)
    return np.asarray(np.linalg.norm(np.diff(angle[at], axis=0), axis=1) > TURNS_RAD)
