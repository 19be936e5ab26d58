# SPDX-License-Identifier: MIT
"""Finds faults of readings, pictures and tracks themselves.

They do not depend on the filter's opinion, except on whether the body moved.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy

from pelorus.explain.incident import Cause, Incident, S
from pelorus.explain.log import CONTRADICTED, FEW, FilterLog, Flags, period, runs, suspect
from pelorus.math.motion import Times
from pelorus.tracking.visual_motion import PAIRS_MIN
from pelorus.wire.layout import Floats
from pelorus.wire.schema import number

FROZEN_IMAGE = number("reason", "FROZEN_IMAGE")
AXES = "xyz"


def of_inputs(log: FilterLog) -> Iterator[Incident]:
    """Yields all findings on the inputs."""
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
    for first, last in _joined(times.max(axis=1) > FAR, log.reading_ns):
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


def _joined(flags: Flags, t_ns: Times) -> list[tuple[int, int]]:
    """Returns the stretches of True, joined across gaps of half a second."""
    out: list[tuple[int, int]] = []
    for first, last in runs(flags):
        if out and t_ns[first] - t_ns[out[-1][1]] <= S // 2:
            out[-1] = (out[-1][0], last)
        else:
            out.append((first, last))
    return out


# --- pictures -------------------------------------------------------------------------------------


def frozen(log: FilterLog) -> Iterator[Incident]:
    """Yields stretches of identical pixels in which the filter knows that the body moved."""
    same = (log.shared >= FEW) & (2 * log.repeated >= log.shared)
    told = log.said(FROZEN_IMAGE)
    for first, last in runs(same):
        if told[first : last + 1].any():
            words = (
                f"the picture is frozen: {last - first + 1} frames repeat the pixels of the first"
            )
            yield Incident(Cause.FROZEN_PICTURE, int(log.t_ns[first]), int(log.t_ns[last]), words)


BEFORE = 10  # frames that show how many points are usually followed
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
        yield Incident(Cause.LOST_TRACKS, int(log.t_ns[first]), int(log.t_ns[last]), words)


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
        yield Incident(Cause.WRONG_MATCHES, int(log.t_ns[first]), int(log.t_ns[last]), words)
