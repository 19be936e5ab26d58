# SPDX-License-Identifier: MIT
"""A recording as a camera whose pictures have been followed already."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pelorus.errors import PelorusError
from pelorus.live.camera import Asked, Measured
from pelorus.rig.read import Calibrated
from pelorus.wire.frames import Config, Imu, Process, Reading, Stereo, Twist
from pelorus.wire.framing import header_of_messages, messages_of
from pelorus.wire.settings import IDS

NAMES = {number: name for name, number in IDS.items()}


class Recorded:
    """Its tracks, readings and settings; START and known landmarks are left out."""

    recorded, remarks = True, ()

    def __init__(self, asked: Asked) -> None:
        if not asked.source:
            raise PelorusError("--camera plr: its name is missing: pelorus live ... DRIVE.plr")
        self.name = asked.source
        self._messages = messages_of(Path(asked.source))
        header = header_of_messages(self._messages)
        self.inertial = header.process is Process.IMU
        self.calibrated = Calibrated(header)
        self.settings = {
            NAMES[id]: value
            for m in self._messages
            if isinstance(m, Config) and not m.build_fingerprint
            for id, value in m.settings.items()
            if id in NAMES
        }

    def measured(self) -> Iterator[Measured]:
        for m in self._messages:
            if isinstance(m, Imu):
                rows = zip(m.times_ns, m.a_B_mps2, m.w_B_radps, strict=True)
                yield from (Imu(int(t), a[None], w[None]) for t, a, w in rows)
            elif isinstance(m, Twist | Reading | Stereo):
                yield m

    def close(self) -> None:
        pass


open_camera = Recorded
