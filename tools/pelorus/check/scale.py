# SPDX-License-Identifier: MIT
"""Are the twists' velocities of another scale than the images? What is off by a percent all along
is neither noise nor a clock.

A wrong baseline, focal length or wheel's radius. The velocities are multiplied by some factors
about 1, and the parabola of the likelihoods says which one fits, and how well the parts of the
drive agree on it. Biases are free meanwhile: at constant speed they say the same as a scale, which
then stays untold.
"""

from __future__ import annotations

import numpy as np

from pelorus.check import clock
from pelorus.check.options import Settings
from pelorus.check.outcome import SCALE, Bench
from pelorus.check.parameters import PAYS

STEP, STEPS = 0.01, 4
NEAR = 2.5  # steps


def off_by(bench: Bench, settings: Settings) -> float:
    """What the factor that fits best has above 1; 0 where it may be 1."""
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
        "or wheels' radius"
    )
