# SPDX-License-Identifier: MIT
"""Finds the offset of the frames to the body's clock, and whether velocities and rates share one.

A gyro's filter, or its driver, may delay the rates while the wheels' velocities are on time.
Offsets are compared by the correlation of the motions, not by residuals: between two readings both
are averaged, which has less noise, and would give smaller residuals there at any clock.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pelorus.faults.fit import CLOCK, TURN_CLOCK, Body, Fit
from pelorus.faults.seen import CameraMotion
from pelorus.faults.twist_body import TwistBody
from pelorus.io.recording import Recording
from pelorus.wire.layout import Floats

FRAMES_MIN = 50
OFFSETS_S = np.arange(-20, 21) * 0.02  # where the search for the offset starts
ROUNDS, STEP_S, FOUND_S = 10, 0.05, 2e-4
APART_SIGMAS, APART_S = 6.0, 0.03
# Sigmas below which a clock of the rates' own is not followed: it may be chance, and where
# velocities hardly vary each step would add a little of the same chance.
WORTH_SIGMAS = 4.0


@dataclass(frozen=True)
class TwoClocks:
    """Delay of frames behind velocities, and of velocities behind rates of turn, s."""

    ways_s: float = 0.0
    ways_sigma_s: float = float("inf")
    turns_late_s: float = 0.0
    turns_late_sigma_s: float = float("inf")

    @property
    def apart(self) -> bool:
        """Returns whether velocities and rates significantly have two clocks."""
        return abs(self.turns_late_s) > max(APART_SIGMAS * self.turns_late_sigma_s, APART_S)


UNTOLD = TwoClocks()


def offset_of(recording: Recording, body: Body, seen: CameraMotion, bias: float) -> float:
    """Returns the frames' offset, s, fitted from zero and from the greatest correlation."""
    together = _together(recording, body, seen)
    likely = max((float(x) for x in OFFSETS_S), key=lambda x: (together(x), -abs(x)))
    ends = []
    for start in dict.fromkeys((0.0, likely)):
        offset = start
        for _ in range(ROUNDS):
            fit = Fit(body.design(recording, seen, offset, bias))
            step = _step(fit, CLOCK)
            offset += step
            if abs(step) < FOUND_S:
                break
        ends.append((together(offset), offset))
    return max(ends)[1]


def two_clocks(recording: Recording, seen: CameraMotion, offset_s: float, bias: float) -> TwoClocks:
    """Fits the clocks of velocities and of rates separately, from their common one."""
    ways_s, late_s = offset_s, 0.0
    for _ in range(ROUNDS):
        fit = Fit(TwistBody(recording, late_s).design(recording, seen, ways_s, bias))
        found = TwoClocks(
            ways_s + float(fit.x[CLOCK]),
            fit.known(CLOCK),
            late_s + float(fit.x[TURN_CLOCK]),
            fit.known(TURN_CLOCK),
        )
        steps = _step(fit, CLOCK), _step(fit, TURN_CLOCK)
        if late_s == 0 and abs(found.turns_late_s) < WORTH_SIGMAS * found.turns_late_sigma_s:
            break
        ways_s, late_s = ways_s + steps[0], late_s + steps[1]
        if max(map(abs, steps)) < FOUND_S:
            break
    return found


def _step(fit: Fit, which: int) -> float:
    return float(np.clip(fit.x[which], -STEP_S, STEP_S))


def _together(recording: Recording, body: Body, seen: CameraMotion) -> Callable[[float], float]:
    """Returns a function that correlates the turns of camera and body at an offset, s."""
    own = seen.rates[:, 3:]

    def together(offset_s: float) -> float:
        w = body.turns(recording.frame_t_ns, offset_s)
        good = seen.usable & np.isfinite(w).all(axis=1)
        if good.sum() < FRAMES_MIN:
            return -np.inf
        parts: list[Floats] = [x[good] - np.median(x[good], axis=0) for x in (own, w)]
        size = 4 * np.median(np.linalg.norm(parts[0], axis=1)) + 1e-9
        return float(np.mean(np.sum(np.clip(parts[0], -size, size) * parts[1], axis=1)))

    return together
