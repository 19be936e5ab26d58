# SPDX-License-Identifier: MIT
"""What small sensors measure of a drive: a wheel, standing still, a position."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pelorus import se3
from pelorus.frames import Reading, Sensor
from pelorus.layout import Floats
from pelorus.simulation.drive import Drive
from pelorus.simulation.mishaps import Mishaps

WHEEL_AT_B_M = np.array([0.3, 0.25, -0.2])  # right of no axis: the lever arm is seen
ANTENNA_AT_B_M = np.array([-0.4, 0.0, 0.6])
X_AND_Y, ALL = 3, 7


def wheel(way: Drive, every: int, sigma_mps: float, chance: np.random.Generator) -> list[Reading]:
    """Velocity of the wheel's foot along x and y of the body: it does not slip sideways."""
    v, w = way.v_B_mps[::every], way.w_B_radps[::every]
    value = (v + np.cross(w, WHEEL_AT_B_M)) * [1, 1, 0]
    noise = sigma_mps * chance.standard_normal(value.shape) * [1, 1, 0]
    return list(_readings(way, every, Sensor.WHEEL, value + noise, sigma_mps, WHEEL_AT_B_M))


def standstill(way: Drive, every: int, sigma_mps: float) -> list[Reading]:
    """That the body does not move; only of one that stands."""
    value = np.zeros((len(way.t_ns[::every]), 3))
    return list(_readings(way, every, Sensor.STANDSTILL, value, sigma_mps, np.zeros(3)))


def position(
    way: Drive, every: int, sigma_m: float, mishaps: Mishaps, chance: np.random.Generator
) -> list[Reading]:
    """Where the antenna is in the world; it sees a jump."""
    poses = mishaps.jumped(way.t_ns[::every], way.poses.at(slice(None, None, every)))
    value = se3.apply(poses, np.broadcast_to(ANTENNA_AT_B_M, poses.p.shape))
    value = value + sigma_m * chance.standard_normal(value.shape)
    return list(_readings(way, every, Sensor.POSITION, value, sigma_m, ANTENNA_AT_B_M))


def _readings(
    way: Drive, every: int, sensor: Sensor, value: Floats, sigma: float, at_B_m: Floats
) -> Iterator[Reading]:
    axes = X_AND_Y if sensor is Sensor.WHEEL else ALL
    for t, row in zip(way.t_ns[::every].tolist(), value, strict=True):
        yield Reading(t, sensor, axes, row, np.full(3, sigma), at_B_m)
