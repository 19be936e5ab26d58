# SPDX-License-Identifier: MIT
"""Are the twists' velocities of another scale than the images? What is off by a percent all along
is neither noise nor a clock.

A wrong baseline, focal length or wheel's radius. The velocities are multiplied by some factors
about 1, and the parabola of the likelihoods says which one fits, and how well the parts of the
drive agree on it. At constant speed a bias along the way says the same: where a scale explains what
is seen as well as the biases do, it may be either, and who believed the bias would be too sure.
"""

from __future__ import annotations

import numpy as np

from pelorus.check import clock
from pelorus.check.options import Settings
from pelorus.check.outcome import SCALE, Bench
from pelorus.check.parameters import PAYS

STEP, STEPS = 0.01, 4
NEAR = 2.5  # steps


def off_by(bench: Bench, free: Settings, told: Settings) -> float:
    """What the factor that fits best has above 1; 0 where it may be 1. With biases that are free
    and with those that were told.
    """
    beside = _off_by(bench, free)
    if beside:
        return beside
    none = {**told, "bias-velocity-sigma": "0"}
    alone = _off_by(bench, none)
    if alone:
        ran = bench.run_all([{**none, SCALE: f"{1 + alone:.4f}"}, told], "scale")
        if ran[0].gain_over(ran[1]) > -PAYS:
            return alone
    return 0.0


def _off_by(bench: Bench, settings: Settings) -> float:
    factors = 1 + STEP * np.arange(-STEPS, STEPS + 1)
    ran = bench.run_all([{**settings, SCALE: f"{at:.3f}"} for at in factors], "scale")
    most = max(outcome.matched for outcome in ran)
    costs = np.stack([clock.of_parts(outcome, most) for outcome in ran])
    best = factors[np.argmin(costs.sum(axis=1))]
    near = np.abs(factors - best) < NEAR * STEP
    foot = clock.foot(factors[near] - 1, costs[near])
    return foot.best_s if foot.gain > PAYS else 0.0


def words(off: float) -> str:
    """Of one that is off."""
    return (
        f"the images show about {1 + off:.2f} times the way of the twists: baseline, focal length "
        "or wheels' radius (at constant speed it may be a bias)"
    )
