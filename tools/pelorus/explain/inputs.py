# SPDX-License-Identifier: MIT
"""Finds faults of readings, pictures, tracks and stamps themselves, and of small sensors.

They do not depend on the filter's opinion, except on whether the body moved. After a gap of the
stamps the pictures tell a pause from a step of the clock: while the camera does not see, the body
moves on; if the picture has moved no more than from frame to frame, no time has passed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy

from pelorus.explain.log import (
    CONTRADICTED,
    FEW,
    NO_READING,
    Cause,
    FilterLog,
    Incident,
    S,
    joined_runs,
    period,
    suspect,
)
from pelorus.io.small_sensors import name_of
from pelorus.math.motion import Times, runs
from pelorus.tracking.visual_motion import PAIRS_MIN
from pelorus.wire.frames import Message, Reading
from pelorus.wire.layout import Floats
from pelorus.wire.schema import SENSORS, number

FROZEN_IMAGE = number("reason", "FROZEN_IMAGE")
AXES = "xyz"


def of_inputs(log: FilterLog) -> Iterator[Incident]:
    """Yields all findings on stamps, readings, pictures and tracks."""
    yield from clock_steps(log)
    yield from gaps(log)
    yield from backwards(log)
    yield from stuck(log)
    yield from shocks(log)
    yield from frozen(log)
    yield from lost_tracks(log)


# --- readings -------------------------------------------------------------------------------------

STUCK_S, STUCK_READINGS = 0.5, 5
BY_CHANCE = 1e-6  # expected number of such stretches in the drive if readings repeat by chance


def stuck(log: FilterLog) -> Iterator[Incident]:
    """Yields axes that repeat one number for long, and otherwise change from reading to reading.

    Wheels at rest read zero: that is reported where the pictures contradict it, and for a turn rate
    where the body moves on.
    """
    blocks = (
        (Cause.DEAD_ACCELEROMETER, "accelerometer", 0)
        if log.by_imu
        else (Cause.DEAD_ODOMETRY, "velocity of the odometry", 0),
        (Cause.DEAD_GYRO, "turn rate", 3),
    )
    for cause, name, begins in blocks:
        together: dict[tuple[int, int], list[int]] = {}
        for axis in range(begins, begins + 3):
            for stretch in _repeats(log, axis):
                together.setdefault(stretch, []).append(axis)
        for (first, last), axes in sorted(together.items()):
            begin, end = int(log.reading_ns[first]), int(log.reading_ns[last])
            value = log.readings[first, axes]
            goes = cause is Cause.DEAD_GYRO and not log.by_imu and _goes(log, first, last)
            if value.any() or log.by_imu or goes or _contradicted(log, begin, end):
                numbers = ", ".join(
                    f"{AXES[axis % 3]} at {x:.3g}" for axis, x in zip(axes, value, strict=True)
                )
                words = f"the {name} is stuck for {last - first + 1} readings: {numbers}"
                yield Incident(cause, begin, end, words)


def _repeats(log: FilterLog, axis: int) -> Iterator[tuple[int, int]]:
    """Yields first and last reading of each stretch of one number that is too long for chance."""
    same = np.diff(log.readings[:, axis]) == 0
    for first, last in runs(same):
        length = last - first + 1
        lasts = log.reading_ns[last + 1] - log.reading_ns[first] >= STUCK_S * S
        if length < STUCK_READINGS or not lasts:
            continue
        others = np.delete(same, slice(first, last + 1))
        share = (np.count_nonzero(others) + 1) / (len(others) + 2)
        if len(same) * share**length < BY_CHANCE:
            yield first, last + 1


def _goes(log: FilterLog, first: int, last: int) -> bool:
    return bool(log.readings[first : last + 1, :3].any(axis=1).mean() > 0.5)


def _contradicted(log: FilterLog, begin: int, end: int) -> bool:
    meanwhile = (log.t_ns >= begin) & (log.t_ns <= end)
    return bool((log.said(CONTRADICTED) & meanwhile).any())


FAR = 10.0  # factor of the deviation that 19 of 20 readings stay within
NEIGHBOURHOOD_S = 2.0  # shorter than a slip, longer than an impact
HIT_MOST_S = 1.0
JOINED_NS = S // 2  # stretches with a gap of no more are one


def shocks(log: FilterLog) -> Iterator[Incident]:
    """Yields readings far from the median of their neighbourhood, for less than a second."""
    if len(log.readings) < 2 * STUCK_READINGS:
        return
    window = max(round(NEIGHBOURHOOD_S * S / max(period(log.reading_ns), 1.0)), STUCK_READINGS)
    window = min(window, len(log.readings)) | 1
    off = np.abs(
        log.readings - scipy.ndimage.median_filter(log.readings, (window, 1), mode="nearest")
    )
    usual = np.quantile(off, 0.95, axis=0)
    times = np.divide(off, usual, out=np.zeros_like(off), where=usual > 0)
    for first, last in joined_runs(times.max(axis=1) > FAR, log.reading_ns, JOINED_NS):
        begin, end = int(log.reading_ns[first]), int(log.reading_ns[last])
        if end - begin <= HIT_MOST_S * S and _suffered(log, begin, end):
            yield Incident(Cause.SHOCK, begin, end, _hit(log, times, first, last))


def _suffered(log: FilterLog, begin: int, end: int) -> bool:
    """Returns whether a reading was refused or a frame suspect, then or soon after.

    Otherwise the filter coped with it.
    """
    refused = any(begin <= report.t_ns <= end for report in log.refused)
    meanwhile = (log.t_ns >= begin) & (log.t_ns <= end + S)
    return refused or bool((suspect(log) & meanwhile).any())


def _hit(log: FilterLog, times: Floats, first: int, last: int) -> str:
    row, axis = np.unravel_index(np.argmax(times[first : last + 1]), (last - first + 1, 6))
    value = log.readings[first + int(row), axis]
    quantity = ("acceleration" if log.by_imu else "velocity", "m/s²" if log.by_imu else "m/s")
    name, unit = quantity if axis < 3 else ("turn rate", "rad/s")
    count = last - first + 1
    said = f"{count} readings" if count > 1 else "one reading"
    return (
        f"a shock, or damaged readings: {said} far from their neighbours, {name} "
        f"{AXES[axis % 3]} {value:.3g} {unit}"
    )


# --- pictures -------------------------------------------------------------------------------------


def frozen(log: FilterLog) -> Iterator[Incident]:
    """Yields stretches of identical pixels in which the filter knows that the body moved."""
    same = (log.shared >= FEW) & (2 * log.repeated >= log.shared)
    told = log.said(FROZEN_IMAGE)
    for first, last in runs(same):
        if told[first : last + 1].any():
            repeat = f"{last - first + 1} frames repeat the pixels of the first"
            yield log.incident(
                Cause.FROZEN_PICTURE, first, last, f"the picture is frozen: {repeat}"
            )


HABIT_S = 10.0  # what happens more often is no event, but how the front end works
TRACKED = 2 * FEW  # points that a frame mostly shares with the one before, where tracks can be lost


def losses(log: FilterLog) -> list[tuple[int, int]]:
    """Returns stretches of frames that share unusually few points with the ones before."""
    few = log.shared < FEW
    few[0] = False
    out = []
    for first, last in runs(few):
        before = log.shared[max(first - 2 * BEFORE, 1) : first]
        if len(before) and np.median(before) >= TRACKED:
            out.append((first, last))
    return out


def is_habit(log: FilterLog, lost: list[tuple[int, int]], length: int) -> bool:
    """Returns whether losses of at least this length come more often than every ten seconds."""
    whole_s = float(log.t_ns.max() - log.t_ns.min()) / S
    return sum(last - first >= length for first, last in lost) > max(whole_s / HABIT_S, 2.0)


def lost_tracks(log: FilterLog) -> Iterator[Incident]:
    """Yields frames to which no point was followed: darkness, blur, a tracker that restarted."""
    lost = losses(log)
    for first, last in lost:
        if is_habit(log, lost, last - first):
            continue
        dark = int(np.median([len(f.ids) for f in log.frames[first : last + 1]])) < FEW
        before = int(np.median(log.shared[max(first - BEFORE, 1) : first]))
        what = "few points in sight" if dark else "all points have new ids"
        frames = f"{last - first + 1} frames" if last > first else "one frame"
        words = f"tracks lost, {what}: {frames}; {before} points were followed before"
        yield log.incident(Cause.LOST_TRACKS, first, last, words)


REJECTED_FRAMES = 2  # frames: a single one is no event


def rejected(log: FilterLog) -> Iterator[Incident]:
    """Yields stretches of frames in which the gate rejects most observations."""
    matched, gated = log.column("matched"), log.column("gated")
    most = (matched >= PAIRS_MIN) & (2 * gated > matched)
    for first, last in runs(most):
        count = last - first + 1
        if count < REJECTED_FRAMES:
            continue
        share = gated[first : last + 1].sum() / matched[first : last + 1].sum()
        words = (
            f"the gate rejects {share:.0%} of the matches for {count} frames: blur, wrong matches, "
            "or much that moves by itself"
        )
        yield log.incident(Cause.WRONG_MATCHES, first, last, words)


# --- small sensors --------------------------------------------------------------------------------


REJECTED = number("reason", "READINGS_REJECTED")
FRAMES_LEAST = 2  # frames: a single one is no event


def of_small(log: FilterLog, messages: Sequence[Message]) -> Iterator[Incident]:
    """Yields stretches of frames with rejected readings, with sensors and the wheels' error."""
    readings = [m for m in messages if isinstance(m, Reading)]
    for first, last in runs(log.said(REJECTED)):
        begin, end = int(log.t_ns[max(first - 1, 0)]), int(log.t_ns[last])
        meanwhile = [m for m in readings if begin <= m.t_ns <= end]
        if last - first + 1 < FRAMES_LEAST or not meanwhile:
            continue
        names = ", ".join(sorted({name_of(m.sensor) for m in meanwhile}))
        words = f"readings of {names} are rejected, or off by more than their sigma"
        yield Incident(Cause.READINGS_OFF, begin, end, words + _rolled(log, meanwhile))


