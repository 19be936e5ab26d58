# SPDX-License-Identifier: MIT
"""Pictures become tracks: how points are expected to have moved, by twists or a gyro, and did."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain

import numpy as np

from pelorus.converters.repeated import Repeats
from pelorus.converters.streams import Pictures, Streams, Twists
from pelorus.eyes.front_end import Eyes, Motion, Shown, track
from pelorus.io.tracks import Tracks
from pelorus.math import motion, se3
from pelorus.math.inertial import Inertial
from pelorus.math.motion import Times
from pelorus.math.se3 import Poses
from pelorus.program.console import progress
from pelorus.tracking import images
from pelorus.wire.frames import Header, TwistTiming
from pelorus.wire.layout import Floats

MOST_M = 100.0  # from pair to pair; more is another unit


class Expected:
    """The camera's motion between pictures of these times, as far as it is measured."""

    def __init__(self, t_ns: Times, T_CB: Poses, own_ns: Times) -> None:
        self._T_CB = T_CB
        self._known = (t_ns >= own_ns[0]) & (t_ns <= own_ns[-1])
        self._path: Poses | None = None
        self._turns_alone = True

    @classmethod
    def by_twists(
        cls,
        t_ns: Times,
        T_CB: Poses,
        twists: tuple[Times, Floats, Floats],
        measured: frozenset[str],
        timing: TwistTiming,
    ) -> Expected:
        """Returns that of times, velocities and rates, of which some were `measured`."""
        found = cls(t_ns, T_CB, twists[0])
        if measured:
            found._path = motion.path_at(t_ns, *twists, timing)
            found._turns_alone = not measured & {"vx", "vy", "vz"}
        return found

    @classmethod
    def by_gyro(cls, t_ns: Times, T_CB: Poses, readings: Inertial) -> Expected:
        """Returns that of a gyro: the turn alone."""
        found = cls(t_ns, T_CB, readings.t_ns)
        w, still = readings.w_B_radps, np.zeros_like(readings.w_B_radps)
        found._path = motion.path_at(t_ns, readings.t_ns, still, w, TwistTiming.MID)
        return found

    def between(self, earlier: int, later: int) -> Motion | None:
        """Returns (R, p), x_later = R x_earlier + p in the camera, of two pictures by their number;
        p = 0 where only the turn is measured."""
        path = self._path
        if path is None or not (self._known[earlier] and self._known[later]):
            return None
        moved = se3.compose(se3.inverse(path.at(later)), path.at(earlier))
        seen = se3.conjugate(self._T_CB, moved)
        p = np.zeros(3) if self._turns_alone else seen.p
        finite = np.isfinite(seen.R).all() and np.isfinite(p).all()
        return (seen.R, p) if finite and np.abs(p).max() <= MOST_M else None


def _expected(streams: Streams, header: Header, t_ns: Times) -> Expected:
    """Returns how points of pictures of these times are expected to have moved."""
    T_CB, motion = Poses(header.R_CB, header.t_CB_m), streams.motion
    if isinstance(motion, Twists):
        moved = motion.t_ns, motion.v_B_mps, motion.w_B_radps
        return Expected.by_twists(t_ns, T_CB, moved, motion.measured, header.twist_timing)
    return Expected.by_gyro(t_ns, T_CB, streams.calibrated.imu.correction.of(motion.inertial))


def tracked(
    streams: Streams, pictures: Pictures, t_ns: Times, repeats: Repeats
) -> tuple[Header, Tracks]:
    """Returns the HEADER of the rectified pictures, and the tracks in them."""
    calibrated = streams.calibrated
    pairs = pictures.read()
    first = next(pairs)
    height, width = first[0].shape
    header, rig = calibrated.header, calibrated.rig
    images.require_size(pictures.where[0], first[0].shape, calibrated.sizes)
    if rig is not None:
        rig = rig.of_size(width, height)
        header = rig.header(rig.rectification(), header.name)
    header = replace(header, image_width_px=width, image_height_px=height)

    def shown() -> Iterator[Shown]:
        last = None
        for k, pair in enumerate(chain((first,), pairs)):
            for where, picture in zip(pictures.where, pair, strict=True):
                images.require_alike(where, picture, first[0])
            if not repeats.leaves_out(*pair):
                motion = None if last is None else expected.between(last, k)
                yield Shown(int(t_ns[k]), *pair, motion)
                last = k

    expected = _expected(streams, header, t_ns)
    eyes = Eyes(header.camera, (width, height), rig)
    return header, track(progress(shown(), "tracking", len(pictures.t_ns)), eyes, pictures.where)
