# SPDX-License-Identifier: MIT
"""What the recording itself contributes to the report: header, truth, known landmarks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pelorus import wire
from pelorus.errors import PelorusError
from pelorus.frames import Header, Landmark, Truth
from pelorus.map_error import known_in
from pelorus.se3 import Floats
from pelorus.trajectory import Trajectory, truth_of


@dataclass(frozen=True)
class Subject:
    """`truth` holds the poses at STEREO times; `known` landmarks lie in the truth's world."""

    path: Path
    header: Header
    truth: Trajectory | None
    known: list[Landmark]

    @property
    def known_W_m(self) -> Floats:
        """(n, 3)."""
        return np.array([landmark.p_W_m for landmark in self.known]).reshape(-1, 3)

    @property
    def title(self) -> str:
        return self.header.name or self.path.name


def read_subject(path: Path) -> Subject:
    """Read a recording; PelorusError where there is nothing to report on."""
    if not path.is_file():
        raise PelorusError(f"{path}: there is no such file")
    received, _ = wire.read_file(path)
    header = wire.header_of(received, path)
    messages = [frame.message for frame in received]
    truth = _truth(path) if any(isinstance(m, Truth) for m in messages) else None
    return Subject(path, header, truth, known_in(messages))


def _truth(path: Path) -> Trajectory | None:
    """None where no TRUTH has a frame's time: the verdict says that there is nothing to compare."""
    try:
        return truth_of(path)
    except PelorusError:
        return None
