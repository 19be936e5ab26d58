# SPDX-License-Identifier: MIT
"""A whole recording in memory, as converters and simulation write it."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pelorus.errors import PelorusError
from pelorus.io.tracks import Tracks
from pelorus.math import inertial, motion, se3
from pelorus.math.inertial import NO_READINGS, Inertial
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.wire.frames import (
    IMU_READINGS_MAX,
    Config,
    Header,
    Landmark,
    Message,
    Reading,
    Start,
    Stereo,
    Text,
    Truth,
    TruthKnows,
    Twist,
)
from pelorus.wire.framing import write_file
from pelorus.wire.image import PicturesOf
from pelorus.wire.layout import Floats
from pelorus.wire.settings import IDS


@dataclass(frozen=True)
class Recording:
    """A recording.

    It has twists (m, 3) at `twist_t_ns` or readings of an IMU, frame k of the tracks at
    `frame_t_ns[k]`, and body poses.
    """

    header: Header
    twist_t_ns: Times
    v_B_mps: Floats
    w_B_radps: Floats
    frame_t_ns: Times
    tracks: Tracks
    truth_t_ns: Times = field(default_factory=lambda: np.empty(0, np.int64))
    truth: Poses = field(default_factory=lambda: Poses(np.empty((0, 3, 3)), np.empty((0, 3))))
    truth_velocity: Floats | None = None  # (truth, 3) in body axes
    truth_bias: Floats | None = None  # (truth, 6) of the readings, as in START
    known: list[Landmark] = field(default_factory=list)
    readings: list[Reading] = field(default_factory=list)  # of small sensors, in any order
    remarks: list[Text] = field(default_factory=list)
    camera_delay_ns: int = 0  # frames come so much later in the file, as from a robot
    twist_delay_ns: int = 0  # twists likewise, and readings of an IMU
    inertial: Inertial = NO_READINGS  # in place of twists
    imu_batch: int = IMU_READINGS_MAX  # readings of a message, at most
    start: Start | None = None
    settings: dict[str, float] = field(default_factory=dict)  # wanted; options win over them
    pictures: PicturesOf | None = None  # in place of tracks

    def with_header(self, **changes: Any) -> Recording:
        return replace(self, header=replace(self.header, **changes))

    def with_truth(self, t_ns: Times, poses: Poses) -> Recording:
        return replace(self, truth_t_ns=t_ns, truth=poses, truth_velocity=None, truth_bias=None)

    def with_extrinsic(self, T_CB: Poses) -> Recording:
        return self.with_header(R_CB=T_CB.R, t_CB_m=T_CB.p)

    @property
    def T_CB(self) -> Poses:
        return Poses(np.asarray(self.header.R_CB), np.asarray(self.header.t_CB_m))

    @property
    def motion_words(self) -> str:
        """Returns the number of twists or readings, in words."""
        readings = len(self.inertial.t_ns)
        return f"{readings} IMU readings" if readings else f"{len(self.twist_t_ns)} twists"

    def dead_reckoning(self) -> Poses:
        """Returns the body's poses at the frames by twists; the first twist is the origin."""
        timing = self.header.twist_timing
        return motion.path_at(
            self.frame_t_ns, self.twist_t_ns, self.v_B_mps, self.w_B_radps, timing
        )

    def body_motion(self, lag: int) -> Poses:
        """Returns (T - lag) maps of coordinates in body k to body k + lag, by the twists alone."""
        path = self.dead_reckoning()
        later, earlier = path.at(slice(lag, None)), path.at(slice(None, max(len(path.p) - lag, 0)))
        return se3.compose(se3.inverse(later), earlier)

    def camera_motion(self, lag: int) -> Poses:
        """Returns the same between cameras: T_CB D T_CB^-1."""
        motion_B = self.body_motion(lag)
        return se3.compose(se3.compose(self.T_CB, motion_B), se3.inverse(self.T_CB))

    def messages(self) -> Iterator[Message]:
        """Yields the messages in the order of docs/REPLAY-FORMAT.md."""
        yield self.header
        if self.pictures is not None and self.pictures.rig is not None:
            yield self.pictures.rig
        if self.settings:
            yield Config({IDS[name]: value for name, value in self.settings.items()})
        yield from self.remarks
        yield from self.known
        if self.start is not None:
            yield self.start
        moving = (self._twists(), self._imu(), self._small())
        seen = (self._truths(), self._stereos(), self._images())
        for _, _, message in heapq.merge(*moving, *seen, key=lambda entry: entry[:2]):
            yield message

    def __len__(self) -> int:
        data = len(self.twist_t_ns) + len(self.truth_t_ns) + len(self.frame_t_ns)
        data += len(self.inertial.t_ns) // self.imu_batch
        data += 0 if self.pictures is None else len(self.pictures)
        return (
            1
            + bool(self.settings)
            + len(self.remarks)
            + len(self.known)
            + len(self.readings)
            + data
        )

    def _twists(self) -> Iterator[tuple[int, int, Message]]:
        for t, v, w in zip(self.twist_t_ns.tolist(), self.v_B_mps, self.w_B_radps, strict=True):
            yield t + self.twist_delay_ns, 0, Twist(t, v, w)

    def _imu(self) -> Iterator[tuple[int, int, Message]]:
        """Yields the IMU's messages, each at the time of its last reading."""
        small = np.array([reading.t_ns for reading in self.readings], np.int64)
        cuts = np.union1d(self.frame_t_ns, small)
        if self.pictures is not None:
            cuts = np.union1d(cuts, self.pictures.t_ns)
        for t, message in inertial.messages(self.inertial, cuts, self.imu_batch):
            yield t + self.twist_delay_ns, 0, message

    def _small(self) -> Iterator[tuple[int, int, Message]]:
        for reading in sorted(self.readings, key=lambda m: (m.t_ns, m.sensor)):
            yield reading.t_ns, 1, reading

    def _truths(self) -> Iterator[tuple[int, int, Message]]:
        count = len(self.truth_t_ns)
        knows = TruthKnows(0)
        if self.truth_velocity is not None:
            knows |= TruthKnows.VELOCITY
        if self.truth_bias is not None:
            knows |= TruthKnows.BIAS
        v_B = np.zeros((count, 3)) if self.truth_velocity is None else self.truth_velocity
        bias = np.zeros((count, 6)) if self.truth_bias is None else self.truth_bias
        times = self.truth_t_ns.tolist()
        for t, R, p, v, b in zip(times, *self.truth, v_B, bias, strict=True):
            yield t, 2, Truth(t, R, p, knows, v, b)

    def _stereos(self) -> Iterator[tuple[int, int, Message]]:
        bounds = self.tracks.bounds()
        ids = self.tracks.id.astype(np.uint32)
        pixels = self.tracks.pixels.astype(np.float32)
        own = self.tracks.sigma_px
        sigmas = None if own is None else own.astype(np.float32)
        for k, t in enumerate(self.frame_t_ns.tolist()):
            rows = slice(bounds[k], bounds[k + 1])
            sigma = None if sigmas is None else sigmas[rows]
            message = Stereo(t, ids[rows], pixels[rows], sigmas=sigma)
            yield t + self.camera_delay_ns, 3, message

    def _images(self) -> Iterator[tuple[int, int, Message]]:
        if self.pictures is not None:
            for t, band in self.pictures.messages():
                yield t + self.camera_delay_ns, 4, band

    def write(self, path: Path) -> int:
        """Writes the whole file; returns its size in bytes. Nothing remains if that fails."""
        self._check(path)
        return write_file(path, self.messages(), len(self))

    def _check(self, path: Path) -> None:
        for name, times in (
            ("twist", self.twist_t_ns),
            ("IMU reading", self.inertial.t_ns),
            ("frame", self.frame_t_ns),
            ("truth", self.truth_t_ns),
        ):
            back = np.nonzero(np.diff(times) <= 0)[0]
            if len(back):
                raise PelorusError(
                    f"{path}: {name} {int(back[0]) + 1}: time does not ascend "
                    f"({times[back[0]]} ns, then {times[back[0] + 1]} ns)"
                )
            if len(times) and times[0] < 0:
                raise PelorusError(f"{path}: {name} 0: negative time {times[0]} ns")
