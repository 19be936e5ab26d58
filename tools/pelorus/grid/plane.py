# SPDX-License-Identifier: MIT
"""The plane in which trajectories and landmarks are drawn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pelorus.math.se3 import Poses
from pelorus.wire.frames import BodyAxes
from pelorus.wire.layout import Floats

AXES = "xyz"
# The axes to the right and up of a picture whose viewer looks down on the axis named: right x up
# points at the viewer.
SEEN_FROM = {"x": "yz", "y": "zx", "z": "xy"}


class Axis(NamedTuple):
    """A signed axis of the world."""

    number: int
    sign: int

    def of(self, points: Floats) -> Floats:
        return np.asarray(self.sign * points[..., self.number])

    @property
    def name(self) -> str:
        return f"{'-' if self.sign < 0 else ''}{AXES[self.number]}"

    @property
    def label(self) -> str:
        return f"{self.name} (m)"


class Plane(NamedTuple):
    """A plane of the world; `why` gives the reason of the choice in words."""

    right: Axis
    up: Axis
    why: str

    def flat(self, points: Floats) -> Floats:
        """Projects points: (..., 3) -> (..., 2)."""
        return np.stack((self.right.of(points), self.up.of(points)), axis=-1)


def choose(axes: BodyAxes, poses: Poses) -> Plane:
    """Returns the view from above, if the body's axes define up; else of the largest extent."""
    if axes == BodyAxes.OTHER:
        return _largest(poses.p)
    up_B = np.array([0.0, 0.0, 1.0 if axes == BodyAxes.FORWARD_LEFT_UP else -1.0])
    up_W = np.mean(poses.R @ up_B, axis=0)
    vertical = int(np.argmax(np.abs(up_W)))
    return _along(vertical, bool(up_W[vertical] > 0), "from above")


def choose_for_map(axes: BodyAxes, poses: Poses, landmarks_W: Floats) -> Plane:
    """Returns the plane of `choose`, or without known axes the landmarks' plane.

    The latter is the plane to which the landmarks are nearest, seen from its normal's positive end.
    """
    if axes != BodyAxes.OTHER:
        return choose(axes, poses)
    vertical = int(np.argmin(np.ptp(landmarks_W, axis=0)))
    flat = "".join(name for name in AXES if name != AXES[vertical])
    return _along(vertical, True, f"{flat[0]}-{flat[1]}, where the landmarks spread most")


def _along(vertical: int, positive: bool, why: str) -> Plane:
    """Returns the view along an axis of the world, from its positive or its negative end."""
    right, up = (AXES.index(name) for name in SEEN_FROM[AXES[vertical]])
    if positive:
        return Plane(Axis(right, 1), Axis(up, 1), why)
    # Seen from the other side: mirror the second axis, or start with x where there is one.
    if AXES[vertical] == "y":
        return Plane(Axis(up, 1), Axis(right, 1), why)
    return Plane(Axis(right, 1), Axis(up, -1), why)


def _largest(points: Floats) -> Plane:
    extent = np.ptp(points, axis=0)
    right, up = sorted(np.argsort(extent, kind="stable")[1:].tolist())
    why = f"{AXES[right]}-{AXES[up]}, the plane of largest extent"
    return Plane(Axis(right, 1), Axis(up, 1), why)
