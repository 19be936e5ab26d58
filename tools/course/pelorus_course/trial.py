# SPDX-License-Identifier: MIT
"""One recording, run three ways: dead reckoning, the course's filter, ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from pelorus.errors import PelorusError
from pelorus.evaluate import road
from pelorus.evaluate.road import RoadFit
from pelorus.grid import plane
from pelorus.grid.sightings import sightings
from pelorus.math.se3 import apply
from pelorus.native.replay import Programs
from pelorus.program.console import progress
from pelorus.report.comparison import (
    COURSE,
    OWN,
    Comparison,
    Run,
    Subject,
    Traces,
    carry_out,
    plan_runs,
)
from pelorus.wire.layout import Floats

NAMES = {
    "dead-reckoning": "dead reckoning",
    "course": "the course's filter",
    OWN: "Pelorus (body)",
}
SKIP_M = 45.0  # the digitised road begins later than the drive
NEAR_M, SIGMA_MOST_M = (
    40.0,
    2.0,
)  # landmarks that make a picture: near, and certain beside the camera
SEEN_LEAST = 3


@dataclass(frozen=True)
class Reference:
    """The reference of the trajectories: a truth (in the subject), a road, or none."""

    road_m: Floats | None = None  # (n, 2)


@dataclass(frozen=True)
class Trial:
    """The runs, in the order of NAMES, and the reference."""

    compared: Comparison
    reference: Reference

    @property
    def subject(self) -> Subject:
        return self.compared.subject

    @property
    def runs(self) -> list[Run]:
        return self.compared.runs

    @cached_property
    def road_fits(self) -> dict[str, RoadFit]:
        """Returns the fit of each trajectory to the road, one by one."""
        way = self.reference.road_m
        if way is None or self.subject.truth is not None:
            return {}
        return {run.name: road.fit(run.trajectory.poses.p, way, SKIP_M) for run in self.runs}

    @property
    def traces(self) -> dict[str, Traces]:
        """Returns the traces of the course's run, whose landmarks have a covariance in metres."""
        return {COURSE: self.compared.whole_map}

    def flat(self, name: str, points: Floats) -> Floats:
        """Returns points of a run's world (n, 3) in the picture (n, 2)."""
        if name in self.road_fits:
            return self.road_fits[name].place(points)
        poses = self.compared.main.trajectory.poses
        return plane.choose(self.subject.header.body_axes, poses).flat(points)

    def scatter(self, name: str) -> Floats:
        """Returns (n, 2) a run's landmarks that are near and certain enough to be drawn."""
        run = self.compared.run(name)
        try:
            seen = sightings(run.log, run.messages)
        except PelorusError:  # no landmarks
            return np.empty((0, 2))
        distance = np.linalg.norm(seen.landmarks_W - seen.camera_W[seen.last_frame], axis=1)
        sigma = np.sqrt(np.linalg.eigvalsh(seen.spread)[:, -1])
        good = (distance < NEAR_M) & (sigma < SIGMA_MOST_M) & (seen.times_seen >= SEEN_LEAST)
        return self.flat(name, seen.landmarks_W[good])

    @cached_property
    def true_path(self) -> Floats | None:
        """Returns (n, 2) truth at the estimate's start, or the road; None without either."""
        if self.subject.truth is not None:
            accuracy = self.compared.accuracy["course"]
            return self.flat("course", apply(accuracy.A, self.subject.truth.poses.p))
        return self.reference.road_m if self.road_fits else None


@dataclass(frozen=True)
class TrialOptions:
    """Options of the replays: for dead reckoning and Pelorus, and for the course's filter."""

    ours: Sequence[str] = ()
    course: Sequence[str] = ()


def carry_out_trial(
    subject: Subject, reference: Reference, programs: Programs, options: TrialOptions, folder: Path
) -> Trial:
    """Replays the recording; the files of the runs stay in the folder."""
    found = plan_runs(programs, subject.path, options.ours, (COURSE,))
    planned = {plan.name: plan for plan in found}
    preset = planned[COURSE]
    planned[COURSE] = replace(preset, options=(*preset.options, *options.course))
    plans = progress([planned[name] for name in NAMES], f"replaying {subject.path.name}")
    runs = [carry_out(plan, subject, folder) for plan in plans]
    return Trial(Comparison(subject, runs), reference)
