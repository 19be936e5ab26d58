# SPDX-License-Identifier: MIT
"""A folder like EuRoC's as a camera: pictures and IMU in the order of their times."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pelorus.converters import euroc, streams
from pelorus.errors import PelorusError
from pelorus.live.camera import Asked, Measured, Picture
from pelorus.wire.frames import Imu

Entry = tuple[int, int, Measured]  # its time, and which of equal times comes first


class Folder:
    """It waits for its reader, so every picture is followed."""

    recorded, inertial = True, True

    def __init__(self, asked: Asked) -> None:
        if not asked.source:
            raise PelorusError("--camera folder: its name is missing: pelorus live ... FOLDER")
        given = streams.Asked(calibration=asked.calibration, extrinsic=asked.extrinsic)
        self.name = asked.source
        self._streams = euroc.read(Path(asked.source), given)
        self.calibrated = self._streams.calibrated
        self.remarks = self._streams.all_remarks

    def measured(self) -> Iterator[Measured]:
        for _, _, one in heapq.merge(self._readings(), self._pictures(), key=lambda e: e[:2]):
            yield one

    def close(self) -> None:
        pass

    def _readings(self) -> Iterator[Entry]:
        motion = self._streams.motion
        assert isinstance(motion, streams.Readings)
        t_ns, a, w = motion.inertial
        for k, t in enumerate(t_ns.tolist()):
            yield t, 0, Imu(t, a[k : k + 1], w[k : k + 1])

    def _pictures(self) -> Iterator[Entry]:
        frames = self._streams.frames
        assert isinstance(frames, streams.Pictures)
        for t, pair in zip(np.asarray(frames.t_ns).tolist(), frames.read(), strict=True):
            yield t, 1, Picture(t, False, pair[0])
            yield t, 2, Picture(t, True, pair[1])


open_camera = Folder
