# SPDX-License-Identifier: MIT
"""Measures anew where pictures and odometry differ, by the motion of the stereo pairs alone.

A frame is suspect if the supervisor says so, or if the gate rejected most of it. From some seconds
before, each step between two frames is compared: by the pictures, and by twists or gyro. Their
usual difference is learnt on the seconds before that. Where the median of seven steps is off,
wheels slip or a gyro is wrong; one step that is off alone is a jump.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pelorus.explain.inputs import AXES
from pelorus.explain.log import Cause, FilterLog, Flags, Incident, S, joined_runs, suspect
from pelorus.io.tracks import Tracks
from pelorus.math import motion, se3
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.tracking.visual_motion import PAIRS_MIN, distance2, estimate, rigid, seen_pairs
from pelorus.wire.layout import Floats

APART_NS = 2 * S - 1  # stretches with a gap of less than two seconds are joined
LOOK_BACK_S = 2.0  # before the supervisor is sure
LEARN_S = 5.0  # before that, from which the usual difference is learnt
LEARN_LEAST = 10  # steps
LOOK_ON_S = 4.0
LOOK_MOST_S = 30.0  # longest part of a lasting difference that is examined
SIGMAS = 8.0  # limit for the six numbers of a step: learnt sigmas are rough
MEDIAN_OF = 7  # steps: a difference of their median lasts
MEDIAN_SIGMA = 1.2533  # sigma of a median of many, times the root of their number, over one's sigma
TOLD_SIGMAS = 4.0  # of the odometry, for a median; the supervisor doubts smaller ones
DOUBTS = (1, 2)  # departed, contradicted
PIXEL_MOST_PX = 1e5  # no picture is larger
SCALE_SIGMA = 0.03  # of a velocity: how well its scale is known
SLOW_PX = 0.5
NEAR_D2 = 4 * 13.28  # d^2 of a point that agrees with a motion: probability of one in 100 at 2 px
MAD = 1.4826  # of a normal distribution: sigma over the median absolute deviation


class Steps(NamedTuple):
    """Body velocities (v, w) from frame `first + k` to the next, by pictures and by odometry."""

    first: int
    by_pictures: Floats  # (n, 6); NaN where too few points show it
    by_odometry: Floats  # (n, 6); an IMU has no velocity: there it is the pictures' usual one


def contradictions(log: FilterLog) -> Iterator[Incident]:
    """Yields a finding for each stretch of suspect frames that differs from what was before it."""
    if not len(log.readings):
        return
    for first, last in joined_runs(suspect(log), log.t_ns, APART_NS):
        found = _looked_at(log, first, last)
        if found is not None:
            yield found


def _looked_at(log: FilterLog, first: int, last: int) -> Incident | None:
    begin = log.t_ns[first]
    low = int(np.searchsorted(log.t_ns, begin - (LOOK_BACK_S + LEARN_S) * S))
    lasts_s = min((log.t_ns[last] - begin) / S, LOOK_MOST_S)
    high = int(np.searchsorted(log.t_ns, begin + max(lasts_s, LOOK_ON_S) * S))
    if high - low < LEARN_LEAST:
        return _as_told(log, first, last)
    steps = measured(log, low, high)
    off = steps.by_pictures - steps.by_odometry
    learn: Flags = np.asarray(log.t_ns[low + 1 : high] < begin - LOOK_BACK_S * S)
    known: Flags = np.asarray(np.isfinite(off).all(axis=1))
    if np.count_nonzero(learn & known) < LEARN_LEAST:
        learn[: max(first - low - 2, 0)] = True  # for a drive that has just begun
    if np.count_nonzero(learn & known) < LEARN_LEAST:
        return _as_told(log, first, last)
    usual = np.median(off[learn & known], axis=0)
    sigma: Floats = MAD * np.median(np.abs(off[learn & known] - usual), axis=0)
    off = (off - usual) / np.maximum(sigma, _least_sigma(log, steps))
    lasting = _lasting(np.where(known[:, None], off, np.nan))
    begun = np.flatnonzero((lasting > SIGMAS).any(axis=1) & ~learn)
    if len(begun):
        return _part(log, steps, int(begun[0]), lasting, (first, last))
    single = np.where(known[:, None], np.abs(off), 0.0)
    odd = np.flatnonzero((single > SIGMAS).any(axis=1) & ~learn)
    return _jump(log, steps, int(odd[0])) if len(odd) else None


def _as_told(log: FilterLog, first: int, last: int) -> Incident | None:
    """Returns the supervisor's finding where too few points were seen before to measure one.

    It must doubt the odometry, and have agreed with it before.
    """
    doubted = [e for e in log.evidence[first : last + 1] if e is not None and e.doubt in DOUBTS]
    if not doubted:
        return None
    nu = np.median(np.abs([e.nu for e in doubted]), axis=0)
    axis = int(np.argmax(nu))
    if nu[axis] < TOLD_SIGMAS:
        return None
    kind = "velocity along" if axis < 3 else "turn rate about"
    words = (
        f"pictures and odometry differ most in the {kind} {AXES[axis % 3]}: by {nu[axis]:.0f} sigma"
    )
    cause = Cause.TURN_CONTRADICTED if axis >= 3 else Cause.CONTRADICTED
    if axis < 3 and not log.by_imu:
        cause = Cause.SLIP
    return log.incident(cause, first, last, words)


def _least_sigma(log: FilterLog, steps: Steps) -> Floats:
    """Returns (n, 6) lower limits of the differences' sigmas.

    They are the usual sigmas of the readings on this drive; some per cent of the motion, for wheels
    and cameras are calibrated no better; and for turns half a pixel, by which tracks may drift
    together.
    """
    told = np.nan_to_num(np.abs(steps.by_odometry))
    motion = np.maximum(told, np.nan_to_num(np.abs(steps.by_pictures)))
    motion = np.repeat(np.linalg.norm(motion.reshape(-1, 2, 3), axis=2), 3, axis=1)
    evidence = log.evidence[steps.first]
    usual = np.ones(6) if evidence is None else np.sqrt(evidence.usual)
    least = np.maximum(log.sigma * usual, SCALE_SIGMA * motion)
    tau_s = np.diff(log.t_ns[steps.first : steps.first + len(told) + 1])[:, None] / S
    tau_s = np.maximum(tau_s, 1e-3)
    least[:, 3:] = np.maximum(least[:, 3:], SLOW_PX / log.header.camera.fx_px / tau_s)
    return np.asarray(least)


def _lasting(off: Floats) -> Floats:
    """Returns (n, 6) by how many of its sigmas the median of the next steps is off."""
    out = np.zeros_like(off)
    for k in range(len(off) - MEDIAN_OF + 1):
        window = off[k : k + MEDIAN_OF]
        window = window[np.isfinite(window).all(axis=1)]
        if 2 * len(window) > MEDIAN_OF:
            sigma = MEDIAN_SIGMA / np.sqrt(len(window))
            out[k + MEDIAN_OF // 2] = np.abs(np.median(window, axis=0)) / sigma
    return out


def _jump(log: FilterLog, steps: Steps, k: int) -> Incident:
    t = log.t_ns[steps.first :]
    tau_s = float(t[k + 1] - t[k]) / S
    moved = (steps.by_pictures[k] - steps.by_odometry[k]) * tau_s
    m, deg = np.linalg.norm(moved[:3]), np.degrees(np.linalg.norm(moved[3:]))
    whose = "IMU" if log.by_imu else "odometry"
    words = f"the body jumped by {m:.2f} m and {deg:.1f} deg from one frame to the next, and the "
    words += f"{whose} tells nothing of it: carried, pushed, hit"
    return Incident(Cause.JUMP, int(t[k + 1]), int(t[k + 1]), words)


def _part(
    log: FilterLog, steps: Steps, k: int, lasting: Floats, stretch: tuple[int, int]
) -> Incident:
    """Returns the finding that pictures and odometry differ from step k on."""
    soon = lasting[k : k + MEDIAN_OF]
    times = soon.max(axis=0)
    along = times[:3] > SIGMAS  # slipping wheels turn wrongly, too
    axis = int(np.argmax(times[:3] if along.any() and not log.by_imu else times))
    worst = k + int(np.argmax(soon[:, axis]))
    near = slice(max(worst - MEDIAN_OF // 2, 0), worst + MEDIAN_OF // 2 + 1)
    seen, told = (
        float(np.nanmedian(x[near, axis])) for x in (steps.by_pictures, steps.by_odometry)
    )
    noticed = int(log.t_ns[stretch[0]])
    begin = min(int(log.t_ns[steps.first + k]), noticed)
    end = max(begin, _end(log, steps, k, lasting, stretch[1]))
    if axis < 3:
        words = (
            f"the odometry says {told:.2f} m/s along {AXES[axis]}, the pictures {seen:.2f} m/s: "
            "wheels slip, or what the camera sees moves along"
        )
        return Incident(Cause.SLIP, begin, end, words, noticed)
    words = (
        f"the {'gyro' if log.by_imu else 'odometry'} says {told:.3f} rad/s about {AXES[axis - 3]}, "
        f"the pictures {seen:.3f} rad/s"
    )
    return Incident(Cause.TURN_CONTRADICTED, begin, end, words, noticed)


def _end(log: FilterLog, steps: Steps, k: int, lasting: Floats, last: int) -> int:
    """Returns when the difference ends, or the doubt's end if it is not seen."""
    off = np.flatnonzero((lasting[k:] > SIGMAS).any(axis=1))
    apart = np.flatnonzero(np.diff(off) > MEDIAN_OF)
    end = k + int(off[apart[0]] if len(apart) else off[-1])
    known = end + MEDIAN_OF < len(lasting)
    return int(log.t_ns[steps.first + end + 1] if known else log.t_ns[last])


