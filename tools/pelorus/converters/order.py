# SPDX-License-Identifier: MIT
"""Sorts a bag's messages by their stamps, and refuses a clock that was set back.

After it was set back two stretches of the drive have the same times. Where messages stand as they
came, the stamps go back. Where a recorder sorted them by arrival, which the same clock gave, they
are interleaved like the teeth of two combs, each with the period of the stream.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from pelorus.converters.bag import NS, Bag
from pelorus.io import arrays, foreign, stamps
from pelorus.math.motion import Times
from pelorus.wire.layout import Floats

TWICE = 1.5  # ratio of messages in a time that is covered twice to one covered once
TEETH_MIN = 8  # messages that a stretch needs, so that two combs are no stumble of the driver
SAME_PERIOD = 0.1  # tolerance of the period inside and outside the stretch
CHANCE = 1e-6  # probability that one drive looks like two
COMBS_SIGMA = 5.0  # by which steps alternate


class SetBack(NamedTuple):
    """A clock that was set back: by how much, and at which message.

    What arrived until the first time, or from the second on, is of one drive.
    """

    by_ns: int
    message: int
    until_ns: int
    from_ns: int


class Stamps(NamedTuple):
    """Stamps of messages as they stand in the file, with their numbers, where they hold any."""

    t_ns: Times
    arrival_ns: Times
    numbers: Floats | None = None

    def at(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> Stamps:
        numbers = None if self.numbers is None else self.numbers[index]
        return Stamps(self.t_ns[index], self.arrival_ns[index], numbers)


def sound(bag: Bag, topic: str, t_ns: Times, numbers: Floats) -> NDArray[np.bool_]:
    """Returns which messages have a time and finite numbers; refuses too many bad ones."""
    timed = ~arrays.never_set(t_ns) if t_ns.any() else np.zeros(len(t_ns), np.bool_)
    finite = np.asarray(np.isfinite(numbers).all(axis=1), np.bool_)
    instead = (
        "; times in header.stamp are expected, or --stamps log: those of the messages' arrival"
    )
    leave_out(bag, topic, ~timed, "headers have no time", instead)
    leave_out(bag, topic, ~finite, "messages hold a number that is not finite")
    return np.asarray(timed & finite)


def leave_out(bag: Bag, topic: str, bad: NDArray[np.bool_], wrong: str, instead: str = "") -> None:
    """Remarks that the bad messages are left out; refuses too many, and says what to do instead."""
    words = f"{bad.sum()} of {len(bad)} {wrong}"
    if bad.sum() > foreign.BAD_ROWS_MAX * len(bad):
        raise bag.error(topic, words + instead)
    if bad.any():
        bag.remarks.append(f"{topic}: {words}: left out")


def spread(bag: Bag, topic: str, given: Stamps) -> Stamps:
    """Returns the readings with times of their own where a driver gives a batch one stamp."""
    t_ns, numbers = given.t_ns, given.numbers
    if numbers is None or (np.diff(t_ns) < 0).any():
        return given
    once = np.sort(_without_copies(given))
    if (np.diff(t_ns[once]) == 0).sum() <= foreign.BAD_ROWS_MAX * len(once):
        return given
    found = stamps.spread(t_ns[once])
    bag.remarks.append(
        f"{topic}: {found.batch} readings have one stamp (the median): spread over the time since "
        "the ones before, the last one at its stamp"
    )
    return given.at(once)._replace(t_ns=found.t_ns)


def in_order(bag: Bag, topic: str, given: Stamps) -> NDArray[np.intp]:
    """Returns the messages to take, in the order of time; of those of one time the first.

    Refuses a clock that was set back.
    """
    t_ns = given.t_ns
    found = _written_back(given) or _interleaved(given.at(_without_copies(given)))
    if found is not None:
        until, later = (
            t / NS for t in (found.until_ns - bag.begins_ns, found.from_ns - bag.begins_ns)
        )
        raise bag.error(
            topic,
            f"stamps go back by {found.by_ns / NS:.4g} s at message {found.message}; was a clock "
            "set back, or are two recordings in one bag? Each must be converted alone: --until "
            f"{math.floor(until * 1e3) / 1e3:.3f} takes the first, --from "
            f"{math.ceil(later * 1e3) / 1e3:.3f} the second; if only the sensor's clock was set, "
            "--stamps log is expected",
        )
    behind = np.maximum.accumulate(t_ns) - t_ns
    if behind.any():
        bag.remarks.append(
            f"{topic}: {int((behind > 0).sum())} messages come late, by up to "
            f"{behind.max() * 1e-6:.3g} ms: put in the order of their stamps"
        )
    times, first = np.unique(t_ns, return_index=True)
    if given.numbers is not None:
        other = len(_without_copies(given)) - len(times)
        if other > foreign.BAD_ROWS_MAX * len(t_ns):
            raise bag.error(
                topic,
                f"{other} of {len(t_ns)} messages have other numbers at the time of the one "
                "before; a stamp for each reading is expected, or --stamps log",
            )
    if len(times) < len(t_ns):
        bag.remarks.append(
            f"{topic}: {len(t_ns) - len(times)} messages repeat a time and are left out"
        )
    return first


def _written_back(given: Stamps) -> SetBack | None:
    """Returns a clock set back where stamps go back and the time after is covered a second time."""
    t_ns, arrival_ns, _ = given
    latest = np.maximum.accumulate(t_ns)
    late = t_ns < latest
    starts = np.nonzero(late & ~np.concatenate(([False], late[:-1])))[0]
    steps = np.diff(t_ns)
    period = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    for k, end in zip(starts.tolist(), np.append(starts, len(t_ns))[1:].tolist(), strict=True):
        last = int(t_ns[k:end][late[k:end]].max())
        there = int(((t_ns >= t_ns[k]) & (t_ns <= last)).sum())
        if there > TWICE * ((last - t_ns[k]) / period + 1):
            until, later = int(arrival_ns[k:].min()) - 1, int(arrival_ns[:k].max()) + 1
            return SetBack(int(latest[k] - t_ns[k]), k, until, later)
    return None


def _without_copies(given: Stamps) -> NDArray[np.intp]:
    """Returns the order of time, without duplicate messages, as from two recorders.

    Without numbers to compare, all that repeat a time are left out.
    """
    order, numbers = np.argsort(given.t_ns, kind="stable"), given.numbers
    same = np.diff(given.t_ns[order]) == 0
    if numbers is not None:
        same &= (numbers[order[1:]] == numbers[order[:-1]]).all(axis=1)
    return order[~np.concatenate(([False], same))]


def _interleaved(given: Stamps) -> SetBack | None:
    """Returns a clock set back if sorted stamps are twice as dense in a stretch.

    There they must form two combs, or numbers of two drives.
    """
    t_ns, arrival_ns, numbers = given
    steps = np.diff(t_ns).astype(np.float64)
    if len(steps) < 2 * TEETH_MIN:
        return None
    usual = float(np.percentile(steps, 90))
    dense = np.concatenate(([False], steps[1:] + steps[:-1] < TWICE * usual, [False]))
    edges = np.nonzero(np.diff(dense.astype(np.int8)))[0]
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        inside, outside = steps[begin : end + 1], np.delete(steps, slice(begin, end + 1))
        if len(inside) < TEETH_MIN or not len(outside):
            continue
        period, alone = 2 * float(inside.mean()), float(np.median(outside))
        if abs(period - alone) > SAME_PERIOD * alone:
            continue
        own = None if numbers is None else numbers[begin : end + 2]
        if _are_combs(inside) or (own is not None and _are_two_drives(own)):
            until, later = int(arrival_ns[begin]) - 1, int(arrival_ns[end + 1]) + 1
            by_ns, at = int(t_ns[end + 1] - t_ns[begin]), begin + (end - begin + 1) // 2
            return SetBack(by_ns, at, until, later)
    return None


def _are_combs(steps: Floats) -> bool:
    """Returns whether steps alternate between short and long."""
    even, odd = steps[::2], steps[1::2]
    chance = np.sqrt(even.var() / len(even) + odd.var() / len(odd))
    return bool(abs(even.mean() - odd.mean()) > max(COMBS_SIGMA * chance, 1))


def _are_two_drives(numbers: Floats) -> bool:
    """Returns whether messages resemble the second next one more than the next one.

    In one drive they resemble the next one as much, but for noise, or more.
    """
    scale = np.maximum(numbers.std(axis=0), np.finfo(float).tiny)
    near, far = (float(np.sum((np.diff(x, axis=0) / scale) ** 2)) for x in (numbers, numbers[::2]))
    far += float(np.sum((np.diff(numbers[1::2], axis=0) / scale) ** 2))
    count = len(numbers)
    return near > float(scipy.special.fdtri(count, count, 1 - CHANCE)) * far
