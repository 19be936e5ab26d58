# SPDX-License-Identifier: MIT
"""Examines an IMU by its readings alone: ranges, faults, and its noise at rest.

The readings of a body at rest are its biases, gravity and noise. They are the evidence for the
noises in a config; a data sheet is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pelorus.math.inertial import Inertial
from pelorus.math.motion import runs
from pelorus.wire.frames import Imu
from pelorus.wire.layout import Floats

WINDOW_S = 0.5  # length of the windows that make a stretch at rest
STILL_S = 2.0  # the least stretch: an even motion looks like rest for a moment
# the noise is that of means of this length, which a filter in the sensor does not affect
MEAN_S = 0.1
WINDOW_LEAST = 10  # readings of a window
# What a body at rest may show besides white noise (an engine), and how its mean may wander.
SPREAD, WANDER = np.array([0.5, 0.05]), np.array([0.1, 0.01])  # m/s^2 and rad/s
WHITE_SHARE = 2.0  # ratio of the spread to that of successive readings
MEAN_SIGMAS = 4.0


@dataclass(frozen=True)
class Still:
    """The longest stretch at rest, as far as an IMU shows it."""

    from_ns: int
    to_ns: int
    force_mps2: float  # of the mean specific force: gravity
    rate_radps: tuple[float, ...]  # mean: the gyro's bias
    gyro_noise: float  # density, rad/s/sqrt(Hz)
    accel_noise: float  # density, m/s^2/sqrt(Hz)


@dataclass(frozen=True)
class ImuSurvey:
    """The ranges and faults of all IMU frames."""

    readings: int
    accel_range: tuple[tuple[float, float], ...]  # least and most of x, y, z, m/s^2
    gyro_range: tuple[tuple[float, float], ...]  # rad/s
    not_finite: int
    longest_same: int  # successive readings of the same numbers
    still: Still | None


def readings_of(messages: Sequence[Imu]) -> Inertial:
    """Returns all readings in the order of the file."""
    return Inertial(
        np.array([t for m in messages for t in m.times_ns], np.int64),
        np.concatenate([m.a_B_mps2 for m in messages]),
        np.concatenate([m.w_B_radps for m in messages]),
    )


def survey(readings: Inertial) -> ImuSurvey:
    """Examines readings, of which there must be one at least."""
    numbers = np.hstack(readings[1:])
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(numbers).all(axis=1))
    sound = readings.at(finite)
    return ImuSurvey(
        readings=len(readings.t_ns),
        accel_range=_ranges(sound.a_B_mps2),
        gyro_range=_ranges(sound.w_B_radps),
        not_finite=int((~finite).sum()),
        longest_same=longest_run((numbers[1:] == numbers[:-1]).all(axis=1)) + 1,
        still=_still(sound),
    )


def _ranges(numbers: Floats) -> tuple[tuple[float, float], ...]:
    if not len(numbers):
        return ()
    return tuple(zip(numbers.min(axis=0).tolist(), numbers.max(axis=0).tolist(), strict=True))


def longest_run(flags: NDArray[np.bool_]) -> int:
    """Returns the length of the longest run of True."""
    return max((last - first + 1 for first, last in runs(flags)), default=0)


def _still(readings: Inertial) -> Still | None:
    """Returns the longest rest; None where time goes back, or nothing rests for STILL_S."""
    if len(readings.t_ns) < WINDOW_LEAST or (np.diff(readings.t_ns) <= 0).any():
        return None
    t_s = (readings.t_ns - readings.t_ns[0]) * 1e-9
    window = (t_s / WINDOW_S).astype(np.int64)
    bounds = np.searchsorted(window, np.arange(window[-1] + 2))
    calm = np.array([_calm(readings, slice(*ends)) for ends in pairwise(bounds)])
    joined = runs(_joined(readings, bounds, calm))
    first, last = max(joined, key=lambda one: one[1] - one[0], default=(0, -1))
    first = max(first - 1, 0)  # the window to which the first one is joined
    if (last + 1 - first) * WINDOW_S < STILL_S:
        return None
    return _found(readings.at(slice(int(bounds[first]), int(bounds[last + 1]))))


def _parts(readings: Inertial) -> tuple[Floats, Floats]:
    return readings.a_B_mps2, readings.w_B_radps


def _calm(readings: Inertial, rows: slice) -> bool:
    """Returns whether the readings of a window spread no more than by noise, or an engine."""
    if rows.stop - rows.start < WINDOW_LEAST:
        return False
    for part, allowed in zip(_parts(readings.at(rows)), SPREAD, strict=True):
        white = 0.5 * np.mean(np.diff(part, axis=0) ** 2)
        if np.mean((part - part.mean(axis=0)) ** 2) > WHITE_SHARE * white + allowed**2:
            return False
    return True


def _joined(
    readings: Inertial, bounds: NDArray[np.intp], calm: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Returns whether each window has the mean of the one before."""
    joined = np.zeros(len(calm), bool)
    for k in range(1, len(calm)):
        if not (calm[k] and calm[k - 1]):
            continue
        before, here = (readings.at(slice(*bounds[j : j + 2])) for j in (k - 1, k))
        joined[k] = all(
            np.linalg.norm(a.mean(axis=0) - b.mean(axis=0))
            <= allowed + MEAN_SIGMAS * np.sqrt(np.var(np.diff(b, axis=0)) / len(b))
            for a, b, allowed in zip(_parts(before), _parts(here), WANDER, strict=True)
        )
    return joined


def _found(stretch: Inertial) -> Still:
    noise = [_density(stretch, part) for part in _parts(stretch)]
    return Still(
        from_ns=int(stretch.t_ns[0]),
        to_ns=int(stretch.t_ns[-1]),
        force_mps2=float(np.linalg.norm(stretch.a_B_mps2.mean(axis=0))),
        rate_radps=tuple(stretch.w_B_radps.mean(axis=0).tolist()),
        gyro_noise=noise[1],
        accel_noise=noise[0],
    )


def scatter(readings: Inertial) -> tuple[float, float]:
    """Returns the densities of gyro and accelerometer by the scatter about lines through
    neighbours.

    They are the least noise that the filter assumes (docs/MATH.md 19).
    """
    usual_s = float(np.median(np.diff(readings.t_ns))) * 1e-9
    accel, gyro = (
        float(np.sqrt(np.mean(np.diff(part, 2, axis=0) ** 2) / 6 * usual_s))
        for part in _parts(readings)
    )
    return gyro, accel


def _density(stretch: Inertial, numbers: Floats) -> float:
    """Returns a noise density by means of MEAN_S, which differ by density sqrt(2 / MEAN_S)."""
    piece = ((stretch.t_ns - stretch.t_ns[0]) * 1e-9 / MEAN_S).astype(np.int64)
    count = np.bincount(piece)
    whole = count >= 0.5 * np.median(count)
    sums = np.stack([np.bincount(piece, x) for x in numbers.T], axis=-1)
    means = sums[whole] / count[whole][:, None]
    return float(np.sqrt(0.5 * MEAN_S * np.mean(np.diff(means, axis=0) ** 2)))
