# SPDX-License-Identifier: MIT
"""Everyday faults, by name: what is most likely wrong with a recording, and how to put it right.

An absolute test comes first: one rigid scene must explain the points of two frames, and one
rotation and scale the motions of camera and body. Where that fails nothing is called good, and
where no known fault explains it, that is said instead of a guess. Nothing is changed here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pelorus.check.handeye import FRAMES_ENOUGH, HandEye, angle_between, hand_eye
from pelorus.faults.axes import turns
from pelorus.frames import Message, Stereo, Twist
from pelorus.layout import Floats
from pelorus.recording import Recording

SWAPPED_SHARE = 0.5
ROW_GAP_PX, ROW_GAP_FAR_PX = 2.0, 20.0  # of a rectified pair the median is below one
FIT_LEAST = 0.6  # of the point pairs that one motion explains
LEFT_MOST = 0.7  # of a motion's size that the twists leave unexplained
TURNED_DEG, ROLLED_DEG, NEAR_DEG, AXES_DEG = 12.0, 50.0, 20.0, 40.0
PITCH_MOST_DEG = 60.0
SURE_SIGMAS = 4.0
SCALE_LEAST, SCALE_MOST = 0.88, 1.07  # noise makes far points, and so every way, seem smaller
UNIT_NEAR = 0.15
FROZEN_FRAMES = 3
MOVES_MPS = 1.0  # a camera that hardly moves need not agree with the twists' noise
JUMPS_SHARE = 0.003
GAP_TIMES = 10.0


UNTOLD = "untold"  # no fault, but not called good either
LOCAL = ("frozen", "time-gap", "time-order", UNTOLD)  # the rest of the drive may be sound


@dataclass(frozen=True)
class Fault:
    """`name` is for programs, `words` for people; nothing was mended."""

    name: str
    words: str


def faults_of(messages: Sequence[Message], recording: Recording) -> list[Fault]:
    """The likeliest first; empty if nothing is wrong that this knows of."""
    times = list(_times(messages))
    pixels = list(_pixels(recording))
    ids = list(_ids(recording))
    if pixels or ids or any(fault.name == "time-unit" for fault in times):
        return [*pixels, *ids, *times]  # what follows would be built on sand
    if not len(recording.twist_t_ns):
        return times  # an IMU: how the body moved is not known before the filter says it
    found = hand_eye(recording)
    return [*_geometry(recording, found), *_frozen(recording), *times]


# --- time -----------------------------------------------------------------------------------------


def _times(messages: Sequence[Message]) -> Iterator[Fault]:
    for kind, name in ((Twist, "twists"), (Stereo, "frames")):
        t = np.array([m.t_ns for m in messages if isinstance(m, kind)], np.int64)
        steps = np.diff(t)
        back, same = int(np.sum(steps < 0)), int(np.sum(steps == 0))
        if back or same:
            yield Fault("time-order", f"the times of {name} go back {back} times and repeat {same}")
        ahead = steps[steps > 0]
        usual = float(np.median(ahead)) if len(ahead) else 0.0
        gaps = int(np.sum(ahead > max(GAP_TIMES * usual, 1e9)))
        if gaps and usual < 1e9:
            longest = float(ahead.max()) * 1e-9
            yield Fault("time-gap", f"{gaps} gaps in the {name}, the longest of {longest:.1f} s")
        if usual > 20e9 or 0 < usual < 20e3:
            yield Fault(
                "time-unit",
                f"{usual * 1e-9:.3g} s from one of the {name} to the next: is the time in other "
                "units (ms, us)?",
            )


# --- pixels and ids -------------------------------------------------------------------------------


def _pixels(recording: Recording) -> Iterator[Fault]:
    u_l, v_l, u_r, v_r = recording.tracks.pixels.T
    disparity, rows = u_l - u_r, v_l - v_r
    gap = float(np.median(np.abs(rows)))
    if np.mean(disparity < 0) > SWAPPED_SHARE and gap < ROW_GAP_PX:
        yield Fault(
            "left-right",
            f"{np.mean(disparity < 0):.0%} of the disparities are negative: left and right are "
            "swapped",
        )
    elif gap > ROW_GAP_PX and np.median(np.abs(disparity)) < ROW_GAP_PX:
        yield Fault("u-v", f"rows differ by {gap:.0f} px where columns should: u and v are swapped")
    elif gap > ROW_GAP_PX:
        spread = float(np.median(np.abs(rows - np.median(rows))))
        yield Fault(
            "unrectified",
            f"a point's rows differ by {gap:.1f} px (spread {spread:.1f}): the pair is not "
            "rectified, or left and right are of different moments",
        )


def _ids(recording: Recording) -> Iterator[Fault]:
    """Ids that are a frame's row numbers, or slots that are given to one point after another."""
    tracks = recording.tracks
    counts = tracks.counts()
    filled = counts[counts > 0]
    bounds = tracks.bounds()
    rows = [
        np.array_equal(tracks.id[a:b] - tracks.id[a], np.arange(b - a))
        for a, b in pairwise(bounds.tolist())
        if b - a > 4
    ]
    first = [int(tracks.id[a]) for a, b in pairwise(bounds.tolist()) if b - a > 4]
    if rows and np.mean(rows) > 0.9 and len(set(first)) <= 2:
        yield Fault("ids-rows", "the ids are 0, 1, 2, ... in every frame: they are row numbers")
        return
    pairs = tracks.pairs(1)
    if not len(pairs.first):
        yield Fault("ids-new", "no id is seen in two frames in a row: ids must follow a point")
        return
    jump = np.linalg.norm(
        (tracks.pixels[pairs.second] - tracks.pixels[pairs.first])[:, [0, 1]], axis=1
    )
    by_frame = np.zeros(tracks.frame_count)
    np.add.at(by_frame, pairs.frame, 1)
    wide = np.ptp(tracks.pixels[:, 0]) * 0.25
    few = len(np.unique(tracks.id)) < 3 * float(np.median(filled))
    share = float(np.mean(jump > wide))
    if share > JUMPS_SHARE and few:
        yield Fault(
            "ids-slots",
            f"{share:.0%} of the ids jump across the picture from one frame to the next, and there "
            f"are only {len(np.unique(tracks.id))} of them: they are slots, not points",
        )


