# SPDX-License-Identifier: MIT
"""Chooses the stereo pair among a rig's cameras.

A pair has two similar cameras that look the same way: of equal lens and resolution, with their axes
within 30 degrees. So a colour camera between two infrared ones is not in the pair, wherever the
file lists it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import cos, radians
from pathlib import Path
from typing import NamedTuple

from pelorus.io.foreign import ForeignFileError
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig.lens import Lens
from pelorus.rig.rig import Rig

SAME_FOCAL = 0.05  # relative difference of two cameras of one kind
APART_MAX_RAD = radians(30.0)


class RigCamera(NamedTuple):
    """A camera of several; `T` maps points of a common frame to it."""

    names: tuple[str, ...]  # in the file: cam0, its topic
    lens: Lens
    T: Poses

    @property
    def words(self) -> str:
        return " ".join((self.names[0], *(f"({name})" for name in self.names[1:] if name)))


class Chosen(NamedTuple):
    """The two cameras' positions in the list, and remarks on the choice."""

    first: int
    second: int
    remarks: tuple[str, ...] = ()


def rig(path: Path, cameras: Sequence[RigCamera], asked: Sequence[str] = ()) -> Rig:
    """Returns the rig of the chosen pair; the frame that all share is its body."""
    chosen = pair(path, cameras, asked)
    first, second = cameras[chosen.first], cameras[chosen.second]
    T_21 = se3.compose(second.T, se3.inverse(first.T))
    topics = [name for one in (first, second) for name in one.names if name.startswith("/")]
    found = Rig.of_cameras(path, first.lens, second.lens, T_21, first.T, topics)
    return replace(found, remarks=chosen.remarks)


def pair(path: Path, cameras: Sequence[RigCamera], asked: Sequence[str] = ()) -> Chosen:
    """Returns the two that the user asks for by name, else the first two that are alike."""
    if asked:
        return Chosen(*_asked(path, cameras, asked))
    if len(cameras) == 2:
        return Chosen(0, 1)
    every = list(combinations(range(len(cameras)), 2))
    like = [(i, j) for i, j in every if _alike(cameras[i], cameras[j])]
    first, second = (like or every)[0]
    why = (
        "the first two of equal lens and resolution that look the same way"
        if like
        else "the first two, for no two are alike"
    )
    listed = ", ".join(camera.words for camera in cameras)
    remark = (
        f"{path}: {cameras[first].words} and {cameras[second].words} are taken of "
        f"{len(cameras)} cameras ({listed}): {why}. Others: --cameras NAME,NAME"
    )
    return Chosen(first, second, (remark,))


def _asked(path: Path, cameras: Sequence[RigCamera], asked: Sequence[str]) -> tuple[int, int]:
    found = []
    for name in asked:
        of_name = [k for k, camera in enumerate(cameras) if name in camera.names]
        if len(of_name) != 1:
            listed = ", ".join(camera.words for camera in cameras)
            raise ForeignFileError(
                path, f"has no camera called {name}; there are: {listed} (--cameras)"
            )
        found += of_name
    if len(found) != 2 or found[0] == found[1]:
        raise ForeignFileError(
            path, f"--cameras {','.join(asked)}; two cameras, parted by a comma, are expected"
        )
    return found[0], found[1]


def _alike(one: RigCamera, other: RigCamera) -> bool:
    a, b = one.lens, other.lens
    same_size = (a.width_px, a.height_px) == (b.width_px, b.height_px)
    off = abs(a.intrinsics[0] / b.intrinsics[0] - 1)
    between = se3.compose(other.T, se3.inverse(one.T)).R
    return bool(
        a.model is b.model and same_size and off < SAME_FOCAL and between[2, 2] > cos(APART_MAX_RAD)
    )
