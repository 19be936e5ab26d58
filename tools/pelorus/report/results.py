# SPDX-License-Identifier: MIT
"""What a run left behind, read into arrays."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pelorus import wire
from pelorus.errors import PelorusError
from pelorus.frames import Pose
from pelorus.motion import Times
from pelorus.packed import unpack_symmetric
from pelorus.report.replay import Outputs, replay
from pelorus.report.runs import Plan
from pelorus.se3 import Floats, Poses
from pelorus.trajectory import Trajectory

POSE_SIZE = 6
MAP_COLUMNS = 7  # x y z id role times_seen sigma


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
    trajectory, covariance = read_poses(outputs.log)
    table, landmarks = read_frames(outputs.frames), read_map(outputs.map)
    return Run(plan, summary, said, table, trajectory, covariance, landmarks, outputs.log)


def read_poses(log: Path) -> tuple[Trajectory, Floats]:
    """The poses after STEREO with their whole covariance, which no other output has.

    NaN where the filter has diverged and knows none.
    """
    received, _ = wire.read_file(log)
    poses = [
        frame.message
        for frame in received
        if isinstance(frame.message, Pose) and frame.message.after_stereo
    ]
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


def read_map(path: Path) -> Points:
    """The vertices of an ASCII PLY."""
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except OSError as error:
        raise PelorusError(f"{path}: cannot be read: {error.strerror}") from error
    rows = [line.split() for line in lines[lines.index("end_header") + 1 :]]
    numbers = np.array(rows, float).reshape(-1, MAP_COLUMNS)
    return Points(numbers[:, :3], numbers[:, -1])
