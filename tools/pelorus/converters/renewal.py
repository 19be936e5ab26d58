# SPDX-License-Identifier: MIT
"""Draws simulated tracks anew: with other ids and other pixel noise, for the same drive.

A simulator's landmarks keep their id when they come back, which no tracker does: a new id after a
frame's absence imitates one. And where the true poses are known, a simulated recording can be drawn
again: each landmark is put where all of its observations together see it, projected into every
frame that has it, and gets fresh noise. These places are not those of the first draw, but make as
good a world.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pelorus.evaluate import evaluation
from pelorus.faults.finding import Finding
from pelorus.io.foreign import ForeignFileError
from pelorus.io.recording import Recording
from pelorus.io.tracks import Indices, Tracks, point_jacobian, project, triangulate
from pelorus.io.trajectory import Trajectory
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Camera, Text
from pelorus.wire.layout import Floats

PASSES = 8  # of Gauss-Newton: a point from stereo is near
DISPARITY_MIN_PX = 0.5
DEPTH_MIN_M = 0.1
FLOOR = 1e-6  # px^2/m^2: a point at 1 km has 1e-3 by stereo alone
MISFIT_MAX = 1.5  # ratio to pixel sigma beyond which the tracks are not of fixed points


def with_new_ids(tracks: Tracks, chance: np.random.Generator | None = None) -> Tracks:
    """Gives each unbroken run of frames its own id: in the order of beginning, or at random."""
    order = np.lexsort((tracks.frame, tracks.id))
    frame, id = tracks.frame[order], tracks.id[order]
    begins = np.ones(len(order), bool)
    begins[1:] = (np.diff(id) != 0) | (np.diff(frame) != 1)
    run: NDArray[np.int64] = np.empty(len(order), np.int64)
    run[order] = np.cumsum(begins) - 1
    first = np.argsort(order[begins])  # rows are sorted by frame, then id
    number = np.empty(len(first), np.int64)
    number[first] = np.arange(len(first)) if chance is None else chance.permutation(len(first))
    return tracks.with_ids(number[run])


def with_noise(recording: Recording, sigma_px: float, chance: np.random.Generator) -> Recording:
    """Adds noise; the HEADER's sigma covers that and the old one."""
    tracks, noise = recording.tracks, recording.header.noise
    pixels = tracks.pixels + sigma_px * chance.standard_normal(tracks.pixels.shape)
    whole = float(np.hypot(noise.pixel_sigma_px, sigma_px))
    noisy = replace(recording, tracks=replace(tracks, pixels=pixels))
    return noisy.with_header(noise=replace(noise, pixel_sigma_px=whole))


def renew(
    source: Path, recording: Recording, chance: np.random.Generator
) -> tuple[Recording, Finding]:
    """Returns the recording with fresh noise of the HEADER's sigma on the true pixels."""
    tracks, sigma = recording.tracks, recording.header.noise.pixel_sigma_px
    T_CW = _camera_poses(source, recording)
    whose, landmarks = np.unique(tracks.id, return_inverse=True)
    points = _points(recording.header.camera, tracks, T_CW, landmarks)
    q = se3.apply(T_CW, points[landmarks])
    if not q[:, 2].min() >= DEPTH_MIN_M:
        row = int(q[:, 2].argmin())
        raise _no_fixed_points(source, f"id {tracks.id[row]} would stand behind the camera")
    exact = project(recording.header.camera, q)
    numbers = tracks.pixels.size - 3 * len(whose)
    misfit = float(np.sqrt(np.sum((tracks.pixels - exact) ** 2) / numbers))
    if not misfit <= MISFIT_MAX * sigma:
        raise _no_fixed_points(source, f"they are {misfit:.2f} px off, pixel_sigma is {sigma:g} px")
    pixels = exact + sigma * chance.standard_normal(exact.shape)
    drawn = replace(recording, tracks=replace(tracks, pixels=pixels))
    remark = Text(f"pixels drawn anew with noise of {sigma:g} px")
    finding = Finding(
        "tracks to be drawn anew",
        False,
        f"{len(whose)} landmarks, placed by all that sees them from the true poses, are "
        f"{misfit:.3f} px off their observations ({sigma:g} px are told)",
        f"every observation is drawn anew: its landmark's projection and noise of {sigma:g} px",
    )
    return replace(drawn, remarks=[*recording.remarks, remark]), finding


def _no_fixed_points(source: Path, why: str) -> ForeignFileError:
    return ForeignFileError(
        source,
        "its observations are not those of points that stand still, seen from the true poses: "
        f"{why}; a simulated recording is expected for --seed",
    )


def _camera_poses(source: Path, recording: Recording) -> Poses:
    """Returns world to left camera for every observation."""
    frames = Trajectory(recording.frame_t_ns, Poses(np.empty((0, 3, 3)), np.empty((0, 3))))
    truth = Trajectory(recording.truth_t_ns, recording.truth)
    mine, theirs = evaluation.match(frames, truth, 0)
    if len(mine) < len(recording.frame_t_ns):
        raise ForeignFileError(
            source,
            f"{len(recording.frame_t_ns) - len(mine)} frames have no truth of their time; for "
            "--seed one each is expected",
        )
    poses = se3.compose(recording.T_CB, se3.inverse(recording.truth.at(theirs)))
    return poses.at(recording.tracks.frame)


def _points(camera: Camera, tracks: Tracks, T_CW: Poses, landmarks: Indices) -> Floats:
    """Returns the landmarks (n, 3) in the world, by least squares over all of their pixels."""
    T_WC = se3.inverse(T_CW)
    u_left, v_left, u_right, v_right = tracks.pixels.T
    near = np.maximum(u_left - u_right, DISPARITY_MIN_PX)
    seen = triangulate(camera, np.stack((u_left, v_left, u_left - near, v_right), axis=-1))
    # far points with noisy disparity count little: the variance of depth grows with depth^4
    weight = 1 / seen[:, 2] ** 4
    points = (
        _sums(landmarks, weight[:, None] * se3.apply(T_WC, seen))
        / _sums(landmarks, weight)[:, None]
    )
    for _ in range(PASSES):
        q = se3.apply(T_CW, points[landmarks])
        q[:, 2] = np.maximum(q[:, 2], DEPTH_MIN_M)
        J = point_jacobian(camera, q) @ T_CW.R
        r = tracks.pixels - project(camera, q)
        N = _sums(landmarks, np.einsum("nki,nkj->nij", J, J))
        b = _sums(landmarks, np.einsum("nki,nk->ni", J, r))
        N += FLOOR * np.eye(3)  # a point without observations stays
        points = points + np.linalg.solve(N, b[..., None])[..., 0]
    return points


def _sums(groups: Indices, values: Floats) -> Floats:
    """Returns the sum of the values (n, ...) of each group."""
    out = np.zeros((int(groups.max()) + 1, *values.shape[1:]))
    np.add.at(out, groups, values)
    return out
