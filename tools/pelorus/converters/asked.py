# SPDX-License-Identifier: MIT
"""What a folder or a bag does not say, or says otherwise than its user."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pelorus.converters.streams import Readings, Twists
from pelorus.frames import TwistTiming
from pelorus.rig.lens import LensModel
from pelorus.trajectory import Trajectory


@dataclass(frozen=True)
class Asked:
    """In place of the source's own; `calibration`, `extrinsic` and `lens` as rig.read has them."""

    calibration: tuple[Path, ...] = ()
    extrinsic: Path | None = None
    lens: LensModel | None = None
    motion: Twists | Readings | None = None
    truth: Trajectory | None = None
    measured: frozenset[str] = Twists.measured  # of the source's own twists
    timing: TwistTiming | None = None
    fix: bool = True
