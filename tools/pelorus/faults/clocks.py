# SPDX-License-Identifier: MIT
"""When the frames were taken by the body's clock, and whether velocities and rates of turn have one
clock: a gyro's filter, or its driver, may hold them back while the wheels' velocities are on time.

Offsets are compared by how far the motions go together, and not by how little is left between them:
between two readings a mean of both is taken, whose noise is smaller, and less would be left there
whatever the clock.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pelorus.faults.fit import CLOCK, TURN_CLOCK, Body, Fit
from pelorus.faults.seen import Seen
from pelorus.faults.twist_body import TwistBody
from pelorus.layout import Floats
from pelorus.recording import Recording

FRAMES_MIN = 50
OFFSETS_S = np.arange(-20, 21) * 0.02  # where the clock's offset is looked for at first
ROUNDS, STEP_S, FOUND_S = 10, 0.05, 2e-4
APART_SIGMAS, APART_S = 6.0, 0.03
# Below, a clock of the turns' own is not followed: it may be chance, and where velocities hardly
# vary each step finds a little of the same chance again.
WORTH_SIGMAS = 4.0


@dataclass(frozen=True)
class TwoClocks:
    """Seconds by which the frames are behind the velocities, and these behind the turns' rates."""

    ways_s: float = 0.0
    ways_sigma_s: float = float("inf")
    turns_late_s: float = 0.0
    turns_late_sigma_s: float = float("inf")

    @property
    def apart(self) -> bool:
        """Whether there are two of them, beyond doubt."""
        return abs(self.turns_late_s) > max(APART_SIGMAS * self.turns_late_sigma_s, APART_S)


UNTOLD = TwoClocks()


def offset_of(recording: Recording, body: Body, seen: Seen, bias: float) -> float:
    """Of the one clock, from where it should be and from where the turns go together most."""
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


def two_clocks(recording: Recording, seen: Seen, offset_s: float, bias: float) -> TwoClocks:
    """Of velocities and of rates of turn, each by itself, from that of both."""
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


def _together(recording: Recording, body: Body, seen: Seen) -> Callable[[float], float]:
    """How far the turns of both go together, by the offset."""
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
