# SPDX-License-Identifier: MIT
"""Compares the camera's motion by the images alone with the body's by the twists.

Rates of turn and velocities, one of each for every pair of frames:

    w_C = a R w_B,    v_C = b R (v_B + w_B x r)          r: the camera's place in the body

With R, a, b free and robust weights, R against the given R_CB, and a and b against 1, show errors
of the extrinsic, of units and of the calibration's scale. No axes are assumed: cars turn about one
and drive along another, and two directions fix a rotation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.seen import GAP_PERIODS, pauses
from pelorus.faults.two_views import TwoViews
from pelorus.io.recording import Recording
from pelorus.math import se3
from pelorus.math.motion import held
from pelorus.wire.layout import Floats

SEEN_MOST = 60_000  # observations, which determine the time it takes
POINTS_MIN = 6  # of a pair of frames
ROUNDS = 10
MOVES_MPS, TURNS_RADPS = 0.05, 0.01  # below, a velocity or a rate has no direction
FRAMES_ENOUGH = 50
TURNS_SIGMAS = 4.0
FITS_D2, FITS_PX = 25.0, 3.0  # limits for a pair that fits its frame's motion


@dataclass(frozen=True)
class HandEye:
    """The fit of camera and body motion.

    `R`, `turn_scale`, `way_scale` and their sigmas; `fit`: the share of point pairs that one motion
    a frame explains; `excited`: whether displacements and turns suffice.
    """

    frames: int
    fit: float
    R: Floats
    turn_scale: float
    turn_sigma: float
    way_scale: float
    way_sigma: float
    way_left: float  # share of the displacements that the fit does not explain
    R_covariance: Floats  # rad^2, of a small turn on the left of R
    heading_B: Floats  # unit vector: where the body mostly drives
    speed_mps: float  # of the camera, by the images

    @property
    def turns_are_known(self) -> bool:
        """Returns whether the rates of turn are the camera's at any scale.

        On a straight way they may be noise, and what fits noise best is no fault.
        """
        return abs(self.turn_scale) > TURNS_SIGMAS * self.turn_sigma

    @property
    def is_known(self) -> bool:
        return self.frames >= FRAMES_ENOUGH


def first_part(recording: Recording) -> Recording:
    """Returns the beginning, as long as it can be examined in a reasonable time."""
    tracks = recording.tracks
    most = int(np.searchsorted(tracks.bounds(), SEEN_MOST, side="right")) - 1
    if tracks.frame_count <= most:
        return recording
    rows = tracks.frame < most
    short = type(tracks)(most, tracks.frame[rows], tracks.id[rows], tracks.pixels[rows])
    return replace(recording, tracks=short, frame_t_ns=recording.frame_t_ns[:most])


def hand_eye(recording: Recording, views: TwoViews) -> HandEye:
    """Fits both motions to one another; `views` are of neighbouring frames."""
    fit = share_of_fit(views)
    tau = np.diff(recording.frame_t_ns) * 1e-9
    # motion maps camera k to k + 1; the body's own motion is its inverse
    of_camera = se3.log(se3.inverse(views.motion)) / tau[:, None]
    usable = (views.counts >= POINTS_MIN) & (tau <= GAP_PERIODS * np.median(tau))
    return _fit(recording, of_camera, mean_twists(recording), usable, fit)


def mean_twists(recording: Recording) -> Floats:
    """Returns (k, 6) means of the readings from frame to frame.

    That is the motion but for the order of turns. Unlike the motion it is right for degrees, too,
    which go round several times between two frames.
    """
    t_ns, frames = recording.twist_t_ns, recording.frame_t_ns
    readings = np.hstack((recording.v_B_mps, recording.w_B_radps))
    own = (t_ns - t_ns[0]) * 1e-9
    between = held(readings, recording.header.twist_timing) * np.diff(own)[:, None]
    way = np.concatenate((np.zeros((1, 6)), np.cumsum(between, axis=0)))
    at = (frames - t_ns[0]) * 1e-9
    reached = np.stack([np.interp(at, own, x) for x in way.T], axis=-1)
    mean = np.asarray(np.diff(reached, axis=0) / np.diff(at)[:, None])
    mean[pauses(t_ns, frames[:-1], frames[1:])] = np.nan
    return mean


def share_of_fit(views: TwoViews) -> float:
    """Returns the share of the pairs of observations that their frame's motion explains."""
    fits = views.d2 < np.maximum(FITS_D2, (FITS_PX / views.sigma_px) ** 2)
    return float(np.mean(fits)) if len(fits) else 0.0


