# SPDX-License-Identifier: MIT
"""A robot with two cameras and an IMU in a room: a folder like EuRoC's, with all that it saw.

It rests for a second, then turns, rolls, pitches and rises along a curve. The room has textured
walls; the pictures are raw, with the bend of their lenses and a little noise. The IMU has noise
and biases.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pelorus.math import se3
from pelorus.math.se3 import Poses
from rendered import BEGIN_NS, HEIGHT, WIDTH, rays_of, texture, write_picture
from rigs import IMU_NOISE, Cameras, camchain, write_yaml
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

REST_S, DRIVE_S, RATE_HZ, IMU_HZ = 1.0, 5.0, 10.0, 200
LOW, HIGH = np.array([-5, -3.5, -0.5]), np.array([5, 7, 3.0])  # m
DOTS_PER_M, SHADE_SIGMA = 60, 2.0
GYRO_BIAS, ACCEL_BIAS = (0.01, -0.02, 0.015), (0.05, -0.03, 0.08)
GRAVITY_MPS2 = 9.81
STEP_S = 1e-3  # for derivatives


@dataclass(frozen=True)
class Room:
    """A drive through it."""

    cameras: Cameras
    drive_s: float = DRIVE_S

    def write(self, top: Path) -> Path:
        chance = np.random.default_rng(1)
        shades = [texture(seed) for seed in range(6)]
        for t in np.arange(0.1, self.drive_s - 0.1, 1 / RATE_HZ):
            R, p = body(np.array([t]))
            T_WL = se3.compose(Poses(R[0], p[0]), se3.inverse(self.cameras.T_LB))
            T_WR = se3.compose(T_WL, se3.inverse(self.cameras.T_RL))
            sides = (T_WL, self.cameras.left), (T_WR, self.cameras.right)
            for k, (T_WC, intrinsics) in enumerate(sides):
                seen = self._seen(T_WC, intrinsics, shades)
                noisy = seen + chance.normal(0, SHADE_SIGMA, seen.shape)
                picture = np.clip(noisy, 0, 255).astype(np.uint8)
                write_picture(top / "mav0" / f"cam{k}" / "data" / f"{_ns(t)}.png", picture)
        t = np.arange(int(self.drive_s * IMU_HZ) + 1) / IMU_HZ
        _write_rows(top / "mav0" / "imu0", t, _imu(t, chance))
        R, p = body(t)
        x, y, z, w = Rotation.from_matrix(R).as_quat().T
        poses = np.column_stack((p, w, x, y, z, np.zeros((len(t), 9))))
        _write_rows(top / "mav0" / "state_groundtruth_estimate0", t, poses)
        write_yaml(top / "camchain.yaml", camchain(self.cameras, (WIDTH, HEIGHT)))
        write_yaml(top / "imu.yaml", IMU_NOISE)
        return top

    def _seen(
        self, T_WC: Poses, intrinsics: tuple[float, ...], shades: list[NDArray[np.float32]]
    ) -> Floats:
        """The nearest wall along each ray."""
        cameras = self.cameras
        rays = rays_of(cameras.model, intrinsics, cameras.coefficients) @ T_WC.R.T
        nearest, shown = np.full(len(rays), np.inf), np.zeros(len(rays))
        for wall, shade in enumerate(shades):
            axis, limit = wall // 2, (LOW, HIGH)[wall % 2][wall // 2]
            way = (limit - T_WC.p[axis]) / rays[:, axis]
            nearer = (way > 0) & (way < nearest)
            at = T_WC.p + rays * np.where(nearer, way, 1.0)[:, None]
            across = np.delete(at, axis, axis=1) * DOTS_PER_M + 512
            u, v = (x.astype(np.float32).reshape(HEIGHT, WIDTH) for x in across.T)
            plane = cv2.remap(shade, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP).ravel()
            shown, nearest = np.where(nearer, plane, shown), np.where(nearer, way, nearest)
        return np.asarray(shown.reshape(HEIGHT, WIDTH))


def body(t: Floats) -> Poses:
    """Body to world, z up."""
    gone = np.clip((t - REST_S) / 2, 0, None)
    eased = np.where(gone < 1, gone**3 - 0.5 * gone**4, gone - 0.5)
    a = 0.7 * eased
    p = np.stack((2 * np.sin(a), 2 - 2 * np.cos(a), 1.2 + 0.3 * np.sin(1.3 * a)), -1)
    angles = np.stack((a + 0.2 * np.sin(2 * a), 0.08 * np.sin(3 * a), 0.1 * np.sin(2.2 * a)), -1)
    return Poses(Rotation.from_euler("ZYX", angles).as_matrix(), p)


def _imu(t: Floats, chance: np.random.Generator) -> Floats:
    """Gyro and specific force, by differences of the path."""
    before, now, after = (body(t + step) for step in (-STEP_S, 0.0, STEP_S))
    R = Rotation.from_matrix(now.R)
    acceleration = (after.p - 2 * now.p + before.p) / STEP_S**2
    force = R.inv().apply(acceleration + GRAVITY_MPS2 * np.eye(3)[2])
    turn = Rotation.from_matrix(before.R).inv() * Rotation.from_matrix(after.R)
    both = np.hstack((turn.as_rotvec() / (2 * STEP_S) + GYRO_BIAS, force + ACCEL_BIAS))
    density = [IMU_NOISE[f"{name}_noise_density"] for name in ("gyroscope", "accelerometer")]
    sigma = np.repeat(density, 3) * np.sqrt(IMU_HZ)
    return np.asarray(both + chance.normal(size=both.shape) * sigma)


def _ns(t: float) -> int:
    return BEGIN_NS + round(t * 1e9)


def _write_rows(folder: Path, t: Floats, rows: Floats) -> None:
    """As EuRoC's: a line of names behind a #, and lines that end as on Windows."""
    folder.mkdir(parents=True)
    lines = [
        f"{_ns(at)},{','.join(map(repr, row))}" for at, row in zip(t, rows.tolist(), strict=True)
    ]
    (folder / "data.csv").write_text("\r\n".join(["#timestamp [ns],and so on", *lines, ""]))