def _rolled(log: FilterLog, readings: Sequence[Reading]) -> str:
    """Returns the forward speed by wheels and by the filter, in words."""
    ahead = [m for m in readings if m.sensor == SENSORS["wheel"] and m.axes & 1]
    poses = [pose for pose in log.poses if pose is not None]
    if not ahead or not poses:
        return ""
    at = np.searchsorted([pose.t_ns for pose in poses], [m.t_ns for m in ahead])
    known = [poses[k].v_B_mps[0] for k in np.minimum(at, len(poses) - 1)]
    wheels = float(np.median([m.value[0] for m in ahead]))
    return f": wheels {wheels:.2f} m/s ahead where the body goes {np.median(known):.2f} m/s"


# --- stamps ---------------------------------------------------------------------------------------


BEFORE, AFTER = 10, 5  # frames whose median shows what is usual before and after
MAD = 1.4826  # of a normal distribution: sigma over the median absolute deviation
JITTER_SIGMAS = 8.0  # no chance changes a stamp's lead by more


def clock_steps(log: FilterLog) -> Iterator[Incident]:
    """Yields steps of the frames' stamps against the readings', while they still arrive between
    these.

    The lead of a frame's stamp over the newest reading varies by a period of the readings, and by
    the log's usual jitter. A step is larger, and lasts.
    """
    known = np.nonzero(log.behind_ns != NO_READING)[0]
    if len(known) < BEFORE:
        return
    behind = log.behind_ns[known]
    ahead = (log.t_ns[known] - behind).astype(np.float64)
    frame_step, reading_step = np.diff(log.t_ns[known]), np.diff(behind)
    usual = float(np.median(np.abs(frame_step)))
    least = max(2 * period(log.reading_ns), JITTER_SIGMAS * _jitter(ahead))
    for k in np.nonzero(np.abs(np.diff(ahead)) > least)[0] + 1:
        before, after = ahead[max(k - BEFORE, 0) : k], ahead[k : k + AFTER]
        if behind[k : k + AFTER][-1] == behind[-1]:
            continue  # the readings have ended
        by = float(np.median(after) - np.median(before))
        if abs(by) <= least or np.ptp(before) > abs(by) / 2 or np.ptp(after) > abs(by) / 2:
            continue
        of_frames = abs(frame_step[k - 1] - usual) > abs(reading_step[k - 1] - usual)
        whose, others = ("frames", "readings") if of_frames else ("readings", "frames")
        which = "forward" if (by > 0) == of_frames else "back"
        at = int(log.arrived_ns[known[k]] if of_frames else log.t_ns[known[k]])
        words = f"the stamps of the {whose} step {which} by {abs(by) / S:.3f} s"
        yield Incident(Cause.CLOCK_STEP, at, at, f"{words} against the {others}'")


