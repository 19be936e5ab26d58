# SPDX-License-Identifier: MIT
"""Simulates mishaps of a drive: of wheels, camera, scene and calibration.

Each mishap leaves the rest of the drive as it was, to the bit, for each has a random generator of
its own. As in all of the simulation, only sums, products, quotients and square roots are used.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pelorus.io.tracks import Tracks
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.simulate import settings
from pelorus.simulate.drive import exp, rotate
from pelorus.simulate.settings import (
    DEGREES,
    FINITE,
    NOT_NEGATIVE,
    PERCENT,
    SHARE,
    Rule,
    Span,
    require,
    setting,
)
from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Mishaps:
    """The mishaps of a drive; by default there are none."""

    twist_delay_s: float = setting(
        0.0, "Twists stand so much later in the file than their time: behind newer frames.", "S"
    )
    slip: float = setting(
        1.0,
        "All readings are multiplied by it.",
        "FACTOR",
        Rule(NOT_NEGATIVE.holds, "a factor, not negative"),
    )
    slip_span: Span = setting(Span(), "It begins then.")
    dead_encoder: Span | None = setting(None, "From then on the linear velocity reads zero.")
    frozen: Span | None = setting(None, "From then on the camera repeats its last frame.")
    track_drift: float = setting(
        0.0,
        "Tracks wander off their landmark: sigma after a second, growing as the root of time.",
        "PX",
    )
    moving: float = setting(0.0, "Share of the landmarks that move.", "SHARE", SHARE)
    moving_speed_mps: float = setting(0.0, "All of them, one way, level.", "M/S", FINITE)
    convoy: float = setting(
        0.0, "They move along with the robot, at this share of its speed.", "SHARE", FINITE
    )
    moving_span: Span = setting(Span(), "It begins then.")
    jump_m: float = setting(
        0.0, "The robot is set aside to its left, and no twist tells of it.", "M", FINITE
    )
    jump_at_s: float = setting(0.0, "When it is.", "S")
    baseline_error_percent: float = setting(
        0.0, "The true baseline is so much larger than the header's.", "PERCENT", PERCENT
    )
    focal_error_percent: float = setting(
        0.0, "The true focal length is so much larger than the header's.", "PERCENT", PERCENT
    )
    camera_turned_deg: float = setting(
        0.0,
        "The true camera is turned so far beside the header's T_CB, about all axes alike.",
        "DEG",
        DEGREES,
    )

    def check(self) -> None:
        """Refuses contradictory options, by the option's name."""
        settings.check(self)
        going = bool(self.moving_speed_mps or self.convoy)
        expected = "--moving-speed or --convoy, which say how they move"
        require("moving", self.moving, going or not self.moving, expected)
        require("moving", self.moving, bool(self.moving) or not going, "the share that moves")

    def check_beside(self, an_imu: bool) -> None:
        """Refuses mishaps of wheels where there are none."""
        for name in ("slip", "dead_encoder", "twist_delay_s"):
            given = getattr(self, name)
            usual = given == getattr(NO_MISHAPS, name)
            require(name, given, usual or not an_imu, "twists, so no --imu-rate beside it,")

    def true_camera(self, given: Camera) -> Camera:
        """Returns the camera that makes the images, given the HEADER's."""
        focal = 1 + self.focal_error_percent / 100
        return replace(
            given,
            fx_px=focal * given.fx_px,
            fy_px=focal * given.fy_px,
            baseline_m=(1 + self.baseline_error_percent / 100) * given.baseline_m,
        )

    def true_extrinsic(self, given: Poses) -> Poses:
        """Returns T_CB of the camera that makes the images: turned about its own centre."""
        if not self.camera_turned_deg:
            return given
        about_each = np.radians(self.camera_turned_deg) / np.sqrt(3.0)
        turn = exp(np.zeros((1, 3)), np.full((1, 3), about_each)).R[0]
        return Poses(rotate(turn, given.R.T).T, rotate(turn, given.p))

    def readings(self, t_ns: Times, v: Floats, w: Floats) -> tuple[Floats, Floats]:
        """Returns the recorded twists."""
        factor = np.where(self.slip_span.holds(t_ns), self.slip, 1.0)[:, None]
        v, w = v * factor, w * factor
        if self.dead_encoder is not None:
            v = np.where(self.dead_encoder.holds(t_ns)[:, None], 0.0, v)
        return v, w

    def jumped(self, t_ns: Times, poses: Poses) -> Poses:
        """Returns poses that jump to the left at `jump_at_s`."""
        after = np.nonzero(t_ns * 1e-9 >= self.jump_at_s)[0]
        if not self.jump_m or not len(after):
            return poses
        aside = rotate(poses.R[after[0]], np.array([0.0, self.jump_m, 0.0]))
        p = poses.p.copy()
        p[after] += aside
        return Poses(poses.R, p)

    def ways(self, t_ns: Times, poses: Poses, chance: np.random.Generator) -> Floats:
        """Returns (frames, 3) how far each moving landmark has come, in the world."""
        x, y = chance.uniform(-1.0, 1.0, 2)
        heading = np.array([x, y, 0.0]) / np.sqrt(x * x + y * y)
        holds = self.moving_span.holds(t_ns[:-1])[:, None]
        tau = (np.diff(t_ns) * 1e-9)[:, None]
        own = tau * self.moving_speed_mps * heading + self.convoy * np.diff(poses.p, axis=0)
        out = np.zeros((len(t_ns), 3))
        for k, step in enumerate(np.where(holds, own, 0.0)):
            out[k + 1] = out[k] + step
        return out

    def freeze(self, frame_t_ns: Times, tracks: Tracks) -> tuple[Tracks, NDArray[np.intp]]:
        """Returns the tracks with frames that repeat the last one while the camera is frozen.

        Also returns which row each comes from.
        """
        bounds = tracks.bounds()
        rows = [np.arange(bounds[k], bounds[k + 1]) for k in range(tracks.frame_count)]
        if self.frozen is not None:
            stuck = np.nonzero(self.frozen.holds(frame_t_ns))[0]
            for k in stuck:
                rows[k] = rows[max(int(stuck[0]) - 1, 0)]
        whose = np.concatenate(rows).astype(np.intp)
        frame = np.repeat(np.arange(tracks.frame_count), [len(row) for row in rows])
        return replace(tracks.at(whose), frame=frame), whose


NO_MISHAPS = Mishaps()


class TrackDrift:
    """Drift of each track: a random walk, alike in both images."""

    def __init__(self, count: int, sigma: float, chance: np.random.Generator) -> None:
        self._sigma = sigma
        self._chance = chance
        self._offset: Floats = np.zeros((count, 2))
        self._id = np.full(count, -1, np.int64)

    def wander(self, landmarks: NDArray[np.intp], ids: NDArray[np.int64], tau_s: float) -> Floats:
        """Returns (n, 4) px to add to uL vL uR vR of this frame's landmarks."""
        if not self._sigma:
            return np.zeros((len(landmarks), 4))
        steps = self._sigma * np.sqrt(tau_s) * self._chance.standard_normal(self._offset.shape)
        self._offset = self._offset + steps
        fresh = landmarks[self._id[landmarks] != ids]
        self._offset[fresh] = 0.0
        self._id[:] = -1
        self._id[landmarks] = ids
        return self._offset[landmarks][:, [0, 1, 0, 1]]
