# SPDX-License-Identifier: MIT
"""What is wrong with the inputs themselves: stamps, readings, pictures, tracks. Nothing of it needs
the filter's opinion but whether the body moved.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import median_filter

from pelorus.explain.finding import Cause, Finding, S
from pelorus.explain.log import CONTRADICTED, FEW, NO_READING, Flags, Log, runs, suspect
from pelorus.layout import Floats
from pelorus.motion import Times
from pelorus.schema import number

FROZEN_IMAGE = number("reason", "FROZEN_IMAGE")
AXES = "xyz"


def of_inputs(log: Log) -> Iterator[Finding]:
    """All of it."""
    yield from clock_steps(log)
    yield from pauses(log)
    yield from stuck(log)
    yield from shocks(log)
    yield from frozen(log)
    yield from lost_tracks(log)


# --- stamps ---------------------------------------------------------------------------------------

BEFORE, AFTER = 10, 5  # frames whose median tells how stamps stood, and stand


def clock_steps(log: Log) -> Iterator[Finding]:
    """Frames come between readings as before, and their stamps have moved against the readings'.

    By how much a frame's stamp is ahead of the newest reading varies by a period at most, of frames
    or of readings. A step is more, and lasts.
    """
    known = np.nonzero(log.behind_ns != NO_READING)[0]
    if len(known) < BEFORE:
        return
    ahead = (log.t_ns - log.behind_ns)[known]
    frame_step, reading_step = np.diff(log.t_ns[known]), np.diff(log.behind_ns[known])
    usual = float(np.median(np.abs(frame_step)))
    period = max(usual, _period(log.reading_ns))
    for k in np.nonzero(np.abs(np.diff(ahead)) > period)[0] + 1:
        before, after = ahead[max(k - BEFORE, 0) : k], ahead[k : k + AFTER]
        by = float(np.median(after) - np.median(before))
        if abs(by) <= period or np.ptp(before) > abs(by) / 2 or np.ptp(after) > abs(by) / 2:
            continue
        of_frames = abs(frame_step[k - 1] - usual) > abs(reading_step[k - 1] - usual)
        whose = "frames" if of_frames else "readings"
        which = "forward" if (by > 0) == of_frames else "back"
        at = int(log.arrived_ns[known[k]] if of_frames else log.t_ns[known[k]])
        yield Finding(
            Cause.CLOCK_STEP,
            at,
            at,
            f"the stamps of the {whose} step {which} by {abs(by) / S:.3f} s against the "
            f"{'readings' if of_frames else 'frames'}'",
        )


PAUSE_S = 1.0  # after so long without a frame the filter says so
PERIODS = 10  # that fail: one or two are lost on any bus


def pauses(log: Log) -> Iterator[Finding]:
    """No frame, or no reading, for long."""
    both = log.reading_ns, log.t_ns
    names = ("IMU reading" if log.by_imu else "twist"), "frame"
    for cause, t, other, name in (
        (Cause.NO_READINGS, *both, names[0]),
        (Cause.NO_FRAMES, *both[::-1], names[1]),
    ):
        if not len(t):
            continue
        step = np.diff(t)
        long = step > max(PAUSE_S * S, PERIODS * _period(t))
        for k in np.nonzero(long)[0]:
            begin, end = int(t[k]), int(t[k + 1])
            meanwhile = int(np.count_nonzero((other > begin) & (other < end)))
            if cause is Cause.NO_READINGS and not meanwhile:
                continue  # neither came: it is told of the frames
            words = f"no {name} for {(end - begin) / S:.1f} s"
            if not meanwhile:
                words = f"neither frames nor readings for {(end - begin) / S:.1f} s: a pause, or "
                words += "a step of the clock of both"
            yield Finding(cause, begin, end, words)
        back = np.nonzero(step < 0)[0]
        if len(back) and (cause is Cause.NO_READINGS or not _steps_back_known(log)):
            at = int(t[back[0]])
            words = f"the stamps of the {name}s go back by {-step[back[0]] / S:.3f} s"
            yield Finding(Cause.CLOCK_STEP, at, at, words)


def _steps_back_known(log: Log) -> bool:
    """A frame's stamp that goes back against the readings is told as a step."""
    return bool((log.behind_ns != NO_READING).any())


def _period(t_ns: Times) -> float:
    return float(np.median(np.abs(np.diff(t_ns)))) if len(t_ns) > 1 else 0.0


# --- readings -------------------------------------------------------------------------------------

STUCK_S, STUCK_READINGS = 0.5, 5
REPEATS_MOST = 0.05  # of the other readings: a sensor that repeats itself often says nothing so


