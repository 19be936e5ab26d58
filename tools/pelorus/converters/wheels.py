# SPDX-License-Identifier: MIT
"""Makes readings of the small sensor `wheel` from wheels beside an IMU, and of `standstill`.

A velocity v_W in the wheels' frame W is R_BW v_W in the body's. Along an axis of W that nobody
measures it is 0, with the sigma by which wheels slide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from pelorus.io.small_sensors import STANDSTILL, WHEEL
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Reading
from pelorus.wire.layout import Floats

# Encoders that count nothing for so long have moved less than a count, some mm, which gives the
# sigma of a standstill. So much is left out at either end, where the body still settles.
REST_S = 0.5
REST_EVERY_S = 0.1
REST_SIGMA = (0.002, 0.005, 0.0)  # m/s, rad/s


@dataclass(frozen=True)
class Rolling:
    """Velocities (n, 3) of a point in the wheels' frame, with sigmas; `letters`: measured axes."""

    t_ns: Times
    v_W_mps: Floats
    sigma_mps: Floats
    letters: str


def readings(
    rolling: Rolling, T_BW: Poses, at_W_m: Floats, slide_mps: float, held: bool = False
) -> list[Reading]:
    """Returns a reading for each time, along the body's axes that are more measured than not.

    The point sits at `at_W_m` (3,) in W; `slide_mps` is the sigma along an axis of W that nobody
    measures. With `held` that counts as a measurement: the readings are of all axes.
    """
    measured = np.array([letter in rolling.letters for letter in WHEEL.letters])
    square = T_BW.R**2
    told = np.ones(3, bool) if held else square @ measured > 0.5
    variance_W = np.where(measured, rolling.sigma_mps**2, slide_mps**2)
    v_B = np.where(measured, rolling.v_W_mps, 0.0) @ T_BW.R.T
    v_B, sigma_B = np.where(told, v_B, 0.0), np.where(told, np.sqrt(variance_W @ square.T), 0.0)
    axes = WHEEL.axes("".join(np.array(list(WHEEL.letters))[told]))
    at_B_m = T_BW.p + T_BW.R @ at_W_m
    rows = zip(rolling.t_ns.tolist(), v_B, sigma_B, strict=True)
    return [Reading(t, WHEEL.number, axes, v, sigma, at_B_m) for t, v, sigma in rows]


def standing(small: Sequence[Reading], remarks: list[str]) -> list[Reading]:
    """Returns readings of a standstill, one each REST_EVERY_S, where all wheels read exactly 0.

    REST_S at both ends is left out.
    """
    rolled = sorted((m for m in small if m.sensor == WHEEL.number), key=lambda m: m.t_ns)
    times: list[int] = []
    for stands, stretch in groupby(rolled, key=lambda m: not np.any(m.value)):
        if stands:
            times += _within([m.t_ns for m in stretch])
    if times:
        remarks.append(
            f"the wheels stand: {len(times)} readings of a standstill, one each {REST_EVERY_S} s"
        )
    axes, sigma = STANDSTILL.axes(STANDSTILL.letters), np.array(REST_SIGMA)
    return [Reading(t, STANDSTILL.number, axes, sigma=sigma) for t in times]


def _within(t_ns: Sequence[int]) -> list[int]:
    margin, every = round(REST_S * 1e9), round(REST_EVERY_S * 1e9)
    found: list[int] = []
    for t in t_ns:
        settled = t_ns[0] + margin <= t <= t_ns[-1] - margin
        if settled and (not found or t >= found[-1] + every):
            found.append(t)
    return found
