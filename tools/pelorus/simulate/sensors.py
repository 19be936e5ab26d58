# SPDX-License-Identifier: MIT
"""The scene: landmarks along the path, and the camera that sees them; noise, biases, tracks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.io.small_sensors import SMALL_SENSORS
from pelorus.math.se3 import Poses
from pelorus.simulate.drive import rotate
from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

CAMERA = Camera(fx_px=420.0, fy_px=420.0, cx_px=320.0, cy_px=240.0, baseline_m=0.2)
IMAGE_PX = (640, 480)
R_CB = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # body forward-left-up
CAMERA_IN_BODY_M = np.array([1.0, 0.3, 0.6])  # of a car: turns move the camera sideways
T_CB = Poses(R_CB, -rotate(R_CB, CAMERA_IN_BODY_M))

DEPTH_MIN_M = 0.8
SIDE_M = (3.0, 15.0)  # distance of landmarks from the path, on either side
HEIGHT_M = (-1.0, 5.0)


class View(NamedTuple):
    """Landmarks in the left camera (m, 3) and in the images (m, 4), and which are visible."""

    q_C: Floats
    pixels: Floats
    visible: NDArray[np.bool_]


class Depths(NamedTuple):
    """Limits of the landmarks' depth; 0: as camera and range allow."""

    least_m: float = 0.0
    most_m: float = 0.0

    @property
    def side_m(self) -> tuple[float, float]:
        """Returns how far beside the path they stand, so that there are some at these depths."""
        return (self.least_m or SIDE_M[0], self.most_m or max(SIDE_M[1], 2 * self.least_m))

    @property
    def given(self) -> bool:
        return bool(self.least_m or self.most_m)


ANY_DEPTH = Depths()


def landmarks(
    path: Poses, count: int, chance: np.random.Generator, depths: Depths = ANY_DEPTH
) -> Floats:
    """Returns (count, 3) landmarks in the world, beside random poses of the path."""
    at = chance.integers(0, len(path.p), count)
    side = chance.uniform(*depths.side_m, count) * chance.choice((-1.0, 1.0), count)
    ahead = chance.uniform(-3.0, 3.0, count)
    up = chance.uniform(*HEIGHT_M, count) * max(1.0, depths.side_m[0] / SIDE_M[1])
    return path.p[at] + rotate(path.R[at], np.stack((ahead, side, up), axis=-1))


def view(
    R_WB: Floats,
    p_WB: Floats,
    points_W: Floats,
    range_m: float,
    camera: Camera = CAMERA,
    depths: Depths = ANY_DEPTH,
    extrinsic: Poses = T_CB,
) -> View:
    """Returns the points in the camera of a body at (R, p)."""
    in_body = rotate(R_WB.T, points_W - p_WB)
    q = rotate(extrinsic.R, in_body) + extrinsic.p
    x, y, z = q.T
    depth = np.maximum(z, DEPTH_MIN_M)
    u_left = camera.fx_px * x / depth + camera.cx_px
    v = camera.fy_px * y / depth + camera.cy_px
    u_right = camera.fx_px * (x - camera.baseline_m) / depth + camera.cx_px
    width, height = IMAGE_PX
    distance = np.sqrt(x * x + y * y + z * z)
    visible = (z > DEPTH_MIN_M) & (distance < range_m) & (u_left < width) & (u_right >= 0)
    visible &= (v >= 0) & (v < height) & (z >= depths.least_m)
    if depths.most_m:
        visible &= z <= depths.most_m
    return View(q, np.stack((u_left, v, u_right, v), axis=-1), visible)


class Chances:
    """An independent random generator for each source: changing one option leaves the others."""

    def __init__(self, seed: int) -> None:
        names = ("scene", "tracker", "pixels", "outliers", "drops", "velocity", "gyro", "bias_v")
        later = ("bias_w", "drift", "moving", "moving_ways")
        latest = ("imu", "imu_faults", "start")
        self._names = (*names, *later, *(sensor.name for sensor in SMALL_SENSORS), *latest)
        seeds = np.random.SeedSequence(seed).spawn(len(self._names))
        self._streams = [np.random.Generator(np.random.PCG64(s)) for s in seeds]

    def __getitem__(self, name: str) -> np.random.Generator:
        return self._streams[self._names.index(name)]


OUTLIER_DISPARITY_MAX_PX = 60.0


def biases(sigma: float, walk: float, tau_s: Floats, chance: np.random.Generator) -> Floats:
    """Returns (n, 3) biases: drawn once, then a random walk of `walk` (unit^2/s)."""
    first = sigma * chance.standard_normal(3)
    steps = np.sqrt(walk * tau_s)[:, None] * chance.standard_normal((len(tau_s), 3))
    out = np.empty((len(tau_s) + 1, 3))
    out[0] = first
    for k, step in enumerate(steps):  # cumsum's order of operations is not specified
        out[k + 1] = out[k] + step
    return out


def white(sigma: float, count: int, chance: np.random.Generator) -> Floats:
    """Returns (count, 3) independent noise."""
    return sigma * chance.standard_normal((count, 3))


@dataclass
class SimulatedTracker:
    """Gives landmarks ids: kept while one is seen without a break, a new one afterwards.

    With `keep_ids` a landmark has one permanent id (its number), so loops close.
    """

    count: int  # landmarks of the scene
    most: int  # observations of a frame at most
    loss: float  # probability a frame that a track breaks
    keep_ids: bool
    chance: np.random.Generator

    def __post_init__(self) -> None:
        self._id = np.full(self.count, -1, np.int64)  # -1: not tracked
        self._next = 0

    def follow(self, visible: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Returns the landmarks of this frame, ascending; `ids` has theirs."""
        lost = self.chance.random(self.count) < self.loss
        preference = self.chance.random(self.count)
        tracked = (self._id >= 0) & visible & ~lost
        self._id[~tracked] = -1
        fresh = np.nonzero(visible & ~tracked & ~lost)[0]
        room = max(self.most - int(tracked.sum()), 0)
        chosen = np.sort(fresh[np.argsort(preference[fresh], kind="stable")][:room])
        self._id[chosen] = chosen if self.keep_ids else self._next + np.arange(len(chosen))
        self._next += len(chosen)
        return np.nonzero(self._id >= 0)[0]

    def ids(self, landmarks: NDArray[np.intp]) -> NDArray[np.int64]:
        return self._id[landmarks]


def measure(
    seen: View,
    landmarks: NDArray[np.intp],
    pixel_sigma: float,
    outliers: float,
    chance: np.random.Generator,
    bad: np.random.Generator,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Returns pixels (n, 4) with independent noise, and which of them are wrong matches."""
    count = len(landmarks)
    noise = pixel_sigma * chance.standard_normal((count, 4))
    wrong = bad.random(count) < outliers
    u, v = bad.uniform(0, IMAGE_PX[0], count), bad.uniform(0, IMAGE_PX[1], count)
    disparity = bad.uniform(0, OUTLIER_DISPARITY_MAX_PX, count)
    elsewhere = np.stack((u, v, u - disparity, v), axis=-1)
    return np.where(wrong[:, None], elsewhere, seen.pixels[landmarks]) + noise, wrong
