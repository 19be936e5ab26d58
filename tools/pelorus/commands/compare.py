# SPDX-License-Identifier: MIT
"""`pelorus compare LOG.plr`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import typer
from rich.markup import escape

from pelorus.commands.choices import PROGRAMS
from pelorus.errors import PelorusError
from pelorus.flight.judge import (
    BitsVerdict,
    Desk,
    Difference,
    Judgement,
    PoseDistance,
    comparison_json,
    judge,
    of_this_version,
    verdict_of,
)
from pelorus.flight.log import NOWHERE, Frame, read_log
from pelorus.native.replay import find_programs
from pelorus.program.console import err, out, print_json, tell_lines
from pelorus.robot.stream import condition
from pelorus.wire.frames import Config
from pelorus.wire.schema import STATUSES

LOSSES_SHOWN = 5
START_HINT = "if the pelorus-replay that wrote the log was given --start, give it here too"
OTHER_VERSION = (
    "a build of another version or arithmetic gives other bits: compare with one of the robot's"
)
SAME_SOURCES = (
    "a fingerprint names version, arithmetic, precision and sizes, not each change of the sources: "
    "was the robot's image built from the desk's?"
)
STARTS = ("truth", "identity", "recorded")

app = typer.Typer()


@app.command(epilog="Example:  pelorus compare flight.plr")
def compare(
    log: Path = typer.Argument(
        ...,
        metavar="LOG.plr",
        help="A log of inputs and outputs: of `pelorus stream --record` or `pelorus-replay --out`.",
    ),
    programs: Path | None = PROGRAMS,
    start: str | None = typer.Option(
        None,
        metavar="|".join(STARTS),
        help="As given to the pelorus-replay that wrote the log, which does not hold it.",
    ),
    load_state: Path | None = typer.Option(
        None,
        metavar="FILE",
        help="The state that the drive went on from, as pelorus-replay --save-state keeps it.",
    ),
    as_json: bool = typer.Option(False, "--json", help="What it tells as one JSON object."),
) -> None:
    """Replay a robot's log here, and compare every answer with the robot's, bit by bit.

    POSE and REPORT of each frame; each life of a robot that started anew by itself.

    The exit status is 0 if all bits are the same, 1 if not, 2 if they cannot all be compared.
    """
    if start is not None and start not in STARTS:
        raise typer.BadParameter(f"{start!r} is none of {', '.join(STARTS)}", param_hint="--start")
    try:
        verdict = compare_log(log, programs, start, load_state, as_json)
    except PelorusError as error:
        err.print(f"[bold red]error:[/] {escape(str(error))}")
        verdict = BitsVerdict.NOT_COMPARABLE
    if verdict is not BitsVerdict.SAME:
        raise typer.Exit(verdict)


def compare_log(
    path: Path,
    programs: Path | None,
    start: str | None = None,
    state: Path | None = None,
    as_json: bool = False,
) -> BitsVerdict:
    """Prints the differences, and returns the verdict."""
    desk = Desk(find_programs(programs), start, state)
    with err.status(f"reading {escape(str(path))}"):
        log = read_log(path)
    with err.status(f"replaying {log.frames} frames"):
        judgements = judge(log, desk)
    if as_json:
        print_json(comparison_json(log, judgements))
        return verdict_of(judgements)
    tell_lines(("log", remark) for remark in log.remarks)
    for number, judgement in enumerate(judgements, 1):
        if len(judgements) > 1:
            out.print(f"[bold]part {number} of {len(judgements)}[/], {_span(judgement)}")
        tell_lines(_told(judgement, desk))
    return _conclude(judgements)


# --- what is told ---------------------------------------------------------------------------------


def _span(judgement: Judgement) -> str:
    frames = judgement.part.frames
    began = "" if frames[0].number == 1 else ": the robot started anew"
    return f"frames {frames[0].number} to {frames[-1].number}{began}"


def _told(judgement: Judgement, desk: Desk) -> Iterator[tuple[str, str]]:
    config = judgement.part.config
    if config is not None:
        yield "robot", _build(config)
    if judgement.desk is not None and config is not None:
        yield "desk", f"{_build(judgement.desk)}, {desk.program(config)}"
    yield from _counts(judgement)
    if judgement.first is not None:
        yield from _first(judgement.first)
        yield from _largest(judgement.differences)
    if judgement.why:
        yield "but", judgement.why
    elif judgement.first is not None and config is not None:
        yield "note", SAME_SOURCES if of_this_version(config) else OTHER_VERSION


def _build(build: Config) -> str:
    version = "this version" if of_this_version(build) else "another version"
    return (
        f"build {build.build_fingerprint:#010x}, of {version}: {build.max_landmarks} landmarks, "
        f"{build.max_observations} observations, blocks of {build.block_observations}, "
        f"float{8 * build.real_bytes}"
    )


def _counts(judgement: Judgement) -> Iterator[tuple[str, str]]:
    part = judgement.part
    yield (
        "frames",
        f"{len(part.frames)}, {len(part.answered)} of them answered; "
        f"{judgement.same} the same to the bit",
    )
    unread = sum(frame.unread for frame in part.frames)
    if unread:
        yield "refused", f"{unread} of more observations than the robot has room for"
    if part.last_words:
        first = part.last_words[0].number
        yield "end", f"no answer came from frame {first} on: the robot, the link or the log ended"
    if judgement.left_out:
        numbers = ", ".join(str(frame.number) for frame in judgement.left_out[:LOSSES_SHOWN])
        yield "lost", f"frame {numbers}: it did not reach the robot, and the replay leaves it out"
    for loss in part.losses[:LOSSES_SHOWN]:
        where = "somewhere" if loss.at == NOWHERE else f"at frame {loss.at}"
        yield "lost", f"{where}: {loss.words}"
    if len(part.losses) > LOSSES_SHOWN:
        yield "lost", f"and {len(part.losses) - LOSSES_SHOWN} more"


def _first(found: Difference) -> Iterator[tuple[str, str]]:
    robot = found.robot
    yield (
        "first",
        f"frame {robot.number}, t {_seconds(robot.stereo.t_ns)} s, is the first that differs",
    )
    if found.pose:
        yield "", f"POSE in {', '.join(found.pose)}: {_sizes(found.sizes)}"
    for name, (ours, theirs) in found.report.items():
        yield "", f"REPORT {name}: the desk {ours:.9g}, the robot {theirs:.9g}"
    if robot.number == 1:
        yield "", START_HINT
    yield "said", _said(robot)
    for words in robot.words:
        yield "said", words


def _said(robot: Frame) -> str:
    report = robot.report
    if report is None:
        return "the robot's REPORT on it is not in the log"
    if report.status:
        why = STATUSES.get(report.status, "no status of this version")
        return f"the robot refused it: {why} (status {report.status})"
    return (
        f"health {condition(report.health, report.reasons)}; {report.used} used, "
        f"{report.gated} gated of {report.matched} matched, {report.created} new"
    )


def _sizes(sizes: PoseDistance) -> str:
    return (
        f"{sizes.position_m:.3g} m, {sizes.angle_deg:.3g} deg, "
        f"covariance {sizes.covariance:.3g} of the variances"
    )


def _largest(differences: Sequence[Difference]) -> Iterator[tuple[str, str]]:
    for name, unit in (
        ("position_m", "m"),
        ("angle_deg", "deg"),
        ("covariance", "of the variances"),
    ):
        sizes = [getattr(found.sizes, name) for found in differences]
        most = max(sizes)
        robot = differences[sizes.index(most)].robot
        what = name.partition("_")[0]
        if most > 0:
            yield "largest", f"{what} {most:.3g} {unit}, at frame {robot.number}"


def _seconds(t_ns: int) -> str:
    return f"{t_ns // 10**9}.{t_ns % 10**9:09d}"


def _conclude(judgements: Sequence[Judgement]) -> BitsVerdict:
    verdict = verdict_of(judgements)
    same = sum(judgement.same for judgement in judgements)
    frames = sum(len(judgement.part.frames) for judgement in judgements)
    told = {
        BitsVerdict.SAME: "[bold green]the same bits[/]",
        BitsVerdict.DIFFERENT: "[bold red]different[/]",
        BitsVerdict.NOT_COMPARABLE: "[bold yellow]cannot be compared to the end[/]",
    }[verdict]
    out.print(f"{told}: {same} of {frames} frames are the same to the bit")
    return verdict
