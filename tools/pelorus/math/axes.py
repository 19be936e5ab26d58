# SPDX-License-Identifier: MIT
"""The ways to permute and turn three axes, and those of a body by its camera's extrinsic."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from pelorus.math import se3
from pelorus.wire.frames import BodyAxes
from pelorus.wire.layout import Floats

LETTERS = (("forward", "backward"), ("left", "right"), ("up", "down"))
FORWARD_LEFT_UP_IN_CAMERA = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def ways() -> list[Floats]:
    """Returns the 48 matrices that permute axes and change their signs; identity first."""
    found: list[Floats] = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            F: Floats = np.zeros((3, 3))
            F[range(3), order] = signs
            found.append(F)
    return found


def turns() -> list[Floats]:
    """Returns the 24 of them that are rotations."""
    return [F for F in ways() if np.linalg.det(F) > 0]


def name(R_CB: Floats) -> str:
    """Returns the body axes in words, for a camera that looks forward."""
    R = se3.nearest_rotation(R_CB)
    in_camera = FORWARD_LEFT_UP_IN_CAMERA.T @ R  # columns: body axes in forward, left, up
    words = []
    for axis in in_camera.T:
        which = int(np.argmax(np.abs(axis)))
        words.append(LETTERS[which][int(axis[which] < 0)])
    return "-".join(words)


def body_axes(R_CB: Floats) -> BodyAxes:
    """Returns the HEADER's name of the body axes, for a camera that looks forward."""
    return {
        "forward-left-up": BodyAxes.FORWARD_LEFT_UP,
        "forward-right-down": BodyAxes.FORWARD_RIGHT_DOWN,
    }.get(name(R_CB), BodyAxes.OTHER)
