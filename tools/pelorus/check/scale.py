# SPDX-License-Identifier: MIT
"""Tells whether the twists' velocities have another scale than the images.

A wrong baseline, focal length or wheel radius makes a constant error of percents, neither noise nor
a clock. At constant speed a bias and a scale look the same, and the scale stays unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pelorus.check.lasting import ADDS, added_nees, stands
from pelorus.faults.agreement import Agreement
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Message
from pelorus.wire.layout import Floats
from pelorus.wire.settings import in_force

SURE = 4.0  # sigmas from which a scale is off
BY_BIAS = 1.5  # ratio of sigmas with and without biases, above which the biases hide the scale
BASELINE_MOST = 0.1  # largest baseline-sigma that the setting takes


def off_by(agreed: Agreement | None) -> float:
    """Returns how much longer the images' way is than the twists', as a share; 0 if it may be 0."""
    if agreed is None or not agreed.is_known:
        return 0.0
    off = agreed.scale - 1
    return off if abs(off) > SURE * agreed.scale_sigma else 0.0


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
