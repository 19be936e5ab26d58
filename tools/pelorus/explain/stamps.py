# SPDX-License-Identifier: MIT
"""Finds faults of the clocks: steps, and pauses of a sensor.

After a gap the pictures tell them apart: while the camera does not see, the body moves on. If the
picture has moved no more than from frame to frame, no time has passed.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pelorus.explain.incident import Cause, Incident, S
from pelorus.explain.log import NO_READING, FilterLog, period
from pelorus.math.motion import Times
from pelorus.wire.layout import Floats

BEFORE, AFTER = 10, 5  # frames whose median gives the lead before and after
MAD = 1.4826  # of a normal distribution: sigma over the median absolute deviation
JITTER_SIGMAS = 8.0  # no chance changes a stamp's lead by more


def of_stamps(log: FilterLog) -> Iterator[Incident]:
    """Yields all findings on the clocks."""
    yield from clock_steps(log)
    yield from gaps(log)
    yield from backwards(log)


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
        words = (
            f"the stamps of the {whose} step {which} by {abs(by) / S:.3f} s against the {others}'"
        )
        yield Incident(Cause.CLOCK_STEP, at, at, words)


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
