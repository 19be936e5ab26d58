# SPDX-License-Identifier: MIT
"""What a recording shows by itself, independently of a filter's run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from pelorus.check.contents import recording_of
from pelorus.check.tracks_noise import TrackNoise, track_noise
from pelorus.errors import PelorusError
from pelorus.faults.agreement import Agreement, agreement
from pelorus.faults.fault import Fault
from pelorus.faults.geometry import Judged
from pelorus.faults.handeye import first_part
from pelorus.faults.named import judged_of
from pelorus.io.recording import Recording
from pelorus.wire.frames import Message, Process
from pelorus.wire.settings import in_force


@dataclass(frozen=True)
class Known:
    """Faults, agreement of camera and body, and track noise; empty without enough data."""

    judged: Judged = field(default_factory=lambda: Judged([]))
    noise: TrackNoise | None = None
    examined: Recording | None = None
    _agreed: dict[float, Agreement | None] = field(default_factory=dict)

    @property
    def faults(self) -> list[Fault]:
        return self.judged.faults

    @property
    def is_stopped(self) -> bool:
        """Returns whether a fault must be mended before anything else is worth examining."""
        return any(fault.stops for fault in self.faults)

    @property
    def by_imu(self) -> bool:
        return self.examined is not None and len(self.examined.inertial.t_ns) > 0

    def agreed(self, bias_mps: float) -> Agreement | None:
        """Returns how far camera and twists agree beside a velocity bias of this sigma, m/s.

        None for an IMU, whose biases the filter estimates.
        """
        views = self.judged.views
        if self.examined is None or self.by_imu or views is None:
            return None
        if bias_mps not in self._agreed:  # kept, for it takes longer than all else
            noise = replace(self.examined.header.noise, bias_velocity_sigma_mps=bias_mps)
            short = first_part(self.examined).with_header(noise=noise)
            same = self.examined.header.noise.bias_velocity_sigma_mps == bias_mps
            told = self.judged.agreed if same else None
            self._agreed[bias_mps] = told or agreement(short, views)
        return self._agreed[bias_mps]


def known_of(messages: Sequence[Message]) -> Known:
    """Examines a log, with the process model that its run used."""
    process = in_force(messages, "process")
    try:
        asked = None if process is None else Process(int(process))
        examined = recording_of(messages, asked)
    except PelorusError:  # no frames, no readings or no points
        return Known()
    judged = judged_of(messages, examined)
    stopped = any(fault.stops for fault in judged.faults)
    return Known(judged, None if stopped else track_noise(examined), examined)