def _jitter(ahead: Floats) -> float:
    """Returns the sigma of the lead from frame to frame; a single step does not affect it."""
    change = np.diff(ahead)
    return MAD * float(np.median(np.abs(change - np.median(change))))


PAUSE_S = 1.0  # without a frame, after which the filter reports it
PERIODS = 10  # missing ones: one or two are lost on any bus
SAME_FLOW = 3.0  # ratio to the picture's motion between frames; ten periods make far more
MOVES_PX = 1.0  # a smaller motion of the picture shows no time


def gaps(log: FilterLog) -> Iterator[Incident]:
    """Yields long gaps without a frame, or without a reading."""
    name = "IMU reading" if log.by_imu else "twist"
    for begin, end, _ in _long(log.reading_ns):
        if _between(log.t_ns, begin, end):  # a gap of both is reported as one of the frames
            words = f"no {name} for {(end - begin) / S:.1f} s"
            yield Incident(Cause.NO_READINGS, begin, end, words)
    for begin, end, k in _long(log.t_ns):
        long = f"{(end - begin) / S:.1f} s"
        alone = not _between(log.reading_ns, begin, end)
        if _no_time_passed(log, k):
            whose = "all stamps step" if alone else "the stamps of the frames step"
            words = f"{whose} forward by {long}, and the pictures go on as if no time had passed"
            yield Incident(Cause.CLOCK_STEP, begin, begin, words)
            continue
        both = f"neither frames nor {name}s for {long}: a pause, or a step of the clock of both"
        yield Incident(Cause.NO_FRAMES, begin, end, both if alone else f"no frame for {long}")


