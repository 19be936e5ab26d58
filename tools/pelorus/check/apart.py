# SPDX-License-Identifier: MIT
"""Do parts of the points tell the same motion? What the likelihood of single steps cannot see.

Noise that a track keeps through its life, a lens that is bent in a corner, a car that moves along:
the points of a region are then off alike, in every frame. Such errors do not average out, the
filter believes that they do, and each next innovation is as small as ever. But a filter that is
given half of the points goes elsewhere than one that is given all, and by how much it may is known:
where the noise is what the settings say, the difference of an estimate from half of the data to the
best one from all of it has the covariance P_half - P_all, whatever noise (of the twists) both share
(Hausman, Specification tests in econometrics, 1978). So the drive is cut into windows, each
window's points into halves, left and right, upper and lower, near and far, and at random; each
half's poses are compared with those from all points. 1 is expected. Where they are farther apart,
the noises are made larger until they are not (halves_alike.py). A drive by an IMU is one window:
each window would have to find the vertical and its speed anew.

An error that all points share alike (a baseline, a mounting) moves no half beside another: it stays
unseen.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.check.contents import AHEAD, Frames, recording_of
from pelorus.check.options import Settings, options_of
from pelorus.evaluate.evaluation import world_laid
from pelorus.io.tracks import Tracks
from pelorus.io.trajectory import Trajectory, estimate_in
from pelorus.math import se3
from pelorus.native.replay import NothingUsefulError, stuffed_answers, threads
from pelorus.program.console import progress
from pelorus.wire import framing
from pelorus.wire.frames import Imu, Kind, Message, Reading, Start, Stereo, Twist
from pelorus.wire.layout import Floats
from pelorus.wire.settings import CALIBRATION_SIGMAS

WINDOW_FRAMES, WINDOWS_MOST = 60, 12
SETTLED = 3  # frames at the beginning of a window that are not compared
ENOUGH = 60  # a window with fewer comparable numbers is left out
TELLS = 0.1  # least share of a direction's variance that the left-out half adds
DOF = 6  # independent numbers of a window: its poses are one walk
MEDIAN = 0.89  # median of chi-square with 6 degrees of freedom, divided by its mean
SURE = 3.0  # standard deviations
FILTERS_OWN = 2.0  # the filter is not optimal: up to 1.8 was seen with white noise

Estimate = tuple[Trajectory, Floats]
Masks = dict[str, NDArray[np.bool_]]


@dataclass(frozen=True)
class HalvesApart:
    """How far apart the halves are, as a ratio of squares, for each way of splitting the points."""

    by_way: dict[str, float]
    windows: int

    @property
    def way(self) -> str:
        return max(self.by_way, key=lambda way: self.by_way[way])

    @property
    def ratio(self) -> float:
        """Returns the largest ratio of all ways: errors that one way separates, another mixes."""
        return max(self.by_way.values(), default=float("nan"))

    @property
    def expected(self) -> float:
        """Returns the ratio expected of white noise: the largest of four, a sigma above the
        mean.
        """
        return 1 + self._chance

    @property
    def by_chance(self) -> float:
        """Returns the ratio that white noise and the filter's own approximations seldom exceed."""
        return max(1 + SURE * self._chance, FILTERS_OWN)

    @property
    def _chance(self) -> float:
        return float(np.sqrt(2 / (DOF * max(self.windows, 1))))


class Inflated(NamedTuple):
    """The factor of the noises, and how far apart the halves are without and with it."""

    times: float
    before: HalvesApart
    after: HalvesApart

    @property
    def is_larger(self) -> bool:
        return self.times > 1


class _Part(NamedTuple):
    window: int
    way: str  # empty: all points
    path: Path


# Both halves share every error of the calibration, so its sigmas are off here.
SAME_CAMERA = dict.fromkeys(CALIBRATION_SIGMAS, "0")


class Parts:
    """Windows and halves of a recording, written to files once and replayed with many settings."""

    def __init__(self, program: Path, messages: Sequence[Message], folder: Path) -> None:
        self._program = program
        self._folder = folder
        self._parts: list[_Part] = []
        spread = list(windows(messages))
        chosen = np.unique(np.linspace(0, len(spread) - 1, WINDOWS_MOST).round().astype(int))
        for k in progress(chosen.tolist(), "halves of the points", len(chosen)):
            self._write(k, spread[k])

    def _write(self, k: int, window: list[Message]) -> None:
        ids, masks = halves(recording_of(window).tracks)
        frames = Frames(window)
        self._add(k, "", window, frames)
        for way, first in masks.items():
            self._add(k, way, of_points(window, ids[first]), frames)
            self._add(k, way, of_points(window, ids[~first]), frames)

    def _add(self, k: int, way: str, messages: list[Message], frames: Frames) -> None:
        path = self._folder / f"part-{len(self._parts)}.plr"
        frames.write(path, messages)
        self._parts.append(_Part(k, way, path))

    def apart(self, settings: Settings) -> HalvesApart:
        """Returns how far apart halves are with these settings, by windows with enough data."""
        options = options_of({**settings, **SAME_CAMERA})
        with ThreadPoolExecutor(threads()) as pool:
            ran = pool.map(lambda part: self._estimate(part, options), self._parts)
            estimates = list(progress(ran, "halves of the points", len(self._parts)))
        whole = {p.window: e for p, e in zip(self._parts, estimates, strict=True) if not p.way}
        compared: dict[tuple[str, int], list[tuple[float, int]]] = {}
        for part, estimate in zip(self._parts, estimates, strict=True):
            all_points = whole[part.window]
            if part.way and estimate is not None and all_points is not None:
                found = compared.setdefault((part.way, part.window), [])
                found.append(compare(all_points, estimate))
        ratios: dict[str, list[float]] = {}
        for (way, _), found in compared.items():
            count = sum(n for _, n in found)
            if count >= ENOUGH:
                ratios.setdefault(way, []).append(sum(d2 for d2, _ in found) / count)
        return HalvesApart(
            {way: _typical(values) for way, values in ratios.items()},
            min(map(len, ratios.values()), default=0),
        )

    def _estimate(self, part: _Part, options: Sequence[str]) -> Estimate | None:
        try:
            answers = stuffed_answers(self._program, part.path, options)
        except NothingUsefulError:  # not one frame of so short a part could be used
            return None
        return estimate_in(list(framing.only(answers, Kind.POSE)))