def _frozen(recording: Recording) -> Iterator[Fault]:
    """The same picture several times in a row, though the twists say that the body moves."""
    pairs = recording.tracks.pairs(1)
    same = (recording.tracks.pixels[pairs.first] == recording.tracks.pixels[pairs.second]).all(1)
    count = np.bincount(pairs.frame, minlength=recording.tracks.frame_count)
    repeated = np.bincount(pairs.frame, same, minlength=recording.tracks.frame_count)
    frozen = (count >= 3) & (repeated == count)
    moved = np.linalg.norm(recording.body_motion(1).p, axis=1)
    frozen[: len(moved)] &= moved > 0.005
    longest = _longest_run(frozen)
    if longest >= FROZEN_FRAMES:
        t = (recording.frame_t_ns - recording.frame_t_ns[0]) * 1e-9
        at = t[np.nonzero(frozen)[0]]
        yield Fault(
            "frozen",
            f"{int(frozen.sum())} frames repeat the picture before them while the body moves, the "
            f"first at {at[0]:.1f} s: the camera or the tracker is frozen there",
        )


def _longest_run(flags: np.ndarray) -> int:
    run = best = 0
    for flag in flags.tolist():
        run = run + 1 if flag else 0
        best = max(best, run)
    return best


# --- camera and body ------------------------------------------------------------------------------


