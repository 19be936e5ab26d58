# SPDX-License-Identifier: MIT
"""Tells whether the twists' velocities have another scale than the images.

A wrong baseline, focal length or wheel radius makes a constant error of percents, neither noise nor
a clock. The velocities are multiplied by factors about 1; a parabola through the likelihoods gives
the best one and how well the parts of the drive agree on it. Biases stay free: at constant speed a
bias and a scale look the same, and the scale stays unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pelorus.check import clock
from pelorus.check.lasting import ADDS, added_nees, stands
from pelorus.check.options import Settings
from pelorus.check.outcome import SCALE, Bench
from pelorus.check.parameters import PAYS
from pelorus.faults.agreement import Agreement
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Message
from pelorus.wire.layout import Floats
from pelorus.wire.settings import in_force

STEP, STEPS = 0.01, 4
SURE = 4.0  # sigmas from which a scale is off
BY_BIAS = 1.5  # ratio of sigmas with and without biases, above which the biases hide the scale
BASELINE_MOST = 0.1  # largest baseline-sigma that the setting takes
BESIDE = 2  # steps to either side of the best one, through which a parabola is laid


def off_by(bench: Bench, settings: Settings) -> float:
    """Returns the best factor minus 1; 0 where the factor may be 1."""
    for reach in (BESIDE, STEPS):  # the outer steps only where the best one is not in the middle
        factors = 1 + STEP * np.arange(-reach, reach + 1)
        ran = bench.run_all([{**settings, SCALE: f"{at:.3f}"} for at in factors], "scale")
        most = max(outcome.matched for outcome in ran)
        costs = np.stack([clock.of_parts(outcome, most) for outcome in ran])
        best = factors[np.argmin(costs.sum(axis=1))]
        near = np.abs(factors - best) < (BESIDE + 0.5) * STEP
        if near.all():
            break
    foot = clock.foot(factors[near] - 1, costs[near])
    return foot.best_s if foot.gain > PAYS else 0.0


def words(off: float) -> str:
    """Returns the sentence for a scale that is off."""
    return (
        f"the images show about {1 + off:.2f} times the way of the twists: baseline, focal length "
        "or wheels' radius"
    )


@dataclass(frozen=True)
class Doubt:
    """The scale of the images against the twists.

    The images show `scale` +- `sigma` times the twists' way beside velocity biases of `bias_mps`;
    without biases the sigma is `unbiased`. `adds` is what a scale error of `share` adds to the
    run's mean NEES per degree of freedom.
    """

    scale: float
    sigma: float
    bias_mps: float
    unbiased: float
    adds: float
    given: float = 0.0  # baseline-sigma of the run

    @property
    def share(self) -> float:
        """Returns the position error as a share of the way."""
        return float(np.hypot(self.scale - 1, self.sigma))

    @property
    def is_untold(self) -> bool:
        """Returns whether the drive cannot measure the scale, so that no figure is meaningful."""
        return self.sigma > BASELINE_MOST

    @property
    def beyond(self) -> float:
        """Returns the share if it exceeds what the filter says of its positions, else 0.

        What the filter would say without its baseline-sigma counts, too.
        """
        matters = self.adds > ADDS or stands(self.given, self.share, "baseline-sigma")
        return self.share if matters and not self.is_untold else 0.0

    @property
    def setting(self) -> dict[str, str]:
        """Returns the setting with which the covariances cover the scale, if they do not."""
        if self.beyond <= self.given or stands(self.given, self.share, "baseline-sigma"):
            return {}
        return {"baseline-sigma": f"{min(self.share, BASELINE_MOST):.2g}"}

    @property
    def is_off(self) -> bool:
        return abs(self.scale - 1) > SURE * self.sigma

    @property
    def by_bias(self) -> bool:
        """Returns whether the velocity bias hides the scale."""
        return self.sigma > BY_BIAS * self.unbiased


def bias_of(messages: Sequence[Message]) -> float:
    """Returns the sigma of the velocities' bias in a run, m/s; 0 where there is none."""
    return (in_force(messages, "bias-velocity-sigma") or 0.0) if in_force(messages, "bias") else 0.0


def doubted(found: Agreement, messages: Sequence[Message]) -> Doubt:
    """Returns what a run leaves in doubt of the scale."""
    doubt = Doubt(found.scale, found.scale_sigma, bias_of(messages), found.through_zero_sigma, 0.0)
    given = in_force(messages, "baseline-sigma") or 0.0
    return replace(
        doubt, adds=added_nees(messages, lambda poses: _stretched(doubt, poses)), given=given
    )


def _stretched(doubt: Doubt, poses: Poses) -> Floats:
    way_B = np.einsum("nji,nj->ni", poses.R, poses.p - poses.p[0])
    return np.hstack((doubt.share * way_B, np.zeros_like(way_B)))
