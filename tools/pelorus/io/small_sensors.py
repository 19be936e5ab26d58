# SPDX-License-Identifier: MIT
"""The table of small sensors: name, CSV file, and what each would measure without noise.

`simulate` and `convert csv` make their options from this table. docs/ADD-A-SENSOR.md adds a row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.math.se3 import Poses
from pelorus.wire import schema
from pelorus.wire.layout import Floats


class Motion(NamedTuple):
    """The body's true motion at some times: its poses, and the velocities from each time on."""

    poses: Poses
    v_B_mps: Floats
    w_B_radps: Floats

    def at(self, rows: NDArray[np.intp]) -> Motion:
        return Motion(self.poses.at(rows), self.v_B_mps[rows], self.w_B_radps[rows])


@dataclass(frozen=True)
class SmallSensor:
    """A row of the table: one to three numbers, each with its letter in options."""

    name: str
    columns: Mapping[str, str]  # of its CSV file by letter; the word behind the last _ is the unit
    sigma: tuple[float, ...]  # default of each number
    # (n, numbers) without noise, for a sensor at an arm, m
    measure: Callable[[Motion, Floats], Floats]
    usual: str = ""  # default letters that are measured; empty: all
    has_arm: bool = True  # where it sits on the body matters
    at_rest: bool = False  # it reports only that the body rests: its numbers are zeros

    @property
    def number(self) -> int:
        """Returns the number in a READING."""
        return schema.SENSORS[self.name]

    @property
    def letters(self) -> str:
        return "".join(self.columns)

    def unit(self, letter: str) -> str:
        """Returns the unit in a column's name: mps, m."""
        return self.columns[letter].rpartition("_")[2]

    def axes(self, letters: str) -> int:
        """Returns the bits of a READING."""
        return sum(1 << k for k, letter in enumerate(self.columns) if letter in letters)


def name_of(number: int) -> str:
    """Returns the name of a READING's sensor; one of a later version has a name, too."""
    names = {row: name for name, row in schema.SENSORS.items()}
    return names.get(number, f"sensor {number}")


# --- what each measures: sums, products and square roots alone, so that a seed gives the same bytes


def _wheel(motion: Motion, arm_m: Floats) -> Floats:
    """Returns v + w x l."""
    (x, y, z), (a, b, c) = motion.w_B_radps.T, arm_m
    turn: Floats = np.stack((y * c - z * b, z * a - x * c, x * b - y * a), axis=-1)
    return motion.v_B_mps + turn


def _nothing(motion: Motion, arm_m: Floats) -> Floats:  # noqa: ARG001
    return np.zeros((len(motion.v_B_mps), 2))


def _position(motion: Motion, arm_m: Floats) -> Floats:
    """Returns p + R l."""
    R, p = motion.poses
    arm: Floats = R[:, :, 0] * arm_m[0] + R[:, :, 1] * arm_m[1] + R[:, :, 2] * arm_m[2]
    return p + arm


SMALL_SENSORS = WHEEL, STANDSTILL, POSITION = (
    SmallSensor(
        "wheel",
        {"x": "vx_mps", "y": "vy_mps", "z": "vz_mps"},
        (0.02, 0.02, 0.02),
        _wheel,
        usual="x",
    ),
    SmallSensor(
        "standstill",
        {"v": "v_mps", "w": "w_radps"},
        (0.002, 0.0005),
        _nothing,
        has_arm=False,
        at_rest=True,
    ),
    SmallSensor("position", {"x": "px_m", "y": "py_m", "z": "pz_m"}, (0.05, 0.05, 0.05), _position),
)
