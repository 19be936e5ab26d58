# SPDX-License-Identifier: MIT
"""Which runs the report compares, and how each is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pelorus.report.replay import Programs, depth_limit_m

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
