# SPDX-License-Identifier: MIT
"""A robot with an IMU, wheels and a stereo camera, from Python: it drives round a circle, and for
ten seconds it is dark. The world is made up here; on a robot the three come from its drivers.

usage: python wheels_and_imu.py [--no-wheels]
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray
from pelorus import Calibration, Filter, FilterError, observations

R_CB = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # body: forward, left, up
CAMERA = Calibration(450, 450, 320, 240, 0.12, R_CB)
RADIUS_M, SPEED_MPS, REST_S, RAMP_S = 4.0, 0.8, 2.0, 2.0
IMU_HZ, WHEEL_HZ, FRAME_HZ, SECONDS, DARK_S = 200, 50, 10, 30, (15.0, 25.0)
WHEEL_SIGMA_MPS = 0.03

chance = np.random.default_rng(1)
angle = chance.uniform(0, 2 * np.pi, 1500)
reach = chance.uniform(RADIUS_M + 2, RADIUS_M + 8, 1500)
points_W = np.stack(
    [reach * np.sin(angle), RADIUS_M - reach * np.cos(angle), chance.uniform(-2, 2, 1500)], axis=1
)


def truth(t_s: float) -> tuple[float, NDArray[np.float64], float, float]:
    """Returns heading, position, speed and acceleration ahead: rest, ramp, round and round."""
    moving = max(t_s - REST_S, 0.0)
    ramp = min(moving, RAMP_S)
    way = SPEED_MPS * (ramp**2 / (2 * RAMP_S) + max(moving - RAMP_S, 0.0))
    heading = way / RADIUS_M
    place = RADIUS_M * np.array([np.sin(heading), 1 - np.cos(heading), 0.0])
    return heading, place, SPEED_MPS * ramp / RAMP_S, (0 < moving < RAMP_S) * SPEED_MPS / RAMP_S


def imu(t_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns specific force and rate, with the noise of a cheap part at this rate."""
    _, _, v, a = truth(t_s)
    turn = v / RADIUS_M
    noise = chance.normal(0, 1, 6) * ([0.04] * 3 + [0.004] * 3)
    return np.array([a, v * turn, 9.81]) + noise[:3], np.array([0, 0, turn]) + noise[3:]


def camera(t_s: float) -> NDArray[np.void]:
    """Returns the observations of at most 40 points in sight, with half a pixel of noise."""
    heading, place, _, _ = truth(t_s)
    c, s = np.cos(heading), np.sin(heading)
    R_WB = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    x, y, z = ((points_W - place) @ R_WB @ R_CB.T).T
    u, v = 320 + 450 * x / z, 240 + 450 * y / z
    ids = np.flatnonzero((z > 1) & (abs(u - 320) < 320) & (abs(v - 240) < 240))[:40]
    pixels = np.stack([u, v, u - 450 * 0.12 / z, v], axis=1)[ids]
    return observations(ids, pixels + chance.normal(0, 0.5, pixels.shape))


def main() -> None:
    """Drives; prints each second where the filter is, how far off, and how far it says."""
    by_wheels = "--no-wheels" not in sys.argv[1:]
    filter = Filter(CAMERA, {"process": "imu", "pixel-sigma": 0.5})
    nothing = observations(np.zeros(0, int), np.zeros((0, 4)))
    for k in range(SECONDS * IMU_HZ + 1):
        t_s, t_ns = k / IMU_HZ, k * 10**9 // IMU_HZ
        filter.inertial(t_ns, *imu(t_s))
        if by_wheels and k % (IMU_HZ // WHEEL_HZ) == 0 and t_s > REST_S:  # once it has started
            speed = truth(t_s)[2] + chance.normal(0, WHEEL_SIGMA_MPS)
            filter.measure(t_ns, "wheel", [speed, 0, 0], [WHEEL_SIGMA_MPS, 0, 0])
        if k % (IMU_HZ // FRAME_HZ) == 0:
            dark = DARK_S[0] <= t_s < DARK_S[1]
            report = filter.update(t_ns, nothing if dark else camera(t_s))
        if k % IMU_HZ == 0:
            p = filter.pose().p
            off = np.linalg.norm(p - truth(t_s)[1])
            sigma = np.sqrt(np.trace(filter.pose_covariance()[:3, :3]))
            print(
                f"{t_s:4.0f} s  x {p[0]:6.2f}  y {p[1]:6.2f} m  off {off:5.3f} m, "
                f"sigma {sigma:5.3f} m  {report.reasons}"
            )


if __name__ == "__main__":
    try:
        main()
    except FilterError as error:
        sys.exit(f"{error}")
