# SPDX-License-Identifier: MIT
"""Simulates readings of small sensors: noise as the filter assumes it, losses, outliers."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pelorus.io.small_sensors import Motion, SmallSensor
from pelorus.math.motion import Times
from pelorus.simulate import settings
from pelorus.simulate.settings import (
    BELOW_ONE,
    NOT_NEGATIVE,
    PERCENT,
    Numbers,
    Span,
    require,
    setting,
)
from pelorus.wire.frames import Reading
from pelorus.wire.layout import Floats

OUTLIER_SIGMAS = 100.0  # largest error of an outlier
HELD_INTERVALS = 2  # intervals for which the filter holds a velocity if the next does not come


@dataclass(frozen=True)
class Sensing:
    """How one small sensor measures; empty fields have the defaults of the table of sensors."""

    rate_hz: float = setting(
        0.0, "Its readings, of which the twist rate is a whole multiple; 0: none.", "HZ"
    )
    sigma: Numbers = setting(
        (), "Noise: a number for all that it measures, or one each, parted by commas.", rule=None
    )
    axes: str = setting("", "What it measures.", rule=None)
    at_m: Numbers = setting((), "Where on the body it sits.", "X,Y,Z", None)
    drop: float = setting(0.0, "Share of its readings that are lost.", "SHARE", BELOW_ONE)
    outliers: float = setting(
        0.0, "Share of them that are off by up to 100 sigma.", "SHARE", BELOW_ONE
    )

    track_m: float = setting(0.0, "Two wheels, so far apart along the body's y; 0: one.", "M")
    scale_percent: float = setting(
        0.0, "The radius is so much larger than was told.", "PERCENT", PERCENT
    )
    track_off_percent: float = setting(
        0.0, "The same of the distance between the wheels.", "PERCENT", PERCENT
    )
    slip_percent: float = setting(
        0.0, "They slip, and turn by so much faster than they roll.", "PERCENT"
    )
    slip_from_s: float = setting(0.0, "They begin to slip then.", "S")
    slip_for_s: float = setting(5.0, "They slip so long.", "S")

    def check(self, sensor: SmallSensor, twist_rate_hz: float) -> None:
        """Refuses contradictory options, by the option's name."""
        settings.check(self, f"{sensor.name}_")
        name = sensor.name
        if not self.rate_hz:
            first = next((f.name for f in fields(self) if getattr(self, f.name) != f.default), "")
            given = getattr(self, first) if first else None
            require(f"{name}_{first}", given, not first, f"--{name}-rate beside it")
            return
        ratio = twist_rate_hz / self.rate_hz
        expected = f"a whole part of the twist rate, {twist_rate_hz:g},"
        require(f"{name}_rate_hz", self.rate_hz, round(ratio) == ratio >= 1, expected)
        letters = self.letters_of(sensor)
        good = len(set(letters)) == len(letters) and set(letters) <= set(sensor.letters)
        require(f"{name}_axes", self.axes, good, f"some of the letters {sensor.letters}")
        count = len(sensor.columns)
        sound = all(NOT_NEGATIVE.holds(x) and x > 0 for x in self.sigma)
        expected = f"one positive number, or {count} parted by commas,"
        require(f"{name}_sigma", self.sigma, sound and len(self.sigma) in (0, 1, count), expected)
        sound = all(map(math.isfinite, self.at_m)) and len(self.at_m) in (0, 3)
        require(f"{name}_at_m", self.at_m, sound, "three numbers of metres, parted by commas,")

    def letters_of(self, sensor: SmallSensor) -> str:
        return self.axes or sensor.usual or sensor.letters

    def sigma_of(self, sensor: SmallSensor) -> Floats:
        """Returns the sigma of each of its numbers."""
        return np.broadcast_to(np.array(self.sigma or sensor.sigma), (len(sensor.columns),))


def options_without_meaning(sensor: SmallSensor) -> set[str]:
    """Returns the fields of Sensing that this sensor ignores."""
    without = set() if sensor.has_arm else {"at_m"}
    if sensor.name != "wheel":
        without |= {"track_m", "scale_percent", "track_off_percent"}
        without |= {"slip_percent", "slip_from_s", "slip_for_s"}
    return without | ({"outliers"} if sensor.at_rest else set())


def read(
    sensor: SmallSensor,
    sensing: Sensing,
    t_ns: Times,
    motion: Motion,
    every: int,
    chance: np.random.Generator,
) -> list[Reading]:
    """Returns readings at each `every`-th time but the first: before it there is no pose yet."""
    half_m = np.array([0.0, sensing.track_m / 2, 0.0])
    sides = (1.0, -1.0) if sensing.track_m else (0.0,)
    return [
        reading
        for side in sides
        for reading in _read(sensor, sensing, t_ns, motion, every, chance, side * half_m)
    ]


def _read(
    sensor: SmallSensor,
    sensing: Sensing,
    t_ns: Times,
    motion: Motion,
    every: int,
    chance: np.random.Generator,
    aside_m: Floats,
) -> list[Reading]:
    """Returns the readings of one that sits `aside_m` (3,) from the place of the options."""
    rows = np.arange(every, len(t_ns), every)
    if sensor.at_rest:
        rows = rows[_stays_at_rest(motion, every)[rows]]
    count, numbers = len(rows), len(sensor.columns)
    arm = np.array(sensing.at_m or (0.0, 0.0, 0.0)) + aside_m
    sigma = sensing.sigma_of(sensor)
    true = sensor.measure(motion.at(rows), arm + sensing.track_off_percent / 100 * aside_m)
    slips = Span(sensing.slip_from_s, sensing.slip_for_s).holds(t_ns[rows] - t_ns[0])
    true = true / (1 + sensing.scale_percent / 100)
    true = np.where(slips[:, None], (1 + sensing.slip_percent / 100) * true, true)
    noise = sigma * chance.standard_normal((count, numbers))
    wrong = chance.random(count) < sensing.outliers
    astray = OUTLIER_SIGMAS * sigma * chance.uniform(-1.0, 1.0, (count, numbers))
    kept = chance.random(count) >= sensing.drop
    value = true if sensor.at_rest else true + noise + np.where(wrong[:, None], astray, 0.0)
    axes = sensor.axes(sensing.letters_of(sensor))
    has = np.array([axes >> k & 1 for k in range(numbers)], bool)
    return [
        Reading(
            int(t_ns[row]),
            sensor.number,
            axes,
            _three(np.where(has, value[k], 0.0)),
            _three(np.where(has, sigma, 0.0)),
            arm,
        )
        for k, row in enumerate(rows)
        if kept[k]
    ]


def _stays_at_rest(motion: Motion, every: int) -> NDArray[np.bool_]:
    """Returns where the body rests, and does so for as long as the filter holds the reading.

    A robot that sets off knows it before.
    """
    moves = np.concatenate((motion.v_B_mps, motion.w_B_radps), axis=1)
    rests: NDArray[np.bool_] = (moves == 0).all(axis=1)
    ahead = np.concatenate((rests, np.repeat(rests[-1:], HELD_INTERVALS * every - 1)))
    windows = np.lib.stride_tricks.sliding_window_view(ahead, HELD_INTERVALS * every)
    return np.asarray(windows.all(axis=1), np.bool_)


def _three(numbers: Floats) -> Floats:
    out = np.zeros(3)
    out[: len(numbers)] = numbers
    return out
