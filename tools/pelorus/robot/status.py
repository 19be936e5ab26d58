# SPDX-License-Identifier: MIT
"""A robot's numbers in words: `plr_status`, `plr_health` and `plr_reason`.

They are defined in include/pelorus/types.h.
"""

from __future__ import annotations

from pelorus.wire.frames import Kind
from pelorus.wire.schema import HEALTHS, REASONS, STATUSES


def condition(health: int, reasons: int) -> str:
    """Returns `plr_health` with its `plr_reason`: "degraded (the gate is locked)"."""
    words = [text for reason, text in REASONS.items() if reasons & reason]
    name = HEALTHS.get(health, f"health {health}")
    return f"{name} ({', '.join(words)})" if words else name


def refusal(subject: int, status: int, count: int) -> str:
    """Returns one line of a summary of refusals."""
    known = subject in list(Kind)
    what = Kind(subject).name if known else f"kind {subject}"
    if subject == 0:
        what = "frames"
    why = STATUSES.get(status, "no status of this version")
    return f"{count} {what}: {why} (status {status})"
