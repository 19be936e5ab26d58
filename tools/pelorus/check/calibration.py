# SPDX-License-Identifier: MIT
"""What images and twists of a run show of the camera: its scale and its mounting T_CB.

A wrong baseline, focal length or wheel radius makes a constant error of percents, a turned camera
one of the way's angle: neither noise nor a clock. At constant speed a bias and a scale look the
same, and the scale stays unknown. Both numbers are the fit's (faults/agreement.py); here stands
whether they matter for a run's covariances, and what covers them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import hypot

import numpy as np

from pelorus.faults.agreement import NO_BIAS_MPS, Agreement
from pelorus.io.trajectory import estimate_in
from pelorus.math.consistency import mean, nees_per_dof
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Message
from pelorus.wire.layout import Floats
from pelorus.wire.schema import DEFAULTS
from pelorus.wire.settings import in_force

SCALE_SURE = 4.0  # sigmas from which a scale is off
BY_BIAS = 1.5  # ratio of sigmas with and without biases, above which the biases hide the scale
BASELINE_MOST = 0.1  # largest baseline-sigma that the setting takes
# Sigmas from which a camera is turned: of 140 drives with a right T_CB the largest are 4.4 and 4.1,
# with 1 degree 8.
TURN_SURE = 4.5
CAMERA_TURN, TURN_MOST = "camera-turn-sigma", 0.2  # rad, largest that the setting takes
ADDS = 0.5  # NEES per degree of freedom: a smaller increase does not matter
ROUNDED = 0.9  # ratio that is rounding, for a setting has two digits


def stands(given: float, amount: float, setting: str) -> bool:
    """Returns whether a setting other than the default already covers this amount."""
    return given > DEFAULTS[setting] and given >= ROUNDED * min(amount, BASELINE_MOST)


def added_nees(messages: Sequence[Message], off_by: Callable[[Poses], Floats]) -> float:
    """Returns the increase of a run's mean NEES per degree of freedom if each pose is off by
    `off_by`.

    `off_by` returns (n, 6), position and attitude in the poses' own axes.
    """
    found = estimate_in(messages)
    if found is None:
        return 0.0
    estimate, P = found
    return mean(nees_per_dof(off_by(estimate.poses), P)) or 0.0


# --- scale ----------------------------------------------------------------------------------------


def scale_off_by(agreed: Agreement | None) -> float:
    """Returns how much longer the images' way is than the twists', as a share; 0 if it may be 0."""
    if agreed is None or not agreed.is_known:
        return 0.0
    off = agreed.scale - 1
    return off if abs(off) > SCALE_SURE * agreed.scale_sigma else 0.0


def scale_words(off: float) -> str:
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
        return abs(self.scale - 1) > SCALE_SURE * self.sigma

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


# --- mounting -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Turned:
    """The camera is turned by `turn_rad` in the body's axes against the given T_CB.

    `covariance` is that of the turn, rad^2. `adds` is what the turn adds to the run's mean NEES per
    degree of freedom.
    """

    turn_rad: Floats
    covariance: Floats
    adds: float = 0.0
    given: float = 0.0  # camera-turn-sigma of the run

    @property
    def angle_deg(self) -> float:
        return float(np.degrees(np.linalg.norm(self.turn_rad)))

    @property
    def sigma_deg(self) -> float:
        """Returns the standard error of the angle, degrees."""
        axis = self.turn_rad / (np.linalg.norm(self.turn_rad) + 1e-12)
        return float(np.degrees(np.sqrt(axis @ self.covariance @ axis)))

    @property
    def is_off(self) -> bool:
        """Returns whether the turn is significant, and larger than the filter's sigma allows."""
        d2 = self.turn_rad @ np.linalg.solve(self.covariance, self.turn_rad)
        each = float(np.linalg.norm(self.turn_rad) / np.sqrt(3.0))
        matters = self.adds > ADDS or stands(self.given, each, CAMERA_TURN)
        return bool(d2 > TURN_SURE**2) and matters

    @property
    def beyond(self) -> float:
        """Returns the position error as a share of the way if the camera is off, else 0."""
        return float(np.linalg.norm(self.turn_rad)) if self.is_off else 0.0

    @property
    def setting(self) -> dict[str, str]:
        """Returns the setting with which the covariances cover the turn, if they do not."""
        each = float(np.linalg.norm(self.turn_rad) / np.sqrt(3.0))
        if not self.is_off or each <= self.given or stands(self.given, each, CAMERA_TURN):
            return {}
        return {CAMERA_TURN: f"{min(each, TURN_MOST):.2g}"}


def turned(found: Agreement, messages: Sequence[Message]) -> Turned | None:
    """Returns the camera's turn in a run by twists; None where it cannot be estimated."""
    if found.tilt_rad is None or found.tilt_covariance is None:
        return None
    tilt = found.tilt_rad
    adds = added_nees(messages, lambda poses: _askew(tilt, poses))
    given = in_force(messages, CAMERA_TURN) or 0.0
    return replace(Turned(tilt, found.tilt_covariance), adds=adds, given=given)


def _askew(tilt: Floats, poses: Poses) -> Floats:
    """Returns the error of a turned camera's pose: T_0 Exp(tilt) T_0^-1 T Exp(-tilt)."""
    at_start = poses.R[0] @ tilt
    off_W = np.cross(at_start, poses.p - poses.p[0])
    way_B, turn_B = np.einsum("nji,nj->ni", poses.R, off_W), at_start @ poses.R - tilt
    return np.hstack((way_B, turn_B))


# --- both -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CalibrationDoubts:
    """Doubts about scale and mounting. None: too few frames, or a fault must be mended first."""

    scale: Doubt | None = None
    turn: Turned | None = None

    @property
    def settings(self) -> dict[str, str]:
        """Returns the settings with which the covariances cover the errors, if they do not."""
        return {
            name: value
            for part in (self.scale, self.turn)
            if part is not None
            for name, value in part.setting.items()
        }

    @property
    def share(self) -> float:
        """Returns the position error as a share of the way, if it is more than the filter says."""
        return hypot(*(part.beyond for part in (self.scale, self.turn) if part is not None))


def calibration(
    agreed: Callable[[float], Agreement | None], messages: Sequence[Message]
) -> CalibrationDoubts:
    """Returns what a run by twists shows of the calibration.

    `agreed` returns how far images and twists agree beside a velocity bias of a given sigma, m/s.
    """
    found = agreed(max(bias_of(messages), NO_BIAS_MPS))
    if found is None or not found.is_known:
        return CalibrationDoubts()
    return CalibrationDoubts(doubted(found, messages), turned(found, messages))
