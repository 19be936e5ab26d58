# SPDX-License-Identifier: MIT
"""What a robot says in numbers, in words: `plr_status`, `plr_health` and `plr_reason` of
include/pelorus/types.h.
"""

from __future__ import annotations

from pelorus.frames import Kind

STATUSES = {
    -1: "its payload is too short or impossible",
    -2: "a setting makes no sense",
    -3: "the calibration makes no sense",
    -4: "a number is NaN or infinite",
    -5: "a value is out of range",
    -6: "time repeats or goes back",
    -7: "older than the last twist",
    -8: "time jumps forward by more than max-gap",
    -9: "it may not change in mid-flight, or is not of this mode",
    -10: "more than the board has room for",
    -11: "known already",
    -12: "the filter has diverged",
    -13: "nothing is known yet: no HEADER, or no pose, came before",
    -14: "the processor flushes subnormals to zero",
    -15: "damaged on the way",
    -16: "of a kind, version or build that it does not know",
    -17: "the port or the store reports a failure",
    -18: "the filter's memory was changed by something else",
    -19: "program and library were compiled with other sizes",
}

HEALTH = ("good", "degraded", "lost", "diverged")
REASONS = (
    "fewer than 3 observations used",
    "none used in the last 10 frames",
    "the gate is locked",
    "the gate is inert",
    "a block could not be factorised",
    "the map sink failed",
    "no room for new landmarks",
    "observations were malformed or doubled",
    "innovations larger than the noise explains",
    "a landmark's correction was stopped",
    "a variance is not positive",
    "observations left out for want of time",
    "vision contradicts the twists",
    "the pose may be wrong",
    "a bias is far off its prior",
    "innovations far smaller than the noise says",
    "the image is frozen",
    "the points do not agree on one motion",
    "landmarks dropped and covariance widened to go on",
    "no frame used for too long",
    "the filter's memory was changed",
    "twists are missing or refused",
    "readings of a small sensor are rejected",
)


def condition(health: int, reasons: int) -> str:
    """Health and its reasons (`plr_health`, `plr_reason`): "degraded (the gate is locked)"."""
    words = [text for bit, text in enumerate(REASONS) if reasons >> bit & 1]
    name = HEALTH[health] if health < len(HEALTH) else f"health {health}"
    return f"{name} ({', '.join(words)})" if words else name


def refusal(subject: int, status: int, count: int) -> str:
    """One line of a summary."""
    known = subject in list(Kind)
    what = Kind(subject).name if known else f"kind {subject}"
    if subject == 0:
        what = "frames"
    why = STATUSES.get(status, "no status of this version")
    return f"{count} {what}: {why} (status {status})"
