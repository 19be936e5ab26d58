# SPDX-License-Identifier: MIT
"""A result's landmarks against those that the recording knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pelorus import se3
from pelorus.frames import Config, Landmark, Message, Role
from pelorus.packed import unpack_symmetric
from pelorus.se3 import Poses

MODE, MAPPING = 2, 1  # the setting's id, and its value for given poses
UNMOVED = Poses(np.eye(3), np.zeros(3))


@dataclass(frozen=True)
class MapFigures:
    """map_rms_m, map_median_m: distance of a landmark from where it is known to be;

    map_nees: squared error over covariance, an axis, mean over the landmarks: 1 is due.
    """

    map_rms_m: float
    map_median_m: float
    map_nees: float
    landmarks: int


def is_mapping(messages: Sequence[Message]) -> bool:
    """Whether the poses were given: then their error says nothing."""
    modes = [m.settings.get(MODE) for m in messages if isinstance(m, Config) if m.build_fingerprint]
    return bool(modes) and modes[-1] == MAPPING


def known_in(messages: Sequence[Message]) -> list[Landmark]:
    """The landmarks that a recording knows."""
    return [m for m in messages if isinstance(m, Landmark) and m.role == Role.KNOWN]


def compare(
    messages: Sequence[Message], known: Sequence[Landmark], A: Poses = UNMOVED
) -> MapFigures | None:
    """A result's evicted and final landmarks against known ones, which A brings to its world.

    None if they have no id in common.
    """
    places = {landmark.id: landmark.p_W_m for landmark in known}
    mine = [
        m for m in messages if isinstance(m, Landmark) and m.role != Role.KNOWN and m.id in places
    ]
    if not mine:
        return None
    theirs = se3.apply(A, np.array([places[m.id] for m in mine]))
    error = np.array([m.p_W_m for m in mine]) - theirs
    P = unpack_symmetric(np.array([m.covariance for m in mine]), 3)
    weighted = np.linalg.solve(P, error[..., None])[..., 0]
    distance = np.linalg.norm(error, axis=1)
    return MapFigures(
        map_rms_m=float(np.sqrt(np.mean(distance**2))),
        map_median_m=float(np.median(distance)),
        map_nees=float(np.mean(np.sum(error * weighted, axis=1)) / 3),
        landmarks=len(mine),
    )
