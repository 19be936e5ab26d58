# SPDX-License-Identifier: MIT
"""Finds when an IMU and the pictures show different motions.

In a lift, a bus or a ship's cabin the pictures show the motion in the cabin, the IMU also that of
the cabin. The change of the pictures' velocity within a second, minus the integrated readings, is
gravity whenever both move alike; and the gyro's rates equal the pictures'.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.force import seconds
from pelorus.faults.imu_body import ImuBody
from pelorus.faults.seen import CameraMotion
from pelorus.io.recording import Recording
from pelorus.wire.layout import Floats

Flags = NDArray[np.bool_]
WINDOW_S, USUAL_S, JOIN_S = 1.0, 20.0, 1.5
SIGMAS, FORCE_MPS2, TURN_RADPS = 8.0, 0.3, 0.05
MOST = 0.5  # share of the drive: a longer disagreement is another fault
# a quarter of vectors of three normal numbers is shorter than 1.10 sigma
QUIET, QUIET_SIGMAS = 0.25, 1.10
SHOWN = 4


def disagreeing(recording: Recording, seen: CameraMotion, body: ImuBody) -> Flags:
    """Returns (k,) whether the two show different motions from frame k to k + 1.

    It is False everywhere if they do so for most of the drive.
    """
    t = body.frame_s(recording.frame_t_ns, 0.0)
    middle = 0.5 * (t[1:] + t[:-1])
    off = body.mean_turns(recording.frame_t_ns, 0.0) - seen.rates[:, 3:]
    good = seen.usable & np.isfinite(off).all(axis=1)
    wrong = np.zeros(len(middle), bool)
    if good.sum() < 3 * WINDOW_S / np.median(seen.tau_s):
        return wrong
    window = max(int(WINDOW_S / np.median(seen.tau_s)), 2)
    turn = _smoothed(np.where(good[:, None], off, np.nan), window // 2)
    wrong |= _outlying(turn, middle, TURN_RADPS)
    gravity = _gravity(recording, seen, body, middle, good, window)
    for k in np.nonzero(_outlying(gravity, middle, FORCE_MPS2))[0].tolist():
        wrong[max(k - window // 2, 0) : k + window // 2 + 1] = True
    return wrong if wrong.mean() < MOST else np.zeros_like(wrong)


def words(t_s: Floats, wrong: Flags) -> str:
    """Returns in words from when to when, for frames at these seconds."""
    parts = spans(t_s, wrong)
    told = [f"from {first:.0f} to {last:.0f} s" for first, last in parts[:SHOWN]]
    more = f" and {len(parts) - SHOWN} times more" if len(parts) > SHOWN else ""
    return " and ".join(told) + more


def spans(t_s: Floats, wrong: Flags) -> list[tuple[float, float]]:
    """Returns begin and end of each stretch; those that follow closely are joined."""
    out: list[tuple[float, float]] = []
    for k in np.nonzero(wrong)[0].tolist():
        first, last = float(t_s[k]), float(t_s[k + 1])
        if out and first - out[-1][1] < JOIN_S:
            out[-1] = (out[-1][0], last)
        else:
            out.append((first, last))
    return out


def _gravity(
    recording: Recording,
    seen: CameraMotion,
    body: ImuBody,
    middle: Floats,
    good: Flags,
    window: int,
) -> Floats:
    """Returns (k, 3) gravity in the axes of the first reading, at the middle of each window."""
    t, R = seconds(body.readings), body.attitudes
    arm = -recording.T_CB.R.T @ recording.T_CB.p
    v_B = seen.rates[:, :3] - np.cross(seen.rates[:, 3:], arm)
    at = np.clip(np.searchsorted(t, middle), 0, len(t) - 1)
    v_W = np.where(good[:, None], np.einsum("kij,kj->ki", R[at], v_B), np.nan)
    v_W = _smoothed(v_W, max(window // 4, 1))
    rate = np.einsum("nij,nj->ni", R, body.readings.a_B_mps2)
    steps = np.diff(t)[:, None]
    summed = np.concatenate((np.zeros((1, 3)), np.cumsum(0.5 * (rate[1:] + rate[:-1]) * steps, 0)))
    J = np.stack([np.interp(middle, t, column) for column in summed.T], axis=-1)
    out = np.full_like(v_W, np.nan)
    half = window // 2
    first, last = slice(0, len(middle) - 2 * half), slice(2 * half, None)
    tau = middle[last] - middle[first]
    told = (v_W[last] - v_W[first] - (J[last] - J[first])) / tau[:, None]
    told[tau > 2 * WINDOW_S] = np.nan
    out[half : len(middle) - half] = told
    return out


def _smoothed(x: Floats, count: int) -> Floats:
    """Returns moving means of `count` values; NaN where most of them are."""
    known = np.isfinite(x).all(axis=1)
    ones = np.ones(2 * (count // 2) + 1)
    total = np.stack([np.convolve(np.where(known, c, 0.0), ones, "same") for c in x.T], axis=-1)
    weight = np.convolve(known.astype(np.float64), ones, "same")
    enough = weight[:, None] > 0.5 * len(ones)
    return np.where(enough, total / np.maximum(weight, 1)[:, None], np.nan)


def _outlying(x: Floats, t: Floats, least: float) -> Flags:
    """Returns where x differs from its usual value nearby, by more than `least` and than chance."""
    usual = np.full_like(x, np.nan)
    for begin in np.arange(t[0], t[-1], USUAL_S / 4):
        near = np.abs(t - begin) < USUAL_S / 2
        here = np.abs(t - begin) <= USUAL_S / 8
        if np.isfinite(x[near]).all(axis=1).any():
            usual[here] = np.nanmedian(x[near], axis=0)
    off = np.linalg.norm(x - usual, axis=1)
    known = np.isfinite(off)
    if not known.any():
        return np.zeros(len(x), bool)
    sigma = float(np.quantile(off[known], QUIET)) / QUIET_SIGMAS
    return np.asarray(known & (off > max(SIGMAS * sigma, least)))
