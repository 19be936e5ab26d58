# SPDX-License-Identifier: MIT
"""Reads the small sensors of a bag: fixes of a GNSS receiver, and wheels beside an IMU.

The wheels are odometry, twists or the speeds of joints.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pelorus.converters import wheels
from pelorus.converters.bag import Bag
from pelorus.converters.geodetic import Ground
from pelorus.converters.ros_motion import TWISTS, Wheels, of_joints, rows_of, xyz
from pelorus.converters.streams import BLIND_VELOCITY_MPS
from pelorus.converters.wheels import Rolling
from pelorus.errors import PelorusError
from pelorus.io.small_sensors import POSITION, WHEEL
from pelorus.math.se3 import IDENTITY, Poses
from pelorus.wire.frames import Reading
from pelorus.wire.layout import Floats

FIX = "sensor_msgs/msg/NavSatFix"
SIGMA_MAX_MPS = 10.0  # a larger one means "not measured"


# --- positions ------------------------------------------------------------------------------------


def positions(bag: Bag, topic: str, sigma_m: float, body: str) -> list[Reading]:
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

    t_ns, numbers, frame = rows_of(bag, topic, row)
    fixed = numbers[:, 0] > 0
    if not fixed.any():
        raise bag.error(topic, f"none of {len(fixed)} messages has a fix")
    if not fixed.all():
        bag.remarks.append(f"{topic}: {int((~fixed).sum())} of {len(fixed)} messages have no fix")
    t_ns, places, sigmas = t_ns[fixed], numbers[fixed, 1:4], numbers[fixed, 4:]
    if sigma_m > 0:
        sigmas = np.full_like(sigmas, sigma_m)
    if not sigmas.all():
        raise bag.error(topic, "messages tell no covariance; --position-sigma M is expected")
    local = Ground().local(bag.where(topic), places, bag.remarks)
    if not bag.tree.knows(frame, body):
        bag.remarks.append(f"{topic}: the antenna is taken as sitting at the body's origin")
    arm_m = _seat(bag, topic, "antenna sits", frame, body).p
    axes = POSITION.axes(POSITION.letters)
    each = zip(t_ns.tolist(), local, sigmas, strict=True)
    return [Reading(t, POSITION.number, axes, value, sigma, arm_m) for t, value, sigma in each]


def _seat(bag: Bag, topic: str, what: str, frame: str, body: str) -> Poses:
    """Returns the pose of a sensor's frame in the body's; the body's own where it is unknown."""
    if not bag.tree.knows(frame, body):
        return IDENTITY
    chain = bag.tree.chain(frame, body)
    bag.remarks.append(f"{topic}: the {what} as /tf_static says: {chain.words}")
    return chain.T


# --- wheels ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Beside:
    """The wheels: a topic of twists, or joints. With a track width left and right are separate."""

    topic: str = ""
    joints: Wheels | None = None
    sigma_mps: float = 0.0  # 0: as the messages say
    letters: str = "x"  # axes that they measure
    track_m: float = 0.0
    stand: bool = True  # where they read 0, the body stands
    slide_mps: float = 0.0  # sigma along axes that they do not measure; 0: unknown

    def check(self) -> None:
        """Raises PelorusError where the options contradict each other."""
        if not self.letters or set(self.letters) - set(WHEEL.letters):
            raise PelorusError(
                f"--wheel-axes is {self.letters}: some of the letters {WHEEL.letters} are expected"
            )
        for option, sigma in (("sigma", self.sigma_mps), ("slide", self.slide_mps)):
            if not 0 <= sigma <= SIGMA_MAX_MPS:
                raise PelorusError(f"--wheel-{option} is {sigma:g}: more than 0 m/s is expected")
        if self.track_m and "x" not in self.letters:
            raise PelorusError("--track-width: left and right wheel need x in --wheel-axes")


def wheels_beside(bag: Bag, beside: Beside, body: str) -> list[Reading]:
    """Returns the readings; the wheels' place on the body is by the transforms."""
    beside.check()
    if beside.joints is None:
        rolling, turn_radps, frame = _of_topic(bag, beside)
        topic = beside.topic
    else:
        topic = beside.joints.topic
        found = of_joints(bag, beside.joints)
        sigma = np.full_like(found.v_B_mps, _sigma_wanted(bag, topic, beside))
        rolling = Rolling(found.t_ns, found.v_B_mps, sigma, "x")
        turn_radps, frame = found.w_B_radps[:, 2], found.frame
    if frame != body and not bag.tree.knows(frame, body):
        bag.remarks.append(
            f"{topic}: wheels of the frame {frame!r}, taken as the body's own ({body!r}): "
            "/tf_static joins them not"
        )
    T_BW = _seat(bag, topic, "wheels sit", frame, body)
    readings: list[Reading] = []
    half = 0.5 * beside.track_m
    for side in (half, -half) if half else (0.0,):  # left, right
        v_W = rolling.v_W_mps.copy()
        v_W[:, 0] -= side * turn_radps
        at_W = np.array([0.0, side, 0.0])
        one = replace(rolling, v_W_mps=v_W)
        slide = (beside.slide_mps or BLIND_VELOCITY_MPS, beside.slide_mps > 0)
        readings += wheels.readings(one, T_BW, at_W, *slide)
    return [*readings, *(wheels.standing(readings, bag.remarks) if beside.stand else ())]


def _of_topic(bag: Bag, beside: Beside) -> tuple[Rolling, Floats, str]:
    """Reads odometry or twists; also returns the yaw rates and the frame in the messages."""
    topic = bag.require(beside.topic, *TWISTS)
    of_twist = TWISTS[bag.types[topic]]

    def row(message: Any) -> list[float]:
        twist = of_twist(message)
        whole = getattr(getattr(message, "twist", None), "covariance", None)
        variance = np.zeros(3) if whole is None else np.asarray(whole, float)[[0, 7, 14]]
        told = np.where(np.isfinite(variance) & (variance > 0), variance, 0.0)
        return [*xyz(twist.linear), float(twist.angular.z), *np.sqrt(told).tolist()]

    t_ns, numbers, frame = rows_of(bag, topic, row)
    sigma = numbers[:, 4:]
    measured = [letter in beside.letters for letter in WHEEL.letters]
    if beside.sigma_mps or not ((sigma > 0) & (sigma < SIGMA_MAX_MPS))[:, measured].all():
        sigma = np.full_like(sigma, _sigma_wanted(bag, topic, beside))
    return Rolling(t_ns, numbers[:, :3], sigma, beside.letters), numbers[:, 3], frame


def _sigma_wanted(bag: Bag, topic: str, beside: Beside) -> float:
    if not beside.sigma_mps:
        raise bag.error(
            topic,
            "messages tell no covariance; --wheel-sigma M/S is expected: how far a speed is off, "
            "slip apart; 0.05 for many wheels",
        )
    return beside.sigma_mps
