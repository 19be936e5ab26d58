# SPDX-License-Identifier: MIT
"""The noises with which vision contradicts the twists (or the IMU) no more often than before.

The likeliest noises are those of single steps. What is off for longer than a step (a scale by a
percent, a lever by centimetres, the clock by milliseconds) hides below wide noises; below narrow
ones it is a contradiction in frame after frame. Then all noises are enlarged alike, until it hides.
"""

from __future__ import annotations

from dataclasses import replace

from pelorus.check.outcome import Bench
from pelorus.check.parameters import Tuned, of_process

MORE = 0.1  # of the frames
STEP, MOST = 2**0.5, 4.0  # times


def with_no_more_contradictions(bench: Bench, tuned: Tuned) -> Tuned:
    """As it is, too, where even four times the noises do not help."""
    often = tuned.before.contradicted + MORE
    if tuned.after.contradicted <= often:
        return tuned
    names = {parameter.setting for parameter in of_process(bench.by_imu).values()}
    times = STEP
    while times <= MOST * 1.01:
        wider = {
            name: _times(value, times) if name in names else value
            for name, value in tuned.settings.items()
        }
        after = bench.run(wider)
        if after.contradicted <= often:
            words = (
                f"all noises are {times:.1f} times the likeliest ones, with which vision "
                f"contradicts the twists (or the IMU) in {tuned.after.contradicted:.0%} of the "
                "frames: something is off for longer than a step, as a scale, a lever or a clock"
            )
            return replace(tuned, settings=wider, after=after, doubts=[*tuned.doubts, words])
        times *= STEP
    return tuned


def _times(value: str, times: float) -> str:
    return ",".join(f"{times * float(part):.4g}" for part in value.split(","))
