# SPDX-License-Identifier: MIT
"""Reads the fixes of a bag's GNSS receiver as readings of the position sensor."""

from __future__ import annotations

from typing import Any

import numpy as np

from pelorus.converters.bag import Bag
from pelorus.converters.geodetic import Ground
from pelorus.converters.ros_motion import rows_of
from pelorus.converters.transforms import Tree
from pelorus.io.foreign import ForeignFileError
from pelorus.io.small_sensors import SMALL_SENSORS
from pelorus.wire.frames import Reading
from pelorus.wire.layout import Floats

FIX = "sensor_msgs/msg/NavSatFix"
SENSOR = next(sensor for sensor in SMALL_SENSORS if sensor.name == "position")


def read(
    bag: Bag, topic: str, sigma_m: float, body: str, tree: Tree, remarks: list[str]
) -> list[Reading]:
    """Returns positions in metres east, north and up of the first fix.

    `sigma_m` replaces the messages' own, if not 0. The antenna's place on the body is by the
    transforms.
    """
    bag.require(topic, FIX)

    def row(message: Any) -> list[float]:
        fixed = message.status.status >= 0
        place = (message.longitude, message.latitude, message.altitude)
        variance = np.asarray(message.position_covariance, float)[[0, 4, 8]]
        known = message.position_covariance_type > 0 and (variance > 0).all()
        numbers = [*map(float, place), *np.sqrt(variance if known else np.zeros(3)).tolist()]
        return [1.0, *numbers] if fixed else [0.0] * 7

    t_ns, numbers, frame = rows_of(bag, topic, row, remarks)
    fixed = numbers[:, 0] > 0
    if not fixed.any():
        raise ForeignFileError(bag.path, f"none of {len(fixed)} messages has a fix", at=topic)
    if not fixed.all():
        remarks.append(f"{topic}: {int((~fixed).sum())} of {len(fixed)} messages have no fix")
    t_ns, places, sigmas = t_ns[fixed], numbers[fixed, 1:4], numbers[fixed, 4:]
    if sigma_m > 0:
        sigmas = np.full_like(sigmas, sigma_m)
    if not sigmas.all():
        raise ForeignFileError(
            bag.path, "messages tell no covariance; --position-sigma M is expected", at=topic
        )
    local = Ground().local(bag.path / topic.lstrip("/"), places, remarks)
    arm_m = _arm(topic, frame, body, tree, remarks)
    axes = SENSOR.axes(SENSOR.letters)
    each = zip(t_ns.tolist(), local, sigmas, strict=True)
    return [Reading(t, SENSOR.number, axes, value, sigma, arm_m) for t, value, sigma in each]


def _arm(topic: str, frame: str, body: str, tree: Tree, remarks: list[str]) -> Floats:
    if not tree.knows(frame, body):
        remarks.append(f"{topic}: the antenna is taken as sitting at the body's origin")
        return np.zeros(3)
    chain = tree.chain(frame, body)
    remarks.append(f"{topic}: the antenna sits as /tf_static says: {chain.words}")
    return chain.T.p
