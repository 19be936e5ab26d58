# SPDX-License-Identifier: MIT
"""The recording, the result of each run of a filter, and these compared with the truth.

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
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pelorus.errors import PelorusError
from pelorus.evaluate.evaluation import Accuracy, accuracy_of, judge, known_in, made_in, sigmas_m
from pelorus.evaluate.frame_table import FrameTable, frame_table
from pelorus.evaluate.health import TimeLine, time_line
from pelorus.grid.occupancy import Grid, Wish, occupancy
from pelorus.grid.sightings import sightings
from pelorus.io.trajectory import Trajectory, estimate_in, truth_in
from pelorus.math.motion import Times
from pelorus.native.replay import Outputs, Programs, depth_limit_m, replay
from pelorus.wire import framing
from pelorus.wire.frames import Header, Kind, Landmark, Message, Process, Report, Role, Stereo
from pelorus.wire.layout import Floats
from pelorus.wire.settings import in_force


@dataclass(frozen=True)
class Subject:
    """The recording: `truth` has the poses at STEREO times; `known` landmarks are in the truth's
    world.
    """

    path: Path
    header: Header
    truth: Trajectory | None
    known: list[Landmark]

    @property
    def known_W_m(self) -> Floats:
        """Returns the known landmarks (n, 3)."""
        return np.array([landmark.p_W_m for landmark in self.known]).reshape(-1, 3)

    @property
    def title(self) -> str:
        return self.header.name or self.path.name


def read_subject(path: Path) -> Subject:
    """Reads a recording; raises PelorusError where there is nothing to report on."""
    messages = framing.messages_of(path)
    header = next(m for m in messages if isinstance(m, Header))
    return Subject(path, header, truth_in(messages), known_in(messages))


def require_twists(subject: Subject, also: Sequence[str]) -> None:
    """Refuses an IMU's recording, for the filters to compare with take twists alone."""
    if also and subject.header.process is Process.IMU:
        asked = " ".join(f"--also {name}" for name in also)
        raise PelorusError(
            f"{subject.path}: holds an IMU's readings, and {asked} asks for a filter that takes "
            "twists alone (velocities and rates of turn): leave it out. Your own run and dead "
            "reckoning are compared without it"
        )


OWN = "yours"  # the run with the settings that were given, and what the report is about
WORLD_DEPTH_M = 60.0  # the world model must leave far points out


@dataclass(frozen=True)
class Plan:
    """A planned run; its name is also that of its files."""

    name: str
    program: Path
    options: tuple[str, ...]


def plan_runs(
    programs: Programs, recording: Path, settings: Sequence[str], also: Sequence[str] = ()
) -> list[Plan]:
    """Returns the user's own run, dead reckoning, and `course` and `world` if asked for.

    `settings` hold for all but `course`, which has a fixed preset.
    """
    plans = [
        Plan(OWN, programs.float32, tuple(settings)),
        Plan("dead-reckoning", programs.float32, (*settings, "--mode", "dead_reckoning")),
    ]
    if "course" in also:
        plans.append(Plan("course", programs.float64, ("--preset", "course")))
    if "world" in also:
        world = (*settings, "--model", "world")
        if depth_limit_m(programs.float64, recording, world) == 0:
            world = (*world, "--max-depth", f"{WORLD_DEPTH_M:g}")
        plans.append(Plan("world", programs.float64, world))
    return plans


class Points(NamedTuple):
    """Landmarks in the world: positions (n, 3), and sigma (n,), m, the root of an axis' mean
    variance.
    """

    p_W_m: Floats
    sigma_m: Floats


@dataclass(frozen=True)
class Run:
    """A finished run.

    `trajectory` and the pose covariance (n, 6, 6) are after each frame; `summary` is the program's,
    with the figures of `pelorus.evaluate.evaluation`.
    """

    plan: Plan
    summary: dict[str, Any]
    said: list[str]
    frames: FrameTable
    trajectory: Trajectory
    covariance: Floats
    landmarks: Points
    messages: list[Message]  # of its log
    log: Path

    @property
    def name(self) -> str:
        return self.plan.name

    @property
    def health(self) -> TimeLine:
        """Returns when health was not good, and why."""
        return self._health or TimeLine(0, {}, ())

    @cached_property
    def _health(self) -> TimeLine | None:
        return time_line(self.messages)

    @property
    def poses_given(self) -> bool:
        """Returns whether the mode is mapping: the poses are then the truth's, without error."""
        return bool(self.summary["mode"] == "mapping")


def carry_out(plan: Plan, subject: Subject, folder: Path) -> Run:
    """Replays the recording as planned, leaves the files in the folder, and reads them."""
    outputs = Outputs.named(folder, plan.name)
    summary, said = replay(plan.program, subject.path, plan.options, outputs)
    messages = framing.messages_of(outputs.log)
    found = estimate_in(messages)
    if found is None:
        raise PelorusError(f"{outputs.log}: holds no pose after a stereo frame")
    return Run(
        plan,
        summary | judge(messages, subject.truth, subject.known),
        said,
        frame_table(messages),
        *found,
        read_map(messages),
        messages,
        outputs.log,
    )


def read_map(messages: Sequence[Message]) -> Points:
    """Returns the landmarks that a filter left behind, evicted and final."""
    made = made_in(messages)
    return Points(np.array([m.p_W_m for m in made]).reshape(-1, 3), sigmas_m(made))


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
        found = {run.name: accuracy_of(run.messages, truth) for run in self.runs}
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