def _typical(values: Sequence[float]) -> float:
    """Returns the scaled median of the windows, so that one passing car counts little."""
    return float(np.mean(values) if len(values) < 3 else np.median(values) / MEDIAN)


def compare(whole: Estimate, part: Estimate) -> tuple[float, int]:
    """Returns d^T (P_part - P_whole)^-1 d summed over the frames, and its degrees of freedom.

    Only directions in which the part's variance is clearly larger are compared: in the others both
    estimates rest on the twists. Nothing is compared where the two have not placed the world frame
    alike, as with an IMU after a start in motion.
    """
    laid = [world_laid(P) for _, P in (whole, part)]
    if whole[0].t_ns[laid[0]] != part[0].t_ns[laid[1]]:
        return 0.0, 0
    _, mine, its = np.intersect1d(whole[0].t_ns, part[0].t_ns, return_indices=True)
    mine, its = mine[laid[0] + SETTLED :], its[laid[0] + SETTLED :]
    if not len(mine):
        return 0.0, 0
    between = se3.compose(se3.inverse(whole[0].poses.at(mine)), part[0].poses.at(its))
    d, P, Q = se3.log(between), whole[1][mine], part[1][its]
    total, count = 0.0, 0
    for k in range(len(d)):
        if not (np.isfinite(Q[k]).all() and np.isfinite(P[k]).all()):  # a filter that diverged
            continue
        try:
            white = np.linalg.inv(np.linalg.cholesky(Q[k]))
        except np.linalg.LinAlgError:  # a pose that is given has no variance
            continue
        share, axes = np.linalg.eigh(np.eye(6) - white @ P[k] @ white.T)
        told = share > TELLS
        z = (axes.T @ (white @ d[k]))[told]
        total, count = total + float(np.sum(z**2 / share[told])), count + int(told.sum())
    return total, count


# --- windows and halves ---------------------------------------------------------------------------


def windows(messages: Sequence[Message]) -> Iterator[list[Message]]:
    """Yields windows of the drive as recordings of their own, each with the twists that precede it.

    Messages that hold for the whole drive only (a start, a compass) are left out. A drive by an IMU
    is one window.
    """
    if any(isinstance(m, Imu) for m in messages):
        yield list(messages)
        return
    left_out = (Start, Reading)
    at = [k for k, m in enumerate(messages) if isinstance(m, Stereo)]
    ahead = [m for m in messages if m.kind in AHEAD]
    count = max(round(len(at) / WINDOW_FRAMES), 1)
    edges = [round(k * len(at) / count) for k in range(count + 1)]
    for first, end in pairwise(edges):
        begin = at[first - 1] + 1 if first else 0
        inside = messages[begin : at[end - 1] + 1] if end > first else []
        kept = [m for m in inside if m.kind not in AHEAD and not isinstance(m, left_out)]
        moved = any(isinstance(m, Twist) for m in kept)  # odometry may pause while the robot stands
        shows = any(isinstance(m, Stereo) and len(m.ids) for m in kept)
        if end - first > SETTLED and moved and shows:
            yield [*ahead, *kept]


def halves(tracks: Tracks) -> tuple[NDArray[np.int64], Masks]:
    """Returns the ids, and for each way a mask of the first half of the observations."""
    ids, of_id = np.unique(tracks.id, return_inverse=True)
    count = np.bincount(of_id, minlength=len(ids))
    mean = [
        np.bincount(of_id, column, len(ids)) / np.maximum(count, 1) for column in tracks.pixels.T
    ]
    chance = np.random.default_rng(1).random(len(ids))
    by = {
        "left and right": mean[0],
        "upper and lower": mean[1],
        "near and far": mean[0] - mean[2],
        "any two halves": chance,
    }
    masks: Masks = {}
    for way, value in by.items():
        order = np.argsort(value, kind="stable")
        seen = np.cumsum(count[order])
        masks[way] = np.zeros(len(ids), np.bool_)
        masks[way][order[2 * seen <= seen[-1]]] = True
    return ids, masks


def of_points(messages: Sequence[Message], ids: NDArray[np.int64]) -> list[Message]:
    """Returns the messages with the observations of these ids only."""
    out: list[Message] = []
    for message in messages:
        if isinstance(message, Stereo):
            mine = np.isin(message.ids, ids)
            message = replace(message, ids=message.ids[mine], pixels=message.pixels[mine])  # noqa: PLW2901
        out.append(message)
    return out
