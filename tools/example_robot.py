# SPDX-License-Identifier: MIT
"""Writes what a robot with two cameras, odometry and a gyro leaves behind: docs/TEN-MINUTES.md.

usage: .venv/bin/python tools/example_robot.py FOLDER

The files are as such robots have them, not as Pelorus would like them: times in ms, km/h, degrees a
second, tracks in raw pictures with the bend of their lenses, a calibration by Kalibr.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pelorus.errors import PelorusError, writing
from pelorus.io.recording import Recording
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Camera, TwistTiming
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

BEGIN_MS = 1_763_822_000_000  # the robot's clock counts from 1970
LENS = (-0.28, 0.07, 0.0002, 0.00002)  # Kalibr's radtan
DRIVE = Options(
    seed=11,
    duration_s=30.0,
    speed_mps=1.5,
    twist_rate_hz=50.0,
    twist_timing=TwistTiming.MID,  # a reading holds at its stamp
    range_m=20.0,
    bias_velocity_sigma_mps=0.02,
    bias_gyro_sigma_radps=0.01,
)


def write(folder: Path) -> None:
    """Writes odometry.csv, gyro.csv, tracks.csv, camchain.yaml, truth.tum."""
    drive = simulate(DRIVE).recording
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    t_ms, speed = stamps(drive.twist_t_ns), 3.6 * drive.v_B_mps
    write_csv(folder / "odometry.csv", "stamp_ms,ahead_kmh,left_kmh,up_kmh", t_ms, speed)
    turn = np.degrees(drive.w_B_radps)
    write_csv(folder / "gyro.csv", "stamp_ms,gx_dps,gy_dps,gz_dps", t_ms, turn)
    tracks = drive.tracks
    seen = np.column_stack(
        (tracks.id.astype(np.float64), bent(drive.header.camera, tracks.pixels).round(3))
    )
    titles = "stamp_ms,track,left_u,left_v,right_u,right_v"
    write_csv(folder / "tracks.csv", titles, stamps(drive.frame_t_ns[tracks.frame]), seen)
    write_calibration(folder / "camchain.yaml", drive)
    poses = np.column_stack((drive.truth.p, Rotation.from_matrix(drive.truth.R).as_quat()))
    with (folder / "truth.tum").open("w") as stream:
        for t, pose in zip(drive.truth_t_ns, poses.tolist(), strict=True):
            numbers = " ".join(f"{number:.9f}" for number in pose)
            stream.write(f"{BEGIN_MS // 1000 + t / 1e9:.3f} {numbers}\n")


def stamps(t_ns: NDArray[np.int64]) -> list[int]:
    """Returns the times on the robot's clock, ms."""
    return [BEGIN_MS + t // 1_000_000 for t in t_ns.tolist()]


def bent(camera: Camera, pixels: Floats) -> Floats:
    """Returns the raw pixels of rectified ones (n, 4)."""
    K = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1.0]])
    rays = (pixels.reshape(-1, 2) - K[:2, 2]) / (camera.fx_px, camera.fy_px)
    points = np.column_stack((rays, np.ones(len(rays))))
    raw, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(LENS))
    return np.asarray(raw.reshape(-1, 4), np.float64)


def write_csv(path: Path, titles: str, t_ms: list[int], values: Floats) -> None:
    """Writes a row for each reading, time first."""
    with path.open("w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(titles.split(","))
        table.writerows(
            [t, *(f"{x:.9g}" for x in row)] for t, row in zip(t_ms, values, strict=True)
        )


def write_calibration(path: Path, drive: Recording) -> None:
    """Writes Kalibr's camchain-imucam; the robot's body is the gyro's."""
    camera = drive.header.camera
    to_right = np.eye(4)
    to_right[0, 3] = -camera.baseline_m
    to_left = np.eye(4)
    to_left[:3, :3], to_left[:3, 3] = drive.T_CB
    cameras = [
        {
            "camera_model": "pinhole",
            "intrinsics": [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px],
            "distortion_model": "radtan",
            "distortion_coeffs": list(LENS),
            "resolution": [drive.header.image_width_px, drive.header.image_height_px],
            "T_cam_imu": T.tolist(),
            "timeshift_cam_imu": 0.0,
        }
        for T in (to_left, to_right @ to_left)
    ]
    cameras[1]["T_cn_cnm1"] = to_right.tolist()
    with path.open("w") as stream:
        YAML(typ="safe", pure=True).dump({"cam0": cameras[0], "cam1": cameras[1]}, stream)


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit((__doc__ or "").split("\n\n")[1])
    try:
        write(Path(sys.argv[1]))
    except (PelorusError, OSError) as error:
        sys.exit(f"{sys.argv[1]}: {error}")
    print("\n".join(str(path) for path in sorted(Path(sys.argv[1]).iterdir())))
