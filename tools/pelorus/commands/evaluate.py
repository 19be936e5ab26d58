# SPDX-License-Identifier: MIT
"""`pelorus evaluate RECORDING | RESULT | TRAJECTORY.tum [--truth FILE | --road FILE.csv]`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import typer
from rich.markup import escape
from rich.table import Table

from pelorus.commands.choices import CONFIG, PROGRAMS, SETTINGS, replay_options
from pelorus.errors import PelorusError
from pelorus.evaluate import evaluation, misread, road
from pelorus.evaluate.evaluation import assess, judge, known_in, match
from pelorus.io.trajectory import (
    Trajectory,
    estimate_in,
    is_recording,
    read_stamped,
    read_truth,
    truth_of,
)
from pelorus.math.consistency import Figures
from pelorus.native.replay import result_of
from pelorus.program.console import err, out, print_json
from pelorus.wire import calibrated
from pelorus.wire.frames import Message
from pelorus.wire.framing import messages_of

POSES_MIN = 3  # three points fix a rigid fit
MEANING = (
    evaluation.MEANING
    | calibrated.MEANING
    | {
        "road_m": "RMS distance to the road",
        "out_of_plane_m": "RMS distance out of the trajectory's plane",
        "tilt_deg": "tilt of that plane against the first pose's z",
        "step_change_m": "RMS change of the step from pose to pose: how erratic it is",
    }
)

app = typer.Typer()


@app.command(epilog="Example:  pelorus evaluate drive.plr --config robot.conf --set bias=on")
def evaluate(
    source: Path = typer.Argument(
        ...,
        metavar="RECORDING|RESULT|TRAJECTORY.tum",
        help="A recording, or what pelorus-replay --out left of it; or a text file of poses: TUM "
        "(t x y z qx qy qz qw, s and m), ORB-SLAM3, VINS-Fusion, OpenVINS, EuRoC.",
    ),
    truth: Path | None = typer.Option(
        None,
        metavar="FILE",
        help="The reference: a .plr with TRUTH, such a text file, or KITTI poses (then give "
        "--recording or --times). Else the TRUTH in the result itself.",
    ),
    road_file: Path | None = typer.Option(
        None, "--road", metavar="FILE.csv", help="Or a digitised road: rows arc_m,x_m,y_m."
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
    first: float = typer.Option(
        0.0, metavar="S", min=0, help="Look at the first so many seconds alone; 0: at all."
    ),
    tolerance: float = typer.Option(
        1e-6, metavar="S", help="Times that differ by no more are equal."
    ),
    sim3: bool = typer.Option(
        False, "--sim3", help="Also with the scale that fits best (Sim(3)), and that scale."
    ),
    config: Path | None = CONFIG,
    settings: list[str] = SETTINGS,
    programs: Path | None = PROGRAMS,
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object."),
) -> None:
    """Compare a trajectory with a reference, or with a road.

    A recording is replayed first, in float32. The map is compared too, where the truth's recording
    or the result itself knows landmarks; in mode mapping, whose poses were given, it alone.
    """
    if truth is not None and road_file is not None:
        raise typer.BadParameter("one of them, not both", param_hint="--truth / --road")
    options = replay_options(config, settings)
    messages: list[Message] = []
    if is_recording(source):
        messages = result_of(source, options, programs)
    elif options:
        raise typer.BadParameter("for a recording", param_hint="--config / --set")
    elif truth is None and road_file is None:
        raise typer.BadParameter("for a TUM file one is expected", param_hint="--truth / --road")
    found_poses = estimate_in(messages)
    estimate = found_poses[0] if found_poses else read_stamped(source)
    found: Figures = {}
    asked: list[str] = []
    if road_file is not None:
        found |= asdict(road.compare(estimate.poses.p, road.read_road(road_file), skip))
    else:
        reference = truth_of(source) if truth is None else read_truth(truth, times, recording)
        theirs = messages_of(truth) if truth is not None and is_recording(truth) else []
        for remark in (*estimate.remarks, *reference.remarks):
            err.print(escape(remark))
        reference = _until(reference, estimate, first)
        tolerance_ns = round(tolerance * 1e9)
        if messages:
            found |= judge(messages, reference, known_in(theirs), tolerance_ns, theirs)
        else:
            accuracy = assess(estimate, reference, tolerance_ns=tolerance_ns)
            found |= accuracy.figures if accuracy else {"truth_frames": 0}
        found |= _with_scale(estimate, reference, tolerance_ns, messages) if sim3 else {}
        asked = _doubts(truth, (source, estimate), reference, tolerance_ns, bool(messages))
        _require_something(found, (source, estimate), (truth or source, reference), messages)
    told = calibrated.last_calibrated(messages)
    found |= told.figures if told else {}
    found["path_m"] = evaluation.path_m(estimate.poses)
    found["step_change_m"] = evaluation.step_change(estimate.poses)
    if as_json:
        print_json(dict(found))
    else:
        _show(found)
    for question in asked:
        (err if as_json else out).print(f"    -> {escape(question)}")


def _with_scale(
    estimate: Trajectory, reference: Trajectory, tolerance_ns: int, messages: list[Message]
) -> Figures:
    if messages:
        reference = evaluation.on_its_clock(messages, reference, estimate)
    accuracy = assess(estimate, reference, tolerance_ns=tolerance_ns)
    return {} if accuracy is None else accuracy.sim3


def _doubts(
    truth: Path | None,
    mine: tuple[Path, Trajectory],
    reference: Trajectory,
    tolerance_ns: int,
    replayed: bool,
) -> list[str]:
    """Returns doubts whether one of the two was misread; the filter's own result is not doubted."""
    here, there = match(mine[1], reference, tolerance_ns)
    name = f"the truth in {mine[0]}" if truth is None else str(truth)
    a = misread.NamedPoses(str(mine[0]), mine[1].poses.at(here))
    return misread.doubts(a, misread.NamedPoses(name, reference.poses.at(there)), replayed)


