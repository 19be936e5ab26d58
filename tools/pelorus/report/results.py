# SPDX-License-Identifier: MIT
"""What a report compares: the recording, and the result of each run of a filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pelorus.errors import PelorusError
from pelorus.evaluate.evaluation import judge, known_in, made_in, sigmas_m
from pelorus.evaluate.frame_table import FrameTable, frame_table
from pelorus.evaluate.health import TimeLine, time_line
from pelorus.io.trajectory import Trajectory, estimate_in, truth_in
from pelorus.native.replay import Outputs, Programs, depth_limit_m, replay
from pelorus.wire import framing
from pelorus.wire.frames import Header, Landmark, Message, Process
from pelorus.wire.layout import Floats


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