def stuck(log: Log) -> Iterator[Finding]:
    """A vector that else changes with every reading reads the very same numbers for long.

    Zeros are what wheels at rest read: they are told where the pictures contradict them, and of a
    turn rate where the body goes on.
    """
    blocks = (
        (Cause.DEAD_ACCELEROMETER, "accelerometer", slice(0, 3))
        if log.by_imu
        else (Cause.DEAD_ODOMETRY, "velocity of the odometry", slice(0, 3)),
        (Cause.DEAD_GYRO, "turn rate", slice(3, 6)),
    )
    for cause, name, block in blocks:
        values = log.readings[:, block]
        if len(values) < 2 * STUCK_READINGS:
            continue
        same = (np.diff(values, axis=0) == 0).all(axis=1)
        for first, last in runs(same):
            begin, end = int(log.reading_ns[first]), int(log.reading_ns[last + 1])
            if last - first + 1 < STUCK_READINGS or end - begin < STUCK_S * S:
                continue
            others = np.delete(same, slice(first, last + 1))
            varies = len(others) and others.mean() < REPEATS_MOST
            value = values[first]
            goes = cause is Cause.DEAD_GYRO and not log.by_imu and _goes(log, first, last)
            if varies and (value.any() or log.by_imu or goes or _contradicted(log, begin, end)):
                numbers = " ".join(f"{x:.3g}" for x in value)
                at = "at zero" if not value.any() else f"at ({numbers})"
                words = f"the {name} is stuck {at} for {last - first + 2} readings, all axes"
                yield Finding(cause, begin, end, words)


def _goes(log: Log, first: int, last: int) -> bool:
    return bool(log.readings[first : last + 2, :3].any(axis=1).mean() > 0.5)


def _contradicted(log: Log, begin: int, end: int) -> bool:
    meanwhile = (log.t_ns >= begin) & (log.t_ns <= end)
    return bool((log.said(CONTRADICTED) & meanwhile).any())


FAR = 10.0  # times what 19 of 20 readings differ from their neighbourhood's median
NEIGHBOURHOOD_S = 2.0  # shorter than a slip, longer than a hit
HIT_MOST_S = 1.0


def shocks(log: Log) -> Iterator[Finding]:
    """Readings far from the median of their neighbourhood, for less than a second."""
    if len(log.readings) < 2 * STUCK_READINGS:
        return
    window = max(round(NEIGHBOURHOOD_S * S / max(_period(log.reading_ns), 1.0)), STUCK_READINGS)
    window = min(window, len(log.readings)) | 1
    off = np.abs(log.readings - median_filter(log.readings, (window, 1), mode="nearest"))
    usual = np.quantile(off, 0.95, axis=0)
    times = np.divide(off, usual, out=np.zeros_like(off), where=usual > 0)
    for first, last in _joined(times.max(axis=1) > FAR, log.reading_ns):
        begin, end = int(log.reading_ns[first]), int(log.reading_ns[last])
        if end - begin <= HIT_MOST_S * S and _suffered(log, begin, end):
            yield Finding(Cause.SHOCK, begin, end, _hit(log, times, first, last))


def _suffered(log: Log, begin: int, end: int) -> bool:
    """Whether a reading was refused, or a frame found odd, meanwhile or soon after: else the filter
    took it in its stride.
    """
    refused = any(begin <= report.t_ns <= end for report in log.refused)
    meanwhile = (log.t_ns >= begin) & (log.t_ns <= end + S)
    return refused or bool((suspect(log) & meanwhile).any())


def _hit(log: Log, times: Floats, first: int, last: int) -> str:
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
    """Stretches of yes, those within half a second as one."""
    out: list[tuple[int, int]] = []
    for first, last in runs(flags):
        if out and t_ns[first] - t_ns[out[-1][1]] <= S // 2:
            out[-1] = (out[-1][0], last)
        else:
            out.append((first, last))
    return out


# --- pictures -------------------------------------------------------------------------------------


def frozen(log: Log) -> Iterator[Finding]:
    """The same pixels again, and the filter knows that the body moved."""
    same = (log.shared >= FEW) & (2 * log.repeated >= log.shared)
    told = log.said(FROZEN_IMAGE)
    for first, last in runs(same):
        if told[first : last + 1].any():
            words = (
                f"the picture is frozen: {last - first + 1} frames repeat the pixels of the first"
            )
            yield Finding(Cause.FROZEN_PICTURE, int(log.t_ns[first]), int(log.t_ns[last]), words)


HABIT_S = 10.0  # what happens more often than that is no event, it is how the front end works
TRACKED = 2 * FEW  # points that a frame mostly shares with the one before, where tracks can be lost


def losses(log: Log) -> list[tuple[int, int]]:
    """Frames in a row that share too few points with the ones before, where it was otherwise."""
    few = log.shared < FEW
    few[0] = False
    out = []
    for first, last in runs(few):
        before = log.shared[max(first - 2 * BEFORE, 1) : first]
        if len(before) and np.median(before) >= TRACKED:
            out.append((first, last))
    return out


def is_habit(log: Log, lost: list[tuple[int, int]], length: int) -> bool:
    """Whether losses of at least this length come more often than every ten seconds."""
    whole_s = float(log.t_ns.max() - log.t_ns.min()) / S
    return sum(last - first >= length for first, last in lost) > max(whole_s / HABIT_S, 2.0)


def lost_tracks(log: Log) -> Iterator[Finding]:
    """No point is followed from a frame to the next: darkness, blur, a tracker that began anew."""
    lost = losses(log)
    for first, last in lost:
        if is_habit(log, lost, last - first):
            continue
        dark = int(np.median([len(f.ids) for f in log.frames[first : last + 1]])) < FEW
        before = int(np.median(log.shared[max(first - BEFORE, 1) : first]))
        what = "few points in sight" if dark else "all points have new ids"
        frames = f"{last - first + 1} frames" if last > first else "one frame"
        words = f"tracks lost, {what}: {frames}; {before} points were followed before"
        yield Finding(Cause.LOST_TRACKS, int(log.t_ns[first]), int(log.t_ns[last]), words)
