# SPDX-License-Identifier: MIT
"""`pelorus evaluate TRAJECTORY.tum --truth FILE | --road FILE.csv`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import typer
from rich.table import Table

from pelorus import evaluation, road, se3
from pelorus.console import out
from pelorus.errors import PelorusError
from pelorus.frames import Message
from pelorus.report.results import read_poses
from pelorus.trajectory import Trajectory, is_recording, read_truth, read_tum
from pelorus.wire import messages_of

MEANING = {
    "err0_m": "RMS position error, first poses aligned",
    "ate_m": "RMS position error after the best rigid fit",
    "rot_deg": "RMS rotation error, first poses aligned",
    "poses": "poses compared",
    "path_m": "length of the trajectory",
    "road_m": "RMS distance to the road",
    "out_of_plane_m": "RMS distance out of the trajectory's plane",
    "tilt_deg": "tilt of that plane against the first pose's z",
    "map_rms_m": "RMS distance of the landmarks from where they are known to be",
    "map_median_m": "median of that distance",
    "map_nees": "squared error of a landmark over its covariance, an axis: 1 is due",
    "landmarks": "landmarks compared",
    "step_change_m": "RMS change of the step from pose to pose: how erratic it is",
}


def register(parent: typer.Typer) -> None:
    """Add `evaluate` to the command line."""
    parent.command(
        epilog="Example:  pelorus evaluate drive.tum --truth drive.plr",
    )(evaluate)


def evaluate(
    trajectory: Path = typer.Argument(
        ...,
        metavar="TRAJECTORY.tum",
        help="Rows t x y z qx qy qz qw, s and m; or a result (.plr), whose map is compared too "
        "where it or the truth's recording knows landmarks.",
    ),
    truth: Path | None = typer.Option(
        None,
        metavar="FILE",
        help="The reference: a .plr with TRUTH, a TUM file, or KITTI poses (then give "
        "--recording or --times).",
    ),
    road_file: Path | None = typer.Option(
        None, "--road", metavar="FILE.csv", help="A digitised road: rows arc_m,x_m,y_m."
    ),
    recording: Path | None = typer.Option(
        None,
        metavar="IN.plr",
        help="For KITTI poses: times and extrinsic; they are brought from the camera to the body.",
    ),
    times: Path | None = typer.Option(
        None, metavar="TIMES.txt", help="For KITTI poses of the body: a time in s a row."
    ),
    skip: float = typer.Option(45.0, metavar="M", help="With --road: leave out the first metres."),
    tolerance: float = typer.Option(
        1e-6, metavar="S", help="Times that differ by no more are equal."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object."),
) -> None:
    """Compare a trajectory with a reference, or with a road.

    Of a result in mode mapping, whose poses were given, the map alone is compared.
    """
    if (truth is None) == (road_file is None):
        raise typer.BadParameter("either --truth or --road is due", param_hint="--truth / --road")
    result = messages_of(trajectory) if is_recording(trajectory) else []
    estimate = read_poses(trajectory)[0] if result else read_tum(trajectory)
    found: dict[str, float] = {}
    if road_file is not None:
        found = _road(estimate, road_file, skip)
    elif truth is not None:
        reference = read_truth(truth, times, recording)
        tolerance_ns = round(tolerance * 1e9)
        if not evaluation.is_mapping(result):  # the poses are the reference's
            found = asdict(
                evaluation.compare(estimate, reference, tolerance_ns, (trajectory, truth))
            )
        found |= _map(result, truth, estimate, reference, tolerance_ns)
        if not found:
            raise PelorusError(
                f"{trajectory}: its poses were given (mode mapping), and {truth} knows none of its "
                "landmarks: there is nothing to compare"
            )
    found["step_change_m"] = evaluation.step_change(estimate.poses)
    if as_json:
        typer.echo(json.dumps(found))
    else:
        _show(found)


def _map(
    result: Sequence[Message],
    truth: Path,
    estimate: Trajectory,
    reference: Trajectory,
    tolerance_ns: int,
) -> dict[str, float]:
    """Of the landmarks that the truth's recording, or the result itself, knows."""
    known = evaluation.known_in(messages_of(truth)) if is_recording(truth) else []
    known = known or evaluation.known_in(result)
    mine, theirs = evaluation.match(estimate, reference, tolerance_ns)
    if not len(mine):
        return {}
    start = se3.compose(
        estimate.poses.at(int(mine[0])), se3.inverse(reference.poses.at(int(theirs[0])))
    )
    found = evaluation.compare_maps(result, known, start)
    return {} if found is None else asdict(found)


def _road(estimate: Trajectory, path: Path, skip: float) -> dict[str, float]:
    return asdict(road.compare(estimate.poses.p, road.read_road(path), skip))


def _show(found: dict[str, float]) -> None:
    table = Table(box=None, show_header=False, pad_edge=False)
    for key, value in found.items():
        text = str(value) if isinstance(value, int) else f"{value:.3f}"
        table.add_row(key, text, MEANING[key])
    out.print(table)