def measured(log: FilterLog, low: int, high: int) -> Steps:
    """Returns the steps between the frames from `low` to below `high`."""
    t = log.t_ns[low:high]
    tau = np.diff(t)[:, None] / S
    tau = np.where(tau > 0, tau, np.nan)
    told = _by_odometry(log, t)
    steps, known = _by_pictures(log, low, high, told)
    seen = np.where(known[:, None], se3.log(steps), np.nan) / tau
    by_odometry = se3.log(told) / tau
    if log.by_imu:
        by_odometry[:, :3] = _smooth(seen[:, :3])
    return Steps(low, seen, by_odometry)


def _by_pictures(log: FilterLog, low: int, high: int, told: Poses) -> tuple[Poses, Flags]:
    """Returns the body's motions by the pictures, and which steps have enough points.

    The search starts from the filter's motion, from the odometry's, and from the best fit of the
    points in space; the result is the one with which most points agree.
    """
    frames = log.frames[low:high]
    count = len(frames)
    frame = np.repeat(np.arange(count), [len(m.ids) for m in frames])
    ids = np.concatenate([m.ids for m in frames]).astype(np.int64)
    pixels = np.concatenate([m.pixels for m in frames]).astype(np.float64).reshape(-1, 4)
    good = (np.abs(pixels) < PIXEL_MOST_PX).all(axis=1)  # and finite
    camera = log.header.camera
    seen = seen_pairs(Tracks.from_rows(count, frame[good], ids[good], pixels[good]), camera, 1)
    T_CB = Poses(np.asarray(log.header.R_CB), np.asarray(log.header.t_CB_m))
    there = se3.inverse(T_CB)

    def turned(A: Poses, steps: Poses, B: Poses) -> Poses:
        return se3.compose(se3.compose(A, se3.inverse(steps)), B)

    best, most = told, np.full(count - 1, -1.0)
    begins = [turned(T_CB, steps, there) for steps in (_by_filter(log, low, high), told)]
    for begin in (*begins, rigid(seen, camera)):
        found = estimate(seen, camera, begin)
        near = distance2(seen, camera, found) < NEAR_D2
        agree = np.bincount(seen.frame, near, minlength=count - 1)
        better = agree > most
        most = np.where(better, agree, most)
        best = Poses(
            np.where(better[:, None, None], found.R, best.R),
            np.where(better[:, None], found.p, best.p),
        )
    enough = (most >= PAIRS_MIN) & (3 * most >= 2 * seen.counts())  # else it is unknown
    return turned(there, best, T_CB), np.asarray(enough)


