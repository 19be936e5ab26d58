# SPDX-License-Identifier: MIT
"""The order of steps (twists, readings of an IMU) and frames in a recording.

A filter cannot go back in time: a frame after a newer step, or a step after a newer frame, is
refused, unless the session lets them wait for each other (setting twist-delay).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pelorus.wire.frames import Imu, Kind, Message, Stereo, Twist

WAIT_MAX_NS = 10_000_000_000  # largest twist-delay


@dataclass
class Late:
    """Messages of a kind that come after newer ones of the other, and how long these would wait."""

    kind: Kind
    of: int = 0
    late: int = 0
    wait_ns: int = 0

    @property
    def wait_s(self) -> float:
        """Returns the least twist-delay that helps, rounded up to a millisecond."""
        return math.ceil(self.wait_ns / 1e6) / 1e3

    @property
    def words(self) -> str:
        """Returns the line of `info`."""
        other = "TWIST or IMU" if self.kind is Kind.STEREO else "STEREO"
        what = "readings" if self.kind is Kind.IMU else "messages"
        said = f"{self.kind.name}: {self.late} of {self.of} {what} stand behind a newer {other}, "
        if self.wait_ns > WAIT_MAX_NS:
            return said + f"by up to {self.wait_s:g} s: their clocks differ"
        return (
            said + f"and are refused unless these wait {self.wait_s:g} s: setting twist-delay "
            f"(pelorus-replay --twist-delay {self.wait_s:g})"
        )


def late_ones(messages: Sequence[Message]) -> list[Late]:
    """Returns steps after newer frames, and frames after newer steps, if there are any.

    Messages out of order among their own kind are another fault, and not counted.
    """
    steps: dict[Kind, Late] = {}
    frames = Late(Kind.STEREO)
    step_ns = frame_ns = -1  # the newest so far
    ahead_ns = 0  # how far that frame was ahead of the steps before it
    for message in messages:
        if isinstance(message, Stereo):
            frames.of += 1
            if frame_ns < message.t_ns < step_ns:
                frames.late += 1
                frames.wait_ns = max(frames.wait_ns, step_ns - message.t_ns)
            if message.t_ns > frame_ns:
                frame_ns = message.t_ns
                ahead_ns = frame_ns - step_ns if step_ns >= 0 else 0
        elif isinstance(message, Twist | Imu):
            found = steps.setdefault(message.kind, Late(message.kind))
            for t in message.times_ns if isinstance(message, Imu) else (message.t_ns,):
                found.of += 1
                if step_ns < t < frame_ns:
                    found.late += 1
                    found.wait_ns = max(found.wait_ns, ahead_ns, frame_ns - t)
                step_ns = max(step_ns, t)
    return [one for one in (*steps.values(), frames) if one.late]
