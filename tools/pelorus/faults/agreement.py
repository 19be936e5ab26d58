# SPDX-License-Identifier: MIT
"""Estimates how far camera and twists disagree in scale, place and time, with standard errors.

Both give a turn and a velocity for each pair of frames: twists directly (twist_body), an IMU up to
the unknown start of each stretch of the drive (imu_body). All unknowns are estimated together: a
speed that varies separates a scale from a bias, turns show a lever, and changing motion shows a
clock that is off.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pelorus.faults.clocks import FRAMES_MIN, UNTOLD, TwoClocks, offset_of, two_clocks
from pelorus.faults.fit import CLOCK, FOCAL, LEVER, SCALE, TILT, TURN, TURN_SCALE, Body, Fit
from pelorus.faults.imu_body import ImuBody
from pelorus.faults.seen import CameraMotion
from pelorus.faults.twist_body import TwistBody
from pelorus.faults.two_views import TwoViews, two_views
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.wire.layout import Floats

NO_BIAS_MPS = 1e-4
BIAS_MPS = 0.1  # m/s, sigma of the velocity's bias, as the filter's setting
BIAS_MPS2 = 0.3  # m/s^2, of a cheap accelerometer's bias, where the HEADER has none
HALVED_MIN = 0.8  # share of the frames that must be usable with half of their points
CHANCE = 2.0  # standard errors by which near and far may differ


@dataclass(frozen=True)
class Agreement:
    """The disagreement of camera and body: `scale` 1, `lever_m` 0 and `offset_s` 0 are expected."""

    frames: int
    scale: float  # with a free bias
    scale_sigma: float
    through_zero: float  # the scale if there is no bias
    through_zero_sigma: float
    lever_m: Floats  # the camera's true place in the body minus the given one
    lever_covariance: Floats
    offset_s: float  # to be added to the frames' times
    offset_sigma_s: float
    speed_mps: float
    turn_scale: float  # 1 is expected
    turn_scale_sigma: float
    focal: float = 1.0  # factor of the given one, by an IMU; 1 is expected
    focal_sigma: float = float("inf")
    # of the camera in the body's axes, against the given rotation; by twists
    tilt_rad: Floats | None = None
    tilt_covariance: Floats | None = None
    clocks: TwoClocks = UNTOLD  # of velocities and of turns separately; none for an IMU

    @property
    def is_known(self) -> bool:
        return self.frames >= FRAMES_MIN


def halved(recording: Recording, seen: CameraMotion, lag: int) -> CameraMotion:
    """Returns `seen` with estimates from halves of the points, where these give enough frames."""
    return seen.with_halves(recording, lag, int(HALVED_MIN * seen.usable.sum()))


def agreement(recording: Recording, views: TwoViews, seen: CameraMotion | None = None) -> Agreement:
    """Fits scale, lever and clock; assumes that rotation and units are right. `seen` is the
    views' motion, if it is known already.
    """
    seen = CameraMotion.of(recording, views) if seen is None else seen
    if seen.usable.sum() < FRAMES_MIN:
        nan = float("nan")
        return Agreement(
            int(seen.usable.sum()), nan, nan, nan, nan, np.zeros(3), np.eye(3), nan, nan, nan,
            nan, nan,
        )  # fmt: skip
    body, bias = _body(recording, seen)
    by_imu = len(recording.inertial.t_ns) > 0
    if by_imu and seen.halves is None:
        seen = halved(recording, seen, views.lag)
    offset = offset_of(recording, body, seen, bias)
    found = None if by_imu else Fit(body.design(recording, seen, offset, bias))
    clock_told = found is None or found.tells(CLOCK)
    if not clock_told:
        offset, found = 0.0, None
    clocks = two_clocks(recording, seen, offset, bias) if clock_told and not by_imu else UNTOLD
    at = offset
    own = found or Fit(body.design(recording, seen, at, bias))
    clock_sigma = own.known(CLOCK) if clock_told else float("inf")
    if clocks.apart:  # only motions of the same time are compared
        body, at, found = TwistBody(recording, clocks.turns_late_s), clocks.ways_s, None
    if found is None:
        found = Fit(body.design(recording, seen, at, bias))
    none = place = found
    turns_known = by_imu or found.tells(TURN_SCALE)
    if not by_imu:
        late = clocks.turns_late_s if clocks.apart else None
        place = Fit(TwistBody(recording, late, True).design(recording, seen, at, bias))
        none = Fit(body.design(recording, seen, at, NO_BIAS_MPS))
    speed = float(np.median(np.linalg.norm(found.g, axis=1))) + 1e-12
    scale, sigma = float(found.x[SCALE]), _sigma(found, by_imu)
    by_prior = float(np.hypot(none.known(SCALE), bias / speed))
    if not by_imu and sigma > by_prior:  # then the prior of the bias is used
        scale, sigma = float(none.x[SCALE]), by_prior
    doubt = _doubt(recording, views, body, (at, bias if by_imu else NO_BIAS_MPS), none)
    lever = slice(LEVER, LEVER + 3)
    tilt = (None, None) if by_imu else _tilt(found)
    return Agreement(
        found.frames,
        1 + scale,
        float(np.hypot(sigma, doubt)),
        1 + float(none.x[SCALE]),
        float(np.hypot(none.known(SCALE), doubt)),
        place.x[lever],
        place.covariance_known(range(LEVER, LEVER + 3)),
        offset,
        clock_sigma,
        speed,
        1 + float(found.x[TURN_SCALE]),
        found.known(TURN_SCALE) if turns_known else float("inf"),
        1 - float(found.x[FOCAL]),
        found.known(FOCAL) if by_imu else float("inf"),
        tilt_rad=tilt[0],
        tilt_covariance=tilt[1],
        clocks=clocks,
    )


def _tilt(fit: Fit) -> tuple[Floats, Floats]:
    """Returns the camera's tilt (3,), rad, from velocities and rates of turn, and its covariance.

    Velocities may have a bias across the way; rates show nothing about the axis of the turns. Each
    counts with its own covariance.
    """
    both = [*range(TILT, TILT + 3), *range(TURN, TURN + 3)]
    known = np.linalg.inv(fit.covariance[np.ix_(both, both)])
    same = np.vstack((np.eye(3), np.eye(3)))
    covariance = np.linalg.inv(same.T @ known @ same)
    return np.asarray(covariance @ same.T @ known @ fit.x[both]), np.asarray(covariance)


def _sigma(fit: Fit, by_imu: bool) -> float:
    """Returns the standard error of the scale.

    With an IMU the blocks are shorter than the stretches that share unknowns, and show too little
    of what lasts: of the readings' noise, which the fit adds itself (drift.py), and of the images'.
    """
    return max(fit.known(SCALE), fit.image_sigma[SCALE]) if by_imu else fit.known(SCALE)


def _body(recording: Recording, seen: CameraMotion) -> tuple[Body, float]:
    """Returns the model of the body's motion, and the sigma of its bias."""
    noise = recording.header.noise
    if len(recording.inertial.t_ns):
        told = noise.bias_accel_sigma
        return ImuBody(recording, seen), told if told > 0 else BIAS_MPS2
    told = noise.bias_velocity_sigma_mps
    return TwistBody(recording), told if told > 0 else BIAS_MPS


