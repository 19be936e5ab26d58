# SPDX-License-Identifier: MIT
"""All runs over one recording, compared with the truth where there is one.

The trace of the whole map's covariance is the course report's figure 2. The course's state holds
every landmark of the recording from the first frame on. Ours holds those in its slots, so the
report adds up what it leaves behind:

- the state's own trace, pose and landmarks in the slots, of each frame;
- a landmark that has left keeps the covariance with which it left (its LANDMARK frame);
- one that was not seen yet stands at its prior, 3 landmark-sigma^2: 6 m^2 with the report's
  Sigma_m = 2 I, which also stands in where landmarks start from the pixels.

Seen means: with a disparity of which a landmark could be made. Points that were never taken, for
they were too far off, are not part of the map and of the sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pelorus.errors import PelorusError
from pelorus.evaluate.evaluation import Accuracy, assess, by_imu, on_its_clock
from pelorus.grid.occupancy import Grid, Wish, occupancy
from pelorus.grid.sightings import sightings
from pelorus.math.motion import Times
from pelorus.report.results import OWN, Run, Subject
from pelorus.wire.frames import Kind, Landmark, Message, Report, Role, Stereo
from pelorus.wire.layout import Floats
from pelorus.wire.settings import in_force

DIAGONAL = (0, 2, 5)  # of a packed 3 x 3
PRIOR_VARIANCE_M2 = 2.0  # Sigma_m of the report, an axis


class Traces(NamedTuple):
    """Traces after each frame: of the state, and of the whole map; NaN where P is invalid."""

    t_ns: Times
    active: Floats
    whole: Floats
    ids: int  # landmarks of the recording


def traces(messages: Sequence[Message], t_ns: Times, active: Floats) -> Traces:
    """Returns the traces by a result's messages and the state's trace at the frames' times."""
    least_px = in_force(messages, "min-disparity") or 0.0
    sigma_m = in_force(messages, "landmark-sigma") or 0.0
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


COURSE = "course"


@dataclass(frozen=True)
class Comparison:
    """The runs in the order of the table."""

    subject: Subject
    runs: list[Run]

    @cached_property
    def accuracy(self) -> dict[str, Accuracy]:
        """Returns the accuracy by the run's name; empty without truth."""
        truth = self.subject.truth
        if truth is None:
            return {}
        found = {
            run.name: assess(
                run.trajectory,
                on_its_clock(run.messages, truth, run.trajectory),
                run.covariance,
                upright=by_imu(run.messages),
            )
            for run in self.runs
        }
        return {name: accuracy for name, accuracy in found.items() if accuracy is not None}

    @cached_property
    def main(self) -> Run:
        return self.run(OWN)

    def run(self, name: str) -> Run:
        return next(run for run in self.runs if run.name == name)

    @cached_property
    def grid(self) -> Grid | None:
        """Returns the occupancy grid of the main run; None if it is empty."""
        try:
            return occupancy(sightings(self.main.log, self.main.messages), Wish())
        except PelorusError:
            return None

    @property
    def has_course(self) -> bool:
        return any(run.name == COURSE for run in self.runs)

    @cached_property
    def whole_map(self) -> Traces:
        """Returns the course filter's traces; its landmarks have their covariance in metres."""
        run = self.run(COURSE)
        return traces(run.messages, run.frames.t_ns, run.frames["trace"])

    @cached_property
    def origin_ns(self) -> int:
        return min(int(run.frames.t_ns[0]) for run in self.runs)

    def seconds(self, t_ns: Times) -> Floats:
        """Returns times since the first frame, s."""
        return np.asarray((t_ns - self.origin_ns) * 1e-9)
