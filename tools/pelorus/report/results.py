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
from pelorus.evaluation import known_in
from pelorus.frames import Header, Landmark, Message, Pose, Role, Truth
from pelorus.layout import Floats, unpack_symmetric
from pelorus.motion import Times
from pelorus.replay import Outputs, Programs, depth_limit_m, replay
from pelorus.se3 import Poses
from pelorus.trajectory import Trajectory, truth_of


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
    truth = _truth(path) if any(isinstance(m, Truth) for m in messages) else None
    return Subject(path, header, truth, known_in(messages))


def _truth(path: Path) -> Trajectory | None:
    """None where no TRUTH has a frame's time: the verdict says that there is nothing to compare."""
    try:
        return truth_of(path)
    except PelorusError:
        return None


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


POSE_SIZE = 6
DIAGONAL = (0, 2, 5)  # of a packed 3 x 3


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
    """One replay: `trajectory` and the pose covariance (n, 6, 6) after each frame."""

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


def carry_out(plan: Plan, recording: Path, folder: Path) -> Run:
    """Replay the recording as planned, leave the files in the folder, and read them."""
    outputs = Outputs.named(folder, plan.name)
    summary, said = replay(plan.program, recording, plan.options, outputs)
    messages = wire.messages_of(outputs.log)
    trajectory, covariance = _poses(outputs.log, messages)
    return Run(
        plan,
        summary,
        said,
        read_frames(outputs.frames),
        trajectory,
        covariance,
        read_map(messages),
        messages,
        outputs.log,
    )


def read_poses(log: Path) -> tuple[Trajectory, Floats]:
    """The poses after STEREO with their whole covariance, which no other output has.

    NaN where the filter has diverged and knows none.
    """
    return _poses(log, wire.messages_of(log))


def _poses(log: Path, messages: Sequence[Message]) -> tuple[Trajectory, Floats]:
    poses = [m for m in messages if isinstance(m, Pose) and m.after_stereo]
    if not poses:
        raise PelorusError(f"{log}: holds no pose after a stereo frame")
    t_ns = np.array([pose.t_ns for pose in poses], np.int64)
    R = np.array([pose.R_WB for pose in poses])
    p = np.array([pose.p_WB_m for pose in poses])
    unknown = np.full(POSE_SIZE * (POSE_SIZE + 1) // 2, np.nan)
    packed = np.array([pose.covariance if pose.knows_covariance else unknown for pose in poses])
    return Trajectory(t_ns, Poses(R, p)), unpack_symmetric(packed, POSE_SIZE)


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
    made = [m for m in messages if isinstance(m, Landmark) and m.role != Role.KNOWN]
    variances = np.array([m.covariance[list(DIAGONAL)] for m in made]).reshape(-1, 3)
    places = np.array([m.p_W_m for m in made]).reshape(-1, 3)
    return Points(places, np.sqrt(variances.mean(axis=1)))
