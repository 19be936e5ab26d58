# SPDX-License-Identifier: MIT
"""All runs over one recording, beside the truth where there is one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from pelorus import map_error
from pelorus.errors import PelorusError
from pelorus.grid.occupancy import Grid, Wish, occupancy
from pelorus.grid.sightings import messages_of, sightings
from pelorus.map_error import MapFigures
from pelorus.motion import Times
from pelorus.report import style
from pelorus.report.accuracy import Accuracy, assess
from pelorus.report.results import Run
from pelorus.report.subject import Subject
from pelorus.report.whole_map import Traces, traces
from pelorus.se3 import Floats

MAIN = "body"  # the default model: what the report is about
COURSE = "course"


@dataclass(frozen=True)
class Comparison:
    """`runs` in the order of the table."""

    subject: Subject
    runs: list[Run]

    @cached_property
    def accuracy(self) -> dict[str, Accuracy]:
        """By the run's name; empty without truth."""
        truth = self.subject.truth
        if truth is None:
            return {}
        found = {run.name: assess(run.trajectory, run.covariance, truth) for run in self.runs}
        return {name: accuracy for name, accuracy in found.items() if accuracy is not None}

    @cached_property
    def main(self) -> Run:
        return self.run(MAIN)

    def run(self, name: str) -> Run:
        return next(run for run in self.runs if run.name == name)

    @cached_property
    def grid(self) -> Grid | None:
        """The map that the main run made; None where nothing stands in it."""
        log = self.main.log
        try:
            return occupancy(sightings(log, messages_of(log)), Wish())
        except PelorusError:
            return None

    @cached_property
    def map_error(self) -> dict[str, MapFigures]:
        """By the run's name; empty where the recording knows no landmark."""
        if not self.subject.known:
            return {}
        found = {run.name: self._map_error(run) for run in self.runs}
        return {name: figures for name, figures in found.items() if figures is not None}

    def _map_error(self, run: Run) -> MapFigures | None:
        accuracy = self.accuracy.get(run.name)
        A = accuracy.A if accuracy else map_error.UNMOVED
        return map_error.compare(messages_of(run.log), self.subject.known, A)

    @cached_property
    def whole_map(self) -> Traces:
        """Of the course's filter, whose landmarks have their covariance in metres."""
        run = self.run(COURSE)
        return traces(messages_of(run.log), run.frames.t_ns, run.frames["trace"])

    @cached_property
    def origin_ns(self) -> int:
        return min(int(run.frames.t_ns[0]) for run in self.runs)

    def seconds(self, t_ns: Times) -> Floats:
        """Time since the first frame."""
        return style.seconds(t_ns, self.origin_ns)
