# SPDX-License-Identifier: MIT
"""Compares wheels beside an IMU with the pictures: their scale, and the distance between them.

A wheel at l on the body reads r along the body's x. With the pictures' velocity v, the gyro's rate
w, and m, the factor of the distance between wheels,

    v_x + l_z w_y = a r + m l_y w_z,      a = 1 and m = 1 are expected

is fitted by robust least squares: a wheel that slips for a while counts nothing. Of one wheel m is
1. Leaving out blocks of the drive in turn gives the standard errors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pelorus.faults.agreement import by_depth
from pelorus.faults.fault import Fault
from pelorus.faults.force import mean_rates
from pelorus.faults.seen import BLOCKS, CameraMotion, pauses
from pelorus.faults.two_views import TwoViews, two_views
from pelorus.io.recording import Recording
from pelorus.io.small_sensors import SMALL_SENSORS
from pelorus.math.motion import Times
from pelorus.wire.frames import Reading
from pelorus.wire.layout import Floats

WHEEL = next(sensor for sensor in SMALL_SENSORS if sensor.name == "wheel")
SCALE, TRACK = 0, 1
SIGMAS, OFF_LEAST = 4.0, (0.015, 0.03)
FRAMES_LEAST = 100  # that a fit needs, in which the wheels move
MOVING_MPS = 0.05
ROUNDS, CUT = 5, 6.0  # of the weights; standard deviations from which a frame counts nothing
CHANCE = 2.0  # standard errors by which near and far may differ
SIGMA_MOST = 0.2  # of the filter's settings
SCATTER_MOST = 2.0  # factor of a reading's sigma


def of_wheels(recording: Recording, views: TwoViews) -> Iterator[Fault]:
    """Yields faults of the wheels beside an IMU, which must agree with the pictures."""
    wheels = _wheels(recording)
    if not wheels or not len(recording.inertial.t_ns):
        return
    yield from _noisy(wheels)
    found = _with_doubts(recording, wheels, views)
    if found is None:
        return
    x, sigma = found
    off = [
        abs(value - 1) > max(SIGMAS * s, least)
        for value, s, least in zip(x, sigma, OFF_LEAST, strict=False)
    ]
    if off[SCALE]:
        which = "larger" if x[SCALE] > 1 else "smaller"
        words = (
            f"the pictures show {x[SCALE]:.3f} +- {sigma[SCALE]:.3f} times the wheels' speed: "
            f"their radius is {which} than was told (multiply the speed by {x[SCALE]:.3f}), or the "
            "baseline is off"
        )
        yield _fault("wheel-scale", words, x[SCALE] - 1, sigma[SCALE])
    if len(off) > 1 and off[TRACK]:
        words = (
            f"by their readings the wheels are {x[TRACK]:.3f} +- {sigma[TRACK]:.3f} times as far "
            "apart as was told: measure their distance where they touch the floor"
        )
        yield _fault("wheel-track", words, x[TRACK] - 1, sigma[TRACK])


def _fault(name: str, words: str, off: float, sigma: float) -> Fault:
    """Returns the fault, with the settings by which the filter estimates what is off."""
    prior = min(float(f"{abs(off) + 2 * sigma:.1g}"), SIGMA_MOST)
    settings = {"calibrate": name, f"{name}-sigma": f"{prior:g}"}
    ratio = (off / sigma) ** 2
    return Fault(name, words, stops=False, grave=False, ratio=ratio, settings=settings)


def _wheels(recording: Recording) -> list[list[Reading]]:
    """Returns the readings ahead of each wheel, by its place."""
    ahead = [m for m in recording.readings if m.sensor == WHEEL.number and m.axes & WHEEL.axes("x")]
    places = sorted({tuple(m.at_B_m.tolist()) for m in ahead}, key=lambda at: -at[1])
    return [[m for m in ahead if tuple(m.at_B_m.tolist()) == at] for at in places]


def _noisy(wheels: Sequence[Sequence[Reading]]) -> Iterator[Fault]:
    """Yields a fault where readings scatter by far more than their sigma: second differences, in
    which nothing of a body's motion is.
    """
    ratios = [1.0]
    for own in wheels:
        second = np.diff([m.value[0] for m in own], 2) / np.sqrt(6)
        told = float(np.median([m.sigma[0] for m in own]))
        if len(second) >= FRAMES_LEAST:
            ratios.append(1.48 * float(np.median(np.abs(second))) / told)
    if max(ratios) > SCATTER_MOST:
        words = f"readings of the wheels scatter by {max(ratios):.1f} times their sigma: tell a "
        yield Fault("wheel-noise", f"{words}larger one", stops=False, grave=False)


def _with_doubts(
    recording: Recording, wheels: list[list[Reading]], views: TwoViews
) -> tuple[Floats, Floats] | None:
    """Returns the fit and its sigmas; None where too few frames move.

    Pixels of twice the variance change the fit about as much as those that are there did: that is
    taken back, and half of it is a sigma (Cook and Stefanski 1994). So is half of what near and far
    points differ by beyond chance.
    """
    own = _fitted(recording, wheels, CameraMotion.of(recording, views))
    if own is None:
        return None
    tracks, camera = recording.tracks, recording.header.camera
    more = np.random.default_rng(1).normal(0, views.sigma_px, tracks.pixels.shape)
    parts = (replace(tracks, pixels=tracks.pixels + more), *by_depth(tracks))
    others = [
        _fitted(recording, wheels, CameraMotion.of(recording, two_views(part, camera, views.lag)))
        for part in parts
    ]
    x, sigma = own
    noisy, near, far = others
    by_noise = x - noisy[0] if noisy is not None else np.zeros_like(x)
    by_depth_m = np.zeros_like(x)
    if near is not None and far is not None:
        chance = CHANCE**2 * (near[1] ** 2 + far[1] ** 2)
        by_depth_m = np.sqrt(np.maximum((near[0] - far[0]) ** 2 - chance, 0))
    return x + by_noise, np.sqrt(sigma**2 + by_noise**2 / 4 + by_depth_m**2 / 4)


def _fitted(
    recording: Recording, wheels: list[list[Reading]], seen: CameraMotion
) -> tuple[Floats, Floats] | None:
    frames = recording.frame_t_ns
    frame_s = (frames - recording.inertial.t_ns[0]) * 1e-9
    w = mean_rates(recording.inertial, frame_s)
    w = w - np.nanmedian((w - seen.rates[:, 3:])[seen.usable], axis=0)
    v_x = seen.rates[:, 0] - np.cross(w, -recording.T_CB.R.T @ recording.T_CB.p)[:, 0]
    y, X, k, trust = [], [], [], 1 / seen.variance[:, 0]
    for own in wheels:
        _, left, up = own[0].at_B_m
        read, turns = _between(own, frames), left * w[:, 2]
        apart = len(wheels) > 1
        y.append(v_x + up * w[:, 1] - (0 if apart else turns))
        X.append(np.stack((read, turns) if apart else (read,), 1))
        moves = seen.usable & np.isfinite(y[-1]) & (np.abs(read) > MOVING_MPS)
        k.append(np.flatnonzero(moves))
    if min(map(len, k)) < FRAMES_LEAST:
        return None
    at = np.concatenate(k)
    rows = [np.concatenate([x[own] for x, own in zip(some, k, strict=True)]) for some in (X, y)]
    return _robust(rows[0], rows[1], trust[at], at * BLOCKS // (at.max() + 1))


def _robust(X: Floats, y: Floats, trust: Floats, block: Times) -> tuple[Floats, Floats]:
    """Returns the solution with Tukey's weights, and its standard errors by leaving out blocks."""
    weight = trust
    for _ in range(ROUNDS):
        x = _solved(X, y, weight)
        left = np.abs(y - X @ x) * np.sqrt(trust)
        usual = 1.48 * float(np.median(left)) + 1e-12
        weight = trust * np.maximum(1 - (left / (CUT * usual)) ** 2, 0) ** 2
    without = [_solved(*(part[block != b] for part in (X, y, weight))) for b in np.unique(block)]
    spread = (len(without) - 1) * np.var(without, axis=0)
    return _solved(X, y, weight), np.asarray(np.sqrt(spread))


def _solved(X: Floats, y: Floats, weight: Floats) -> Floats:
    root = np.sqrt(weight)
    return np.asarray(np.linalg.lstsq(X * root[:, None], y * root, rcond=None)[0])


def _between(wheel: Sequence[Reading], frames: Times) -> Floats:
    """Returns the wheel's mean speed from each frame to the next; NaN where it pauses."""
    t_ns = np.array([m.t_ns for m in wheel], np.int64)
    speed = np.array([m.value[0] for m in wheel], np.float64)
    seconds, frame_s = (t_ns - t_ns[0]) * 1e-9, (frames - t_ns[0]) * 1e-9
    way = np.concatenate(([0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(seconds))))
    mean = np.diff(np.interp(frame_s, seconds, way)) / np.diff(frame_s)
    out = (frame_s[:-1] < 0) | (frame_s[1:] > seconds[-1])
    return np.where(out | pauses(seconds, frame_s[:-1], frame_s[1:]), np.nan, mean)
