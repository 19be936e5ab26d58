# SPDX-License-Identifier: MIT
"""Makes recordings with pictures that images can carry: a camera with an IMU passes a wall.

usage: python -m firmware.pictures FOLDER

One for each board that has images with eyes, FOLDER/BOARD.plr, of the sizes in
port/cortex_m/cmake/Boards.cmake.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math.inertial import Inertial
from pelorus.wire.frames import BodyAxes, Camera, Header, Process, Start, StartFlag
from pelorus.wire.image import PicturesOf, RigMessage, TimedPair

PAIRS, PAIR_NS, READING_NS, T0_NS = 12, 50_000_000, 5_000_000, 1_000_000_000
DEPTH_M, BASELINE_M, SPEED_MPS, G = 2.5, 0.1, 0.8, 9.81
FORWARD_LEFT_UP = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # body to camera
WAVES = 40
# Width and height of pictures, tracks, landmarks.
BOARDS = {
    "stm32f405": (160, 120, 32, 32),
    "mps2_an500": (320, 240, 50, 64),
    "mps3_an547": (320, 240, 50, 64),
}


def wall(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Returns grey levels at places of the wall, in pixels: waves of 6 to 60 px, and noise."""
    chance = np.random.default_rng(48)
    grey = np.zeros(u.shape)
    for _ in range(WAVES):
        length, angle, phase = chance.uniform((6, 0, 0), (60, np.pi, 2 * np.pi))
        k = 2 * np.pi / length
        grey += np.sin(k * (np.cos(angle) * u + np.sin(angle) * v) + phase)
    noise = np.random.default_rng(int(abs(u[0, 0]) * 1e3)).normal(scale=1.0, size=u.shape)
    return np.asarray(np.clip(128 + 55 * grey / np.sqrt(WAVES / 2) + noise, 0, 255), np.uint8)


def recording(width: int, height: int, tracks: int, landmarks: int) -> Recording:
    """Returns the drive: to the right at SPEED_MPS, looking at the wall."""
    f, cx, cy = float(width), (width - 1) / 2, (height - 1) / 2
    v, u = np.mgrid[:height, :width].astype(np.float64)
    t_ns = T0_NS + PAIR_NS * np.arange(PAIRS)

    def pairs() -> Iterator[TimedPair]:
        for k, t in enumerate(t_ns.tolist()):
            x = f * SPEED_MPS * k * PAIR_NS * 1e-9 / DEPTH_M
            right = x + f * BASELINE_M / DEPTH_M
            yield TimedPair(t, t, wall(u + x, v), wall(u + right, v))

    own = T0_NS + READING_NS * np.arange(PAIRS * PAIR_NS // READING_NS)
    chance = np.random.default_rng(5)
    force = np.array([0, 0, G]) + chance.normal(scale=0.02, size=(len(own), 3))
    turn = chance.normal(scale=1e-3, size=(len(own), 3))
    lens = (f, f, cx, cy)
    rig = RigMessage(
        width, height, 0, *lens, 0, *lens, t_RL_m=np.array([-BASELINE_M, 0, 0]), tracks=tracks
    )  # fmt: skip
    header = Header(
        Camera(f, f, cx, cy, BASELINE_M), FORWARD_LEFT_UP, np.zeros(3),
        BodyAxes.FORWARD_LEFT_UP, image_width_px=width, image_height_px=height,
        name="a wall that passes by", process=Process.IMU,
    )  # fmt: skip
    start = Start(
        T0_NS, flags=StartFlag.COVARIANCE, covariance=1e-6 * np.eye(6)[np.tril_indices(6)],
        velocity=np.array([0, -SPEED_MPS, 0]), velocity_variance=np.full(3, 1e-4),
    )  # fmt: skip
    nothing = np.empty(0, np.int64)
    return Recording(
        header, nothing, np.empty((0, 3)), np.empty((0, 3)), nothing, Tracks.none(), start=start,
        inertial=Inertial(own, force, turn),
        # a board has no room for the clock's column, and the desk is to do without it, too
        settings={
            **{"slots": landmarks, "imu-start": 3.0},
            **{"pixel-sigma": 0.5, "camera-clock-sigma": 0},
        },
        pictures=PicturesOf(t_ns, width, height, pairs, rig),
    )  # fmt: skip


if __name__ == "__main__":
    for name, sizes in BOARDS.items():
        recording(*sizes).write(Path(sys.argv[1]) / f"{name}.plr")