def _geometry(recording: Recording, found: HandEye) -> Iterator[Fault]:
    if not found.told:
        yield Fault(
            UNTOLD,
            f"only {found.frames} frames share points enough with the one before ({FRAMES_ENOUGH} "
            "are due): axes, units and scale cannot be judged",
        )
        return
    if found.fit < FIT_LEAST:
        yield Fault(
            "scene",
            f"only {found.fit:.0%} of the points of two frames agree on one motion: wrong ids, a "
            "wrong calibration, or much of the scene moves",
        )
        return
    units = list(_units(found))
    yield from units
    given = recording.T_CB.R
    off = angle_between(found.R, given)
    cosine = float((found.R @ found.heading_B) @ (given @ found.heading_B))
    headed = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    # the way tells where the camera looks; the roll about it only the turns do, which may be noise
    sure = off > SURE_SIGMAS * _sigma_deg(found, given)
    if found.way_left > LEFT_MOST and not units:
        if found.speed_mps > MOVES_MPS:
            yield Fault(
                "no-fit",
                f"camera and twists do not tell the same motion ({found.way_left:.0%} of it is "
                "left unexplained), and no known fault explains why",
            )
        return
    if sure and (headed > TURNED_DEG or off > ROLLED_DEG):
        yield _extrinsic(given, found.R, off)
    if not units:
        yield from _scales(found)


def _units(found: HandEye) -> Iterator[Fault]:
    """c = s b: with degrees b is 57 times too large, so s is 1/57."""
    for name, scale, unit, of in (
        ("degrees", found.turn_scale, np.pi / 180, "rates: they are in degrees"),
        ("km/h", found.way_scale, 1 / 3.6, "velocities: they are in km/h"),
        ("mm/s", found.way_scale, 1e-3, "velocities: they are in mm/s"),
    ):
        if scale > 0 and abs(np.log(scale / unit)) < UNIT_NEAR + (0.3 if unit < 0.1 else 0):
            yield Fault(f"unit-{name}", f"the images show {scale:.3g} times the {of}")


def _extrinsic(given: Floats, found: Floats, off: float) -> Fault:
    if angle_between(found, given.T) < NEAR_DEG:
        return Fault(
            "inverted",
            f"the extrinsic is off by {off:.0f} degrees, and fits inverted: R_CB is body to camera",
        )
    turned = min(turns(), key=lambda F: angle_between(found, given @ F))
    if not np.allclose(turned, np.eye(3)) and angle_between(found, given @ turned) < AXES_DEG:
        words = ", ".join(f"{'xyz'[k]} for {_axis_name(turned[k])}" for k in range(3))
        return Fault("axes", f"the body's axes are turned or mirrored: the twists have {words}")
    axis = _axis_of(found @ given.T)
    if abs(axis[0]) > 0.85 and off < PITCH_MOST_DEG:
        return Fault(
            "pitch",
            f"the camera is pitched by {off:.0f} degrees beside the extrinsic: forgotten?",
        )
    return Fault("extrinsic", f"the extrinsic's rotation is off by {off:.0f} degrees")


def _sigma_deg(found: HandEye, given: Floats) -> float:
    """How well the turn between the two rotations is known. Of a drive straight ahead nothing tells
    the roll.
    """
    axis = _axis_of(found.R @ given.T)
    return float(np.degrees(np.sqrt(axis @ found.R_covariance @ axis)))


def _axis_name(row: Floats) -> str:
    return ("-" if row.sum() < 0 else "") + "xyz"[int(np.argmax(np.abs(row)))]


def _axis_of(R: Floats) -> Floats:
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return np.asarray(axis / (np.linalg.norm(axis) + 1e-12))


def _scales(found: HandEye) -> Iterator[Fault]:
    low, high = SCALE_LEAST - 4 * found.way_sigma, SCALE_MOST + 4 * found.way_sigma
    if not low < found.way_scale < high:
        yield Fault(
            "scale",
            "stereo and odometry disagree in scale: the images show "
            f"{found.way_scale:.3f} times the twists' way. Baseline, focal length or the wheels' "
            "radius: which of them cannot be known",
        )