def _until(reference: Trajectory, estimate: Trajectory, first_s: float) -> Trajectory:
    """Returns the reference of that time alone."""
    if not first_s:
        return reference
    early = reference.t_ns - estimate.t_ns[0] <= round(first_s * 1e9)
    return Trajectory(reference.t_ns[early], reference.poses.at(early))


def _require_something(
    found: Figures,
    mine: tuple[Path, Trajectory],
    theirs: tuple[Path, Trajectory],
    messages: list[Message],
) -> None:
    """Refuses a comparison without common poses, or without landmarks where poses were given."""
    if evaluation.is_mapping(messages):
        if not found["map_landmarks"]:
            raise PelorusError(
                f"{mine[0]}: its poses were given (mode mapping), and {theirs[0]} knows none of "
                "its landmarks: there is nothing to compare"
            )
    elif (found["truth_frames"] or 0) < POSES_MIN:
        hint = misread.times_apart((str(mine[0]), mine[1].t_ns), (str(theirs[0]), theirs[1].t_ns))
        raise PelorusError(
            f"{mine[0]}: {found['truth_frames']} of its {len(mine[1].t_ns)} poses "
            f"({_span(mine[1])}) have a pose of equal time among the {len(theirs[1].t_ns)} of "
            f"{theirs[0]} ({_span(theirs[1])}); {POSES_MIN} are expected"
            + (f"; {hint}" if hint else "")
        )


def _span(trajectory: Trajectory) -> str:
    return f"{trajectory.t_ns[0] * 1e-9:.3f} to {trajectory.t_ns[-1] * 1e-9:.3f} s"


def _show(found: Figures) -> None:
    table = Table(box=None, show_header=False, pad_edge=False)
    for key, value in found.items():
        if value is not None:
            text = f"{value:.3f}" if abs(value) >= 0.01 else f"{value:.2g}"
            text = str(value) if isinstance(value, int) else text
            table.add_row(key, text, MEANING[key])
    out.print(table)
