# SPDX-License-Identifier: MIT
"""Tells whether the camera's mounting T_CB is right.

An error of a degree is neither noise nor a clock: the estimated path leaves the true one by that
angle throughout.
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

SURE = 4.5  # sigmas; of 140 drives with a right T_CB the largest are 4.4 and 4.1, with 1 degree 8
CAMERA_TURN, TURN_MOST = "camera-turn-sigma", 0.2  # rad, largest that the setting takes


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
        return bool(d2 > SURE**2) and matters

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
