# SPDX-License-Identifier: MIT
"""What goes wrong on a drive: with the wheels, the camera, the scene, the calibration.

Each mishap leaves the rest of the drive as it was, to the bit: chance has a stream of its own. As
in all of the simulation, only sums, products, quotients and square roots are used.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.frames import Camera
from pelorus.motion import Times
from pelorus.se3 import Floats, Poses
from pelorus.simulation.drive import rotate
from pelorus.tracks import Tracks

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Span:
    """A part of the drive: from a time on, for so long; 0: to the end."""

    from_s: float = 0.0
    for_s: float = 0.0

    def holds(self, t_ns: Times) -> Flags:
        t_s = np.asarray(t_ns, np.float64) * 1e-9
        end_s = self.from_s + self.for_s if self.for_s else np.inf
        return np.asarray((t_s >= self.from_s) & (t_s < end_s))


@dataclass(frozen=True)
class Mishaps:
    """The names are those of the command's options; without them nothing goes wrong."""

    slip: float = 1.0  # factor on what the wheels and the gyro say
    slip_span: Span = Span()
    dead_encoder: Span | None = None  # the linear velocity reads zero
    twist_delay_s: float = 0.0
    frozen: Span | None = None  # the camera repeats its last frame
    track_drift: float = 0.0  # px / sqrt(s)
    moving: float = 0.0  # share of the landmarks
    moving_speed_mps: float = 0.0
    convoy: float = 0.0  # share of the body's own motion that they make
    moving_span: Span = Span()
    jump_m: float = 0.0
    jump_at_s: float = 0.0
    baseline_error_percent: float = 0.0
    focal_error_percent: float = 0.0

    def check(self) -> None:
        """Refuse what makes no sense, by the option's name."""
        _require("slip", self.slip, 0 <= self.slip < np.inf, "a factor, not negative")
        _require("moving", self.moving, 0 <= self.moving <= 1, "a fraction from 0 to 1")
        for name, value in (
            ("track-drift", self.track_drift),
            ("twist-delay", self.twist_delay_s),
            ("jump-at", self.jump_at_s),
        ):
            _require(name, value, 0 <= value < np.inf, "a finite number, not negative")
        for name, value in (
            ("moving-speed", self.moving_speed_mps),
            ("convoy", self.convoy),
            ("jump", self.jump_m),
        ):
            _require(name, value, bool(np.isfinite(value)), "a finite number")
        for name, value in (
            ("baseline-error", self.baseline_error_percent),
            ("focal-error", self.focal_error_percent),
        ):
            _require(name, value, -50 <= value <= 50, "a number of percent from -50 to 50")
        for name, span in (
            ("slip", self.slip_span),
            ("dead-encoder", self.dead_encoder or Span()),
            ("frozen", self.frozen or Span()),
            ("moving", self.moving_span),
        ):
            for word, value in (("from", span.from_s), ("for", span.for_s)):
                due = "a number of seconds, not negative"
                _require(f"{name}-{word}", value, 0 <= value < np.inf, due)
        going = bool(self.moving_speed_mps or self.convoy)
        due = "--moving-speed or --convoy, which say how they move"
        _require("moving", self.moving, going or not self.moving, due)
        _require("moving", self.moving, bool(self.moving) or not going, "the share that moves")

    def true_camera(self, told: Camera) -> Camera:
        """The camera that makes the images, where the HEADER tells of another."""
        focal = 1 + self.focal_error_percent / 100
        return replace(
            told,
            fx_px=focal * told.fx_px,
            fy_px=focal * told.fy_px,
            baseline_m=(1 + self.baseline_error_percent / 100) * told.baseline_m,
        )

    def readings(self, t_ns: Times, v: Floats, w: Floats) -> tuple[Floats, Floats]:
        """What the recording has of the twists."""
        factor = np.where(self.slip_span.holds(t_ns), self.slip, 1.0)[:, None]
        v, w = v * factor, w * factor
        if self.dead_encoder is not None:
            v = np.where(self.dead_encoder.holds(t_ns)[:, None], 0.0, v)
        return v, w

    def jumped(self, t_ns: Times, poses: Poses) -> Poses:
        """From `jump_at_s` on the body stands aside, to its left of that time."""
        after = np.nonzero(t_ns * 1e-9 >= self.jump_at_s)[0]
        if not self.jump_m or not len(after):
            return poses
        aside = rotate(poses.R[after[0]], np.array([0.0, self.jump_m, 0.0]))
        p = poses.p.copy()
        p[after] += aside
        return Poses(poses.R, p)

    def ways(self, t_ns: Times, poses: Poses, chance: np.random.Generator) -> Floats:
        """(frames, 3): how far each moving landmark has come, in the world."""
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
        """While the camera is frozen every frame is the last one before; and which row is whose."""
        bounds = tracks.bounds()
        rows = [np.arange(bounds[k], bounds[k + 1]) for k in range(tracks.frame_count)]
        if self.frozen is not None:
            stuck = np.nonzero(self.frozen.holds(frame_t_ns))[0]
            for k in stuck:
                rows[k] = rows[max(int(stuck[0]) - 1, 0)]
        whose = np.concatenate(rows).astype(np.intp)
        frame = np.repeat(np.arange(tracks.frame_count), [len(row) for row in rows])
        frozen = Tracks(tracks.frame_count, frame, tracks.id[whose], tracks.pixels[whose])
        return frozen, whose


NO_MISHAPS = Mishaps()


def _require(option: str, given: float, good: bool, due: str) -> None:
    if not good:
        raise PelorusError(f"--{option} is {given}: {due} is due")


class Drift:
    """How far each track has wandered: a random walk, in both images alike."""

    def __init__(self, count: int, sigma: float, chance: np.random.Generator) -> None:
        self._sigma = sigma
        self._chance = chance
        self._offset: Floats = np.zeros((count, 2))
        self._id = np.full(count, -1, np.int64)

    def wander(self, landmarks: NDArray[np.intp], ids: NDArray[np.int64], tau_s: float) -> Floats:
        """(n, 4) px to be added to uL vL uR vR of this frame's landmarks."""
        if not self._sigma:
            return np.zeros((len(landmarks), 4))
        steps = self._sigma * np.sqrt(tau_s) * self._chance.standard_normal(self._offset.shape)
        self._offset = self._offset + steps
        fresh = landmarks[self._id[landmarks] != ids]
        self._offset[fresh] = 0.0
        self._id[:] = -1
        self._id[landmarks] = ids
        return self._offset[landmarks][:, [0, 1, 0, 1]]
