# SPDX-License-Identifier: MIT
"""The trace of the whole map's covariance over the frames: the course report's figure 2.

The course's state holds every landmark of the recording from the first frame on. Ours holds those
in its slots, and what the report draws is put together from what it leaves behind:

- the state's own trace, pose and landmarks in the slots, of each frame;
- a landmark that has left keeps the covariance with which it left (its LANDMARK frame);
- one that was not seen yet stands at its prior, 3 landmark-sigma^2: 6 m^2 with the report's
  Sigma_m = 2 I, which also stands in where landmarks start from the pixels.

Seen means: with a disparity of which a landmark could be made. What was seen and never taken, for
it was too far off, is no part of the map and of the sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pelorus.frames import Config, Kind, Landmark, Message, Report, Role, Stereo
from pelorus.motion import Times
from pelorus.se3 import Floats

PRIOR_VARIANCE_M2 = 2.0  # Sigma_m of the report, an axis
MIN_DISPARITY, LANDMARK_SIGMA = 17, 22  # the settings' ids
DIAGONAL = (0, 2, 5)  # of a packed 3 x 3


class Traces(NamedTuple):
    """After each frame: of the state as it is, of the whole map; NaN where P is broken."""

    t_ns: Times
    active: Floats
    whole: Floats
    ids: int  # landmarks of the recording


def traces(messages: Sequence[Message], t_ns: Times, active: Floats) -> Traces:
    """From a result's messages and the state's trace at the frames' times."""
    least_px = _in_force(messages, MIN_DISPARITY, 0.0)
    sigma_m = _in_force(messages, LANDMARK_SIGMA, 0.0)
    prior = 3 * (sigma_m**2 or PRIOR_VARIANCE_M2)
    ids = set[int]()
    for message in messages:
        if isinstance(message, Stereo):
            ids.update(message.ids.tolist())
    known = dict(zip(t_ns.tolist(), active.tolist(), strict=True))
    seen, left = set[int](), dict[int, float]()
    out: list[tuple[int, float, float]] = []
    for message in messages:
        if isinstance(message, Stereo):
            disparity = message.pixels[:, 0] - message.pixels[:, 2]
            now = message.ids[disparity >= least_px].tolist()
            seen.update(now)
            for id in now:  # it is back in the state, or too far off to come back
                left.pop(id, None)
        elif isinstance(message, Landmark) and message.role == Role.EVICTED:
            left[message.id] = float(message.covariance[list(DIAGONAL)].sum())
        elif isinstance(message, Report) and message.subject == Kind.STEREO:
            state = known.get(message.t_ns, np.nan)
            unseen = prior * (len(ids) - len(seen))
            out.append((message.t_ns, state, state + sum(left.values()) + unseen))
    columns = np.array(out).reshape(-1, 3)
    times = np.array([row[0] for row in out], np.int64)
    return Traces(times, columns[:, 1], columns[:, 2], len(ids))


def _in_force(messages: Sequence[Message], id: int, otherwise: float) -> float:
    """The value of a setting."""
    values = [
        m.settings[id]
        for m in messages
        if isinstance(m, Config) and m.build_fingerprint and id in m.settings
    ]
    return values[-1] if values else otherwise
