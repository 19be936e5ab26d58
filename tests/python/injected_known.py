# SPDX-License-Identifier: MIT
"""Can a drive tell a fault at all? A scale of 5 % is not seen where it is known to 2 % only, and
whoever measures how many faults are named must say which of them could be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pelorus.faults.agreement import Agreement, agreement
from pelorus.faults.amounts import (
    CLOCK_OFF_S,
    CLOCK_SIGMAS,
    LEVER_APART,
    SCALE_OFF,
    SCALE_SIGMAS,
    place_covariance,
)
from pelorus.faults.geometry import PITCH_OFF_DEG, PITCH_SIGMAS
from pelorus.faults.mounting import SURE, MotionPairs
from pelorus.faults.moving import moving
from pelorus.faults.seen import CameraMotion
from pelorus.faults.twist_body import TwistBody
from pelorus.faults.two_views import two_views
from pelorus.io.recording import Recording


@dataclass(frozen=True)
class Known:
    """What a clean piece says of itself: how much of each quantity would be beyond doubt."""

    recording: Recording
    agreed: Agreement

    @classmethod
    def of(cls, recording: Recording) -> Known:
        """By the rules that the faults are named by."""
        views = two_views(recording.tracks, recording.header.camera, 1)
        return cls(recording, agreement(recording, views))

    def too_little(self, name: str, k: int, wrong: Recording) -> str:
        """Why this fault is none that the drive could tell; empty if it could. What the clean
        drive itself is off by counts, too: it may make up for the fault.
        """
        if not self.agreed.is_known:
            return "too few frames"
        of_others = {"moving": _moves, "mirrored": _turns, "axes": _turns, "lever": self._lever}
        if name in of_others:
            return of_others[name](wrong)
        least = {
            "scale": self._scale,
            "baseline": self._scale,
            "focal": self._focal,
            "clock": self._clock,
            "small-pitch": self._pitch,
        }.get(name)
        if least is None:
            return ""
        size = SIZES[name][k]
        sure, own = least()
        if size > sure + abs(own):
            return ""
        return f"{size:.3g} put in, {sure:.3g} can be told, the clean drive is off by {own:.2g}"

    def _scale(self) -> tuple[float, float]:
        own = self.agreed
        sure = max(SCALE_SIGMAS * own.scale_sigma, SCALE_OFF)
        return sure, own.scale - 1

    def _focal(self) -> tuple[float, float]:
        return max(SCALE_SIGMAS * self.agreed.focal_sigma, SCALE_OFF), self.agreed.focal - 1

    def _clock(self) -> tuple[float, float]:
        own = self.agreed
        offset, sigma = own.offset_s, own.offset_sigma_s
        if own.clocks.apart:
            offset, sigma = own.clocks.ways_s, own.clocks.ways_sigma_s
        return max(CLOCK_SIGMAS * sigma, CLOCK_OFF_S), offset

    def _pitch(self) -> tuple[float, float]:
        own, across = self.agreed, self.recording.T_CB.R[0]
        if own.tilt_rad is None or own.tilt_covariance is None:
            return np.inf, 0.0
        sigma = float(np.degrees(np.sqrt(across @ own.tilt_covariance @ across)))
        return max(PITCH_SIGMAS * sigma, PITCH_OFF_DEG), float(np.degrees(across @ own.tilt_rad))

    def _lever(self, wrong: Recording) -> str:
        given, other = (-r.T_CB.R.T @ r.T_CB.p for r in (self.recording, wrong))
        known = np.linalg.inv(place_covariance(wrong, self.agreed))
        left = given + self.agreed.lever_m - other
        apart, as_wrong = (float(x @ known @ x) for x in (given - other, left))
        own = float(self.agreed.lever_m @ known @ self.agreed.lever_m)
        if apart > LEVER_APART**2 and as_wrong - own > LEVER_APART**2:
            return ""
        return (
            f"the two places are {np.sqrt(apart):.1f} standard errors apart, where the clean drive "
            f"puts the camera {np.sqrt(own):.1f} from the one"
        )


SIZES = {
    "scale": (0.05, 0.06, 0.10),
    "baseline": (0.02, 0.05, 0.12),
    "focal": (0.02, 0.05, 0.10),
    "clock": (0.02, 0.05, 0.09),
    "small-pitch": (6.0, 7.0, 8.0),
}


def _turns(wrong: Recording) -> str:
    seen = CameraMotion.of(wrong, two_views(wrong.tracks, wrong.header.camera, 1))
    told = TwistBody(wrong).rates(wrong.frame_t_ns, 1, 0.0)[:, 3:]
    found = MotionPairs(np.where(seen.usable[:, None], seen.rates[:, 3:], np.nan), told).alone()
    if SURE * found.sigma < 1:  # T is 0 or -1
        return ""
    return f"the turns have other axes by {-found.effect:.2f} +- {found.sigma:.2f} of all"


def _moves(wrong: Recording) -> str:
    camera = wrong.header.camera
    found = moving(wrong.tracks, camera, two_views(wrong.tracks, camera, 1))
    if found.more_than_usual:
        return ""
    return (
        f"{found.share:.0%} of {found.tracks} tracks are seen to move; as much as "
        f"{found.least:.0%} is usual"
    )
