# SPDX-License-Identifier: MIT
"""The EVIDENCE of docs/REPLAY-FORMAT.md: what the supervisor saw in a frame, and decided."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntFlag
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pelorus.wire import schema
from pelorus.wire.frames import Kind, Message, rows_of, zeros
from pelorus.wire.layout import Floats, row_type

REJECTED_MAX = schema.LIMITS["rejected_landmarks"]  # in one EVIDENCE
_ROW = row_type(schema.MESSAGES["EVIDENCE"].rows)


class EvidenceFlag(IntFlag):
    """Flags of an EVIDENCE."""

    APPLIED = 1
    OUTRIGHT = 2
    WAITS = 4
    HOLDS_BIASES = 8
    LOCKED = 16
    FROZEN = 32
    MISFITS = 64
    SETTLED = 128


@dataclass(frozen=True, eq=False)
class Evidence(Message, kind=Kind.EVIDENCE):
    """What the supervisor saw in one frame and decided: docs/SUPERVISION.md.

    `rejected` are landmarks that were seen and not used: id, why, in_succession, mean2.
    """

    t_ns: int
    nu: Floats = zeros(6)
    moved: Floats = zeros(6)
    statistic: float = 0.0
    usual: Floats = field(default_factory=lambda: np.ones(6))
    agreement: float = 0.0
    weight: float = 1.0
    difference: Floats = zeros(6)
    doubt: int = 0
    flags: int = 0  # EvidenceFlag
    matched: int = 0
    same: int = 0
    known: int = 0
    adopted: int = 0
    rejected: NDArray[Any] = field(default_factory=lambda: np.zeros(0, _ROW))

    def values(self) -> dict[str, Any]:
        return super().values() | {"count": len(self.rejected)}

    def pack(self) -> bytes:
        if len(self.rejected) > REJECTED_MAX:
            raise ValueError(f"{len(self.rejected)} landmarks, at most {REJECTED_MAX} fit")
        return super().pack() + self.rejected.astype(_ROW).tobytes()

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:
        rows = rows_of(payload, end, _ROW, values.pop("count"))
        return cls(**values, rejected=rows)