def _doubt(
    recording: Recording, views: TwoViews, body: Body, at: tuple[float, float], fit: Fit
) -> float:
    """Returns the uncertainty of the scale beyond its standard error."""
    near_and_far = _doubt_by_depth(recording, views, body, at)
    return float(np.hypot(near_and_far, _doubt_by_noise(recording, views, body, at, fit)))


def _doubt_by_depth(
    recording: Recording, views: TwoViews, body: Body, at: tuple[float, float]
) -> float:
    """Returns by how much the scales of near and far points differ beyond noise.

    An offset of the disparity, or a tracker that lags, shows in it. `at`: the clock's offset, s,
    and the sigma of a bias.
    """
    halves = []
    for tracks in by_depth(recording.tracks):
        part = replace(recording, tracks=tracks)
        seen = CameraMotion.of(part, two_views(tracks, recording.header.camera, views.lag))
        if seen.usable.sum() < FRAMES_MIN:
            return 0.0
        fit = Fit(body.design(part, seen, *at))
        halves.append((fit.x[SCALE], fit.image_sigma[SCALE]))
    (near, near_sigma), (far, far_sigma) = halves
    excess = (near - far) ** 2 - CHANCE**2 * (near_sigma**2 + far_sigma**2)
    return float(np.sqrt(max(excess, 0.0)) / 2)


def _doubt_by_noise(
    recording: Recording, views: TwoViews, body: Body, at: tuple[float, float], fit: Fit
) -> float:
    """Returns the bias of the scale by pixel noise, one sigma.

    The scale is estimated again with pixel noise of twice the variance: where disparities are
    hardly larger than their noise every way comes out too short. The noise that is there has
    changed the scale by as much if the effect grows with its square, and by a third if with its
    fourth power (Cook and Stefanski 1994); half is one sigma. `at` is as in _doubt_by_depth, `fit`
    that of the data.
    """
    tracks = recording.tracks
    more = np.random.default_rng(1).normal(0, views.sigma_px, tracks.pixels.shape)
    noisy = replace(recording, tracks=replace(tracks, pixels=tracks.pixels + more))
    seen = CameraMotion.of(noisy, two_views(noisy.tracks, recording.header.camera, views.lag))
    if seen.usable.sum() < FRAMES_MIN:
        return 0.0
    if len(recording.inertial.t_ns):
        seen = halved(noisy, seen, views.lag)
    other = Fit(body.design(noisy, seen, *at))
    change = other.x[SCALE] - fit.x[SCALE]
    excess = change**2 - CHANCE**2 * other.image_sigma[SCALE] ** 2
    return float(np.sqrt(max(excess, 0.0))) / 2


def by_depth(tracks: Tracks) -> tuple[Tracks, Tracks]:
    """Returns the near and the far half of the points, each point whole."""
    disparity = tracks.pixels[:, 0] - tracks.pixels[:, 2]
    _, number = np.unique(tracks.id, return_inverse=True)
    mean = np.bincount(number, disparity) / np.bincount(number)
    near = (mean >= np.median(mean[number]))[number]
    return tracks.at(near), tracks.at(~near)
