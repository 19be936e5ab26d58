# SPDX-License-Identifier: MIT
"""Detects the twists' timing: does the reading of frame k hold after it or before it?

Points of frame k are carried to frame k + 1 with either reading. `mid` does not compete: a mean of
two noisy readings has less noise and would win for that alone.
"""

from __future__ import annotations

from pelorus.faults.finding import Finding
from pelorus.faults.likelihood import with_ratio
from pelorus.io.recording import Recording
from pelorus.tracking.visual_motion import seen_pairs
from pelorus.wire.frames import TwistTiming

from pelorus_course.duel import TOO_FEW, duel

Z_MIN = 3.0


def choose(recording: Recording) -> tuple[Recording, Finding]:
    """Returns the recording with START, unless END explains clearly more frames."""
    camera = recording.header.camera
    seen = seen_pairs(recording.tracks, camera, 1)
    choices = [
        recording.with_header(twist_timing=timing)
        for timing in (TwistTiming.START, TwistTiming.END)
    ]
    errors = [
        seen.median_by_frame(seen.reproject(camera, choice.camera_motion(1))) for choice in choices
    ]
    result = duel(errors[0], errors[1], 1)
    late = result.z > Z_MIN
    evidence = TOO_FEW
    if result.frames:
        evidence = (
            f"lag-1 reprojection is {result.given:.2f} px with start and "
            f"{result.challenger:.2f} px with end, "
            f"smaller in {100 * result.share:.0f} % of {result.frames} frames"
        )
        evidence = with_ratio(evidence, result.ratio if late else None)
    action = f"twist timing is {'end' if late else 'start'}"
    return choices[int(late)], Finding(
        "twist timing", bool(late), evidence, action, is_conclusive=result.frames > 0
    )