def _fit(
    recording: Recording, of_camera: Floats, of_body: Floats, usable: NDArray[np.bool_], fit: float
) -> HandEye:
    usable = usable & np.isfinite(of_camera).all(axis=1) & np.isfinite(of_body).all(axis=1)
    v_C, w_C = of_camera[usable, :3], of_camera[usable, 3:]
    v_B, w_B = of_body[usable, :3], of_body[usable, 3:]
    if len(v_C) < FRAMES_ENOUGH:
        x, axes = float("nan"), np.eye(3)
        return HandEye(len(v_C), fit, axes, x, x, x, x, x, axes, axes[0], 0.0)
    w_B = w_B - np.median(w_B - np.median(w_B, axis=0), axis=0)
    lever = -recording.T_CB.R.T @ recording.T_CB.p
    driven = v_B + np.cross(w_B, lever)
    R, covariance = _rotation(w_B, w_C, driven, v_C)
    turn_scale, turn_sigma, _ = _scale(w_C, w_B @ R.T)
    way_scale, way_sigma, way_left = _scale(v_C, driven @ R.T)
    mean = np.median(driven, axis=0)
    heading = mean / (np.linalg.norm(mean) + 1e-12)
    speed = float(np.median(np.linalg.norm(v_C, axis=1)))
    scales = (turn_scale, turn_sigma, way_scale, way_sigma, way_left)
    return HandEye(len(v_C), fit, R, *scales, covariance, heading, speed)


def _rotation(w_B: Floats, w_C: Floats, v_B: Floats, v_C: Floats) -> tuple[Floats, Floats]:
    """Returns the rotation by Kabsch on both kinds of vectors, and the covariance of a small turn.

    The vectors are in units of their own size, with robust weights; residuals give the covariance.
    """
    pairs = []
    for b, c, least in ((w_B, w_C, TURNS_RADPS), (v_B, v_C, MOVES_MPS)):
        size_b, size_c = (np.median(np.linalg.norm(x, axis=1)) for x in (b, c))
        if size_c > least and size_b > 0:
            pairs.append((b / size_b, c / size_c))
    if not pairs:
        return np.eye(3), np.eye(3)
    b, c = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    share = np.concatenate([np.full(len(p[0]), 1 / np.mean(p[0] ** 2)) for p in pairs])
    R, weight = np.eye(3), np.ones(len(b))
    for _ in range(ROUNDS):
        U, _, Vt = np.linalg.svd((c * (weight * share)[:, None]).T @ b)
        R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
        left = np.sum((c - b @ R.T) ** 2, axis=1)
        weight = 1 / (1 + left / (np.median(left) + 1e-12)) ** 2
    J = -se3.skew(b @ R.T)
    trust = weight * share
    H = np.einsum("nai,naj,n->ij", J, J, trust) + 1e-9 * np.eye(3)
    score = np.einsum("nai,na,n->ni", J, c - b @ R.T, trust)
    half = np.linalg.solve(H, score.T)
    return np.asarray(R), np.asarray(half @ half.T)


def _scale(c: Floats, b: Floats) -> tuple[float, float, float]:
    """Returns s of c = s b, robustly, with b of neighbouring frames as instruments."""
    instrument = 0.5 * (np.roll(b, 1, axis=0) + np.roll(b, -1, axis=0))
    instrument[[0, -1]] = 0
    offset_c, offset_b = np.zeros(3), np.zeros(3)
    weight, s = np.ones(len(b)), 1.0
    for _ in range(ROUNDS):
        along = np.sum(instrument * (b - offset_b), axis=1)
        s = float(np.sum(weight * np.sum(instrument * (c - offset_c), axis=1)))
        s /= float(np.sum(weight * along)) or 1e-12
        left = c - s * b
        squared = np.sum(left**2, axis=1)
        weight = 1 / (1 + squared / (4 * np.median(squared) + 1e-12)) ** 2
    score = weight * np.sum(instrument * left, axis=1)
    power = abs(float(np.sum(weight * along)))
    sigma = float(np.sqrt(np.sum(score**2))) / power if power > 0 else float("inf")
    return s, sigma, float(np.sqrt(np.median(squared) / (np.median(np.sum(c**2, axis=1)) + 1e-12)))


def angle_between(A: Floats, B: Floats) -> float:
    """Returns the angle between two rotations, degrees."""
    cosine = (np.trace(A.T @ B) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