def _by_filter(log: FilterLog, low: int, high: int) -> Poses:
    """Returns the filter's motions from frame to frame; none where a frame was refused."""
    R, p = np.eye(3), np.zeros(3)
    rows = []
    for pose in log.poses[low:high]:
        if pose is not None:
            R, p = np.asarray(pose.R_WB), np.asarray(pose.p_WB_m)
        rows.append((R, p))
    poses = Poses(np.array([row[0] for row in rows]), np.array([row[1] for row in rows]))
    return se3.compose(se3.inverse(poses.at(slice(None, -1))), poses.at(slice(1, None)))


def _by_odometry(log: FilterLog, t: Times) -> Poses:
    """Returns the motions by twists, or by the gyro alone."""
    order = np.argsort(log.reading_ns, kind="stable")
    stamps, readings = log.reading_ns[order], log.readings[order]
    v = np.zeros_like(readings[:, :3]) if log.by_imu else readings[:, :3]
    poses = motion.path_at(t, stamps, v, readings[:, 3:], log.header.twist_timing)
    return se3.compose(se3.inverse(poses.at(slice(None, -1))), poses.at(slice(1, None)))


def _smooth(values: Floats) -> Floats:
    """Returns the moving median of eleven values, ignoring unknown ones."""
    out = np.full_like(values, np.nan)
    for k in range(len(values)):
        around = values[max(k - 5, 0) : k + 6]
        around = around[np.isfinite(around).all(axis=1)]
        if len(around):
            out[k] = np.median(around, axis=0)
    return out
