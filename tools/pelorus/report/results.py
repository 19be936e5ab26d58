# SPDX-License-Identifier: MIT
"""What a report is made of: the recording itself, and what each run of a filter left behind."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pelorus import wire
from pelorus.errors import PelorusError
from pelorus.evaluation import judge, known_in, made_in, sigmas_m
from pelorus.frames import Header, Landmark, Message
from pelorus.layout import Floats
from pelorus.motion import Times
from pelorus.replay import Outputs, Programs, depth_limit_m, replay
from pelorus.trajectory import Trajectory, estimate_in, truth_in


@dataclass(frozen=True)
class Subject:
    """`truth` holds the poses at STEREO times; `known` landmarks lie in the truth's world."""

    path: Path
    header: Header
    truth: Trajectory | None
    known: list[Landmark]

    @property
    def known_W_m(self) -> Floats:
        """(n, 3)."""
        return np.array([landmark.p_W_m for landmark in self.known]).reshape(-1, 3)

    @property
    def title(self) -> str:
        return self.header.name or self.path.name


def read_subject(path: Path) -> Subject:
    """Read a recording; PelorusError where there is nothing to report on."""
    messages = wire.messages_of(path)
    header = next(m for m in messages if isinstance(m, Header))
    return Subject(path, header, truth_in(messages), known_in(messages))


WORLD_DEPTH_M = 60.0  # the world model must leave far points out


@dataclass(frozen=True)
class Plan:
    """One run: the name is also that of its files."""

    name: str
    program: Path
    options: tuple[str, ...]


def plan_runs(programs: Programs, recording: Path, settings: Sequence[str]) -> list[Plan]:
    """The runs in the order of the table.

    `settings` hold for all but `course`, whose preset is the whole point of it.
    """
    world = (*settings, "--model", "world")
    if depth_limit_m(programs.float64, recording, world) == 0:
        world = (*world, "--max-depth", f"{WORLD_DEPTH_M:g}")
    dead_reckoning = (*settings, "--mode", "dead_reckoning")
    return [
        Plan("dead-reckoning", programs.float32, dead_reckoning),
        Plan("body", programs.float32, (*settings, "--model", "body")),
        Plan("course", programs.float64, ("--preset", "course")),
        Plan("world", programs.float64, world),
    ]


class Points(NamedTuple):
    """Landmarks in the world: positions (n, 3), and the root of an axis' mean variance (n,), m."""

    p_W_m: Floats
    sigma_m: Floats


class FrameTable:
    """The rows of --frames by column.

    NaN where a refused frame has no estimate, or a diverged filter no covariance.
    """

    def __init__(self, t_ns: Times, columns: dict[str, Floats]) -> None:
        self.t_ns = t_ns
        self._columns = columns

    def __getitem__(self, name: str) -> Floats:
        return self._columns[name]

    def stack(self, *names: str) -> Floats:
        """(rows, len(names))."""
        return np.stack([self._columns[name] for name in names], axis=-1)

    @property
    def reasons(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Bits of `plr_reason`."""
        return self["reasons"].astype(np.int64)


@dataclass(frozen=True)
class Run:
    """One replay: `trajectory` and the pose covariance (n, 6, 6) after each frame; `summary` is the
    program's, with the figures of `pelorus.evaluation`.
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
    def poses_given(self) -> bool:
        """Mode mapping: they are the truth's, and have no error of their own."""
        return bool(self.summary["mode"] == "mapping")


def carry_out(plan: Plan, subject: Subject, folder: Path) -> Run:
    """Replay the recording as planned, leave the files in the folder, and read them."""
    outputs = Outputs.named(folder, plan.name)
    summary, said = replay(plan.program, subject.path, plan.options, outputs)
    messages = wire.messages_of(outputs.log)
    found = estimate_in(messages)
    if found is None:
        raise PelorusError(f"{outputs.log}: holds no pose after a stereo frame")
    return Run(
        plan,
        summary | judge(messages, subject.truth, subject.known),
        said,
        read_frames(outputs.frames),
        *found,
        read_map(messages),
        messages,
        outputs.log,
    )


def read_frames(path: Path) -> FrameTable:
    """A row a frame; the word of the health is the summary's to count."""
    try:
        with path.open(newline="", encoding="ascii") as stream:
            rows = list(csv.DictReader(stream))
    except OSError as error:
        raise PelorusError(f"{path}: cannot be read: {error.strerror}") from error
    if not rows:
        raise PelorusError(f"{path}: holds no frame")
    names = [name for name in rows[0] if name not in ("t_s", "health")]
    t_ns = np.array([_nanoseconds(row["t_s"]) for row in rows], np.int64)
    columns = {name: np.array([float(row[name] or "nan") for row in rows]) for name in names}
    return FrameTable(t_ns, columns)


def _nanoseconds(seconds: str) -> int:
    """Nine decimals are always there; a double would round them."""
    return int(seconds.replace(".", ""))


def read_map(messages: Sequence[Message]) -> Points:
    """The landmarks that a filter left behind, evicted and final."""
    made = made_in(messages)
    return Points(np.array([m.p_W_m for m in made]).reshape(-1, 3), sigmas_m(made))
