# SPDX-License-Identifier: MIT
"""Simulated drives as the course's files would hold them, and the faults to put into them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks, project, triangulate
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.simulate.simulate import Options, simulate
from scipy.spatial.transform import Rotation

FORWARD_RIGHT_DOWN = np.diag([1.0, -1.0, -1.0])
QUIET = Options(
    twist_rate_hz=10.0,
    lap_s=20.0,
    drop=0.0,
    outliers=0.01,
    velocity_sigma_mps=0.05,
    gyro_sigma_radps=0.005,
    pixel_sigma_px=0.5,
)

PERFECT = Options(  # no noise, no bias, and every track lasts
    pixel_sigma_px=0.0,
    velocity_sigma_mps=0.0,
    gyro_sigma_radps=0.0,
    bias_velocity_sigma_mps=0.0,
    bias_gyro_sigma_radps=0.0,
    outliers=0.0,
    drop=0.0,
    loss=0.0,
    duration_s=20.0,
)


@cache
def clean(seed: int = 1, **changes: Any) -> Recording:
    """A drive without a fault: a twist a frame, all frames there."""
    return simulate(replace(QUIET, seed=seed, **changes)).recording


def with_turned_axes(recording: Recording, F: Any = FORWARD_RIGHT_DOWN) -> Recording:
    """Fault D: the extrinsic belongs to another body than the twists."""
    T = recording.T_CB
    return recording.with_extrinsic(Poses(T.R @ F, T.p))


def with_camera_position(recording: Recording) -> Recording:
    """Fault A: the translation is the camera's position in the body."""
    T = recording.T_CB
    return recording.with_extrinsic(Poses(T.R, -T.R.T @ T.p))


def with_stale_tracks(recording: Recording, frames: range) -> tuple[Recording, int]:
    """Fault B: in these frames all live tracks repeat their pixels and then follow another point.

    The other point is the one that lies at these pixels in that frame, at the same disparity.
    Returns how many observations repeat.
    """
    camera, tracks = recording.header.camera, recording.tracks
    T_WC = se3.compose(recording.truth, se3.inverse(recording.T_CB))
    pixels = tracks.pixels.copy()
    repeated = 0
    for k in frames:
        pairs = tracks.pairs(1)
        now = pairs.second[tracks.frame[pairs.second] == k]
        before = pairs.first[tracks.frame[pairs.second] == k]
        repeated += len(now)
        old = pixels[before]
        disparity = np.maximum(old[:, 0] - old[:, 2], 0.5)
        sound = np.stack((old[:, 0], old[:, 1], old[:, 0] - disparity, old[:, 3]), axis=-1)
        points = se3.apply(Poses(T_WC.R[k], T_WC.p[k]), triangulate(camera, sound))
        point_of = dict(zip(tracks.id[now].tolist(), points, strict=True))
        later = np.nonzero((tracks.frame > k) & np.isin(tracks.id, tracks.id[now]))[0]
        follows = np.array([point_of[i] for i in tracks.id[later].tolist()])
        T_CW = se3.inverse(T_WC.at(tracks.frame[later]))
        q = se3.apply(T_CW, follows)
        q[:, 2] = np.maximum(q[:, 2], 0.5)
        noise = tracks.pixels[later] - np.round(tracks.pixels[later])  # some, and always the same
        pixels[later] = project(camera, q) + noise
        pixels[now] = old
    return replace(recording, tracks=replace(tracks, pixels=pixels)), repeated


def at_rest(frames: int = 80) -> Recording:
    """A camera that stands still and repeats every pixel bit for bit, under a creeping sensor."""
    moving = clean()
    first = moving.tracks.frame == 0
    count = int(first.sum())
    tracks = Tracks(
        frames,
        np.repeat(np.arange(frames), count),
        np.tile(moving.tracks.id[first], frames),
        np.tile(moving.tracks.pixels[first], (frames, 1)),
    )
    chance = np.random.default_rng(3)
    return replace(
        moving,
        twist_t_ns=moving.twist_t_ns[:frames],
        v_B_mps=chance.normal(0, 0.01, (frames, 3)),
        w_B_radps=chance.normal(0, 0.0005, (frames, 3)),
        frame_t_ns=moving.frame_t_ns[:frames],
        tracks=tracks,
    )


def dense(tracks: Tracks) -> Any:
    """(4, M, T), all -1 where absent, ids as columns."""
    features = np.full((4, int(tracks.id.max()) + 1, tracks.frame_count), -1.0)
    features[:, tracks.id, tracks.frame] = tracks.pixels.T
    return features


def npz_arrays(recording: Recording, edition: int = 2021) -> dict[str, Any]:
    """What a file of the course holds; editions name and direct the extrinsic differently."""
    camera = recording.header.camera
    T_CB = np.eye(4)
    T_CB[:3, :3], T_CB[:3, 3] = recording.T_CB
    K = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1]])
    new = edition >= 2021
    return {
        "time_stamps": 1.3e9 + recording.frame_t_ns[None] * 1e-9,
        "features": dense(recording.tracks),
        "linear_velocity": recording.v_B_mps.T,
        "angular_velocity" if new else "rotational_velocity": recording.w_B_radps.T,
        "K": K,
        "b": np.array(camera.baseline_m),
        "imu_T_cam" if new else "cam_T_imu": np.linalg.inv(T_CB) if new else T_CB,
    }


def mat_arrays(recording: Recording, time_first: bool = True) -> dict[str, Any]:
    """What a .mat of Starry Night or of the KLT drives holds; twists a few more than frames."""
    camera, T_CB = recording.header.camera, recording.T_CB
    features = dense(recording.tracks)
    count = recording.tracks.frame_count
    extra = np.zeros((3, 4))
    return {
        "y_k_j": np.swapaxes(features, 1, 2) if time_first else features,
        "t": recording.frame_t_ns[None, :count] * 1e-9,
        "v_vk_vk_i": np.hstack((recording.v_B_mps.T, extra)),
        "w_vk_vk_i": np.hstack((recording.w_B_radps.T, extra)),
        "theta_vk_i": np.hstack((Rotation.from_matrix(recording.truth.R).as_rotvec().T, extra)),
        "r_i_vk_i": np.hstack((recording.truth.p.T, extra)),
        "fu": camera.fx_px,
        "fv": camera.fy_px,
        "cu": camera.cx_px,
        "cv": camera.cy_px,
        "b": camera.baseline_m,
        "C_c_v": T_CB.R,
        "rho_v_c_v": (-T_CB.R.T @ T_CB.p)[:, None],
    }
