# SPDX-License-Identifier: MIT
"""Compares wheels beside an IMU with what pictures and IMU give without them: scale and track.

A wheel at l on the body reads r = s (v_x + l_z w_y - l_y w_z) along the body's x. The filter's v
and w, estimated without the wheels, explain r by least squares; leaving out stretches of the drive
in turn gives the standard errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.check.options import Settings, options_of
from pelorus.check.verdict import Grade, Remark
from pelorus.converters.wheels import WHEEL
from pelorus.math.motion import Times
from pelorus.native.replay import replayed
from pelorus.wire.frames import Message, Pose, Reading
from pelorus.wire.layout import Floats

STRETCHES = 10  # of the drive, left out in turn
LEAST = 200  # moving readings that a fit needs
MOVING_MPS = 0.05
PAUSE_S = 0.3  # no velocity is interpolated across a longer gap
SIGMAS = 4.0
OFF_LEAST = 0.005  # of the scale: no baseline is known better
APART_LEAST = 0.02  # of a wheel's place, likewise
SCATTER_MOST = 2.0  # factor of a reading's sigma


class Fitted(NamedTuple):
    """The fit of a wheel, with sigmas: its scale, its place to the left, m, and its scatter."""

    scale: float
    scale_sigma: float
    left_m: float
    left_sigma_m: float
    scatter: float


def remarks(program: Path, messages: Sequence[Message], settings: Settings) -> list[Remark]:
    """Returns the remarks on the wheels; none for a recording that has none."""
    wheels = [m for m in messages if isinstance(m, Reading) and _is_ahead(m)]
    if not wheels:
        return []
    others = [m for m in messages if not (isinstance(m, Reading) and m.sensor == WHEEL.number)]
    answers = replayed(program, others, options_of(settings))
    poses = [m for m in answers if isinstance(m, Pose) and m.after_stereo]
    places = sorted({tuple(m.at_B_m.tolist()) for m in wheels}, key=lambda at: -at[1])
    found: list[Remark] = []
    for at in places:
        own = [m for m in wheels if tuple(m.at_B_m.tolist()) == at]
        name = f"the wheel at y = {at[1]:g} m" if len(places) > 1 else "the wheels"
        fitted = _fitted(own, poses, len(places) > 1)
        found += [] if fitted is None else _remarks_on(name, fitted, at[1], len(places) > 1)
    return found


def _is_ahead(reading: Reading) -> bool:
    return reading.sensor == WHEEL.number and bool(reading.axes & WHEEL.axes("x"))


def _fitted(wheels: Sequence[Reading], poses: Sequence[Pose], apart: bool) -> Fitted | None:
    """Fits scale and place, with jackknife sigmas; None where too few readings move."""
    read = np.array([m.value[0] for m in wheels])
    sigma = np.array([m.sigma[0] for m in wheels])
    at_B_m = wheels[0].at_B_m
    v, w, there = _between(np.array([m.t_ns for m in wheels]), poses)
    ahead = v[:, 0] + w[:, 1] * at_B_m[2]
    known = ahead - (0 if apart else w[:, 2] * at_B_m[1])
    columns = np.column_stack((known, -w[:, 2])) if apart else known[:, None]
    good = there & (np.abs(known) > MOVING_MPS)
    if good.sum() < LEAST:
        return None
    x = _solved(columns[good], read[good])
    off = read - columns @ x
    usual = 1.48 * float(np.median(np.abs(off[good])))
    good &= np.abs(off) <= SIGMAS * usual  # without slips
    rows = np.array_split(np.flatnonzero(good), STRETCHES)
    numbers = []
    for left_out in range(STRETCHES):
        kept = np.concatenate([one for k, one in enumerate(rows) if k != left_out])
        s, k = [*_solved(columns[kept], read[kept]), 0.0][:2]
        numbers.append((s, k / s))
    spread = np.sqrt((STRETCHES - 1) * np.var(numbers, axis=0))
    scale, left_m = np.mean(numbers, axis=0)
    return Fitted(scale, spread[0], left_m, spread[1], usual / float(np.median(sigma)))


def _solved(columns: Floats, read: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(columns, read, rcond=None)[0])


def _between(t_ns: Times, poses: Sequence[Pose]) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Returns the velocities interpolated at these times, and a mask of where they are known."""
    own = np.array([m.t_ns for m in poses], np.int64)
    if len(own) < 2:
        return np.zeros((len(t_ns), 3)), np.zeros((len(t_ns), 3)), np.zeros(len(t_ns), bool)
    numbers = np.array([[*m.v_B_mps, *m.w_B_radps] for m in poses])
    seconds, at = (own - own[0]) * 1e-9, (t_ns - own[0]) * 1e-9
    found = np.stack([np.interp(at, seconds, column) for column in numbers.T], axis=-1)
    after = np.clip(np.searchsorted(own, t_ns), 1, len(own) - 1)
    there = (t_ns >= own[0]) & (t_ns <= own[-1])
    return found[:, :3], found[:, 3:], there & (np.diff(seconds)[after - 1] <= PAUSE_S)


def _remarks_on(name: str, found: Fitted, left_m: float, apart: bool) -> list[Remark]:
    more, sure = found.scale - 1, found.scale_sigma
    words = f"{name}: against pictures and IMU the speed is {more:+.1%} off, sigma {sure:.1%}"
    if abs(more) > max(SIGMAS * sure, OFF_LEAST):
        which = "smaller" if more > 0 else "larger"
        how = (
            f"{words}: the radius is {which} than was told (divide the speed by {found.scale:.3f})"
        )
        about = [Remark(Grade.CARE, how)]
    else:
        about = [Remark(Grade.GOOD, words)]
    if apart:
        off_m, sigma = found.left_m - left_m, found.left_sigma_m
        if abs(off_m) > max(SIGMAS * sigma, APART_LEAST * abs(left_m)):
            about.append(
                Remark(
                    Grade.CARE,
                    f"{name}: by its readings it sits at y = {found.left_m:.3f} m, sigma "
                    f"{sigma:.3f} m: the distance of the wheels is another than was told",
                )
            )
    if found.scatter > SCATTER_MOST:
        about.append(
            Remark(
                Grade.CARE,
                f"{name}: readings scatter by {found.scatter:.1f} times their sigma: tell a "
                "larger one",
            )
        )
    return about