def _long(t_ns: Times) -> Iterator[tuple[int, int, int]]:
    """Yields begin and end of each gap, and the number of what came before it."""
    step = np.diff(t_ns)
    for k in np.nonzero(step > max(PAUSE_S * S, PERIODS * period(t_ns)))[0]:
        yield int(t_ns[k]), int(t_ns[k + 1]), int(k)


def _between(t_ns: Times, begin: int, end: int) -> bool:
    return bool(((t_ns > begin) & (t_ns < end)).any())


def _no_time_passed(log: FilterLog, k: int) -> bool:
    around = np.concatenate(
        (log.flow_px[max(k - BEFORE, 0) : k + 1], log.flow_px[k + 2 : k + BEFORE])
    )
    around = around[np.isfinite(around)]
    if not len(around) or not np.isfinite(log.flow_px[k + 1]):
        return False
    usual = float(np.median(around))
    return usual > MOVES_PX and bool(log.flow_px[k + 1] < SAME_FLOW * usual)


def backwards(log: FilterLog) -> Iterator[Incident]:
    """Yields stamps that go back. A step of frames against readings is reported by clock_steps."""
    name = "IMU readings" if log.by_imu else "twists"
    streams = [(log.reading_ns, name)]
    if (log.behind_ns == NO_READING).all():
        streams.append((log.t_ns, "frames"))
    for t, whose in streams:
        back = np.nonzero(np.diff(t) < 0)[0]
        if len(back):
            at = int(t[back[0]])
            by_s = int(t[back[0]] - t[back[0] + 1]) / S
            words = f"the stamps of the {whose} go back by {by_s:.3f} s"
            yield Incident(Cause.CLOCK_STEP, at, at, words)
