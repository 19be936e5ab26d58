# SPDX-License-Identifier: MIT
"""Replays the parts of a log and judges each: the same bits, different, or not to be compared.

Two answers to one frame are compared bit by bit. `comparison_json` is of `compare --json`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from pelorus import ARITHMETIC, __version__
from pelorus.errors import PelorusError
from pelorus.flight.log import NOWHERE, Frame, Loss, Part, RobotLog, frames_of
from pelorus.native.replay import Programs, replayed
from pelorus.wire.frames import Config, Header, Pose, Report
from pelorus.wire.layout import Floats
from pelorus.wire.settings import describe

# --- two answers to one frame ---------------------------------------------------------------------


POSE_WORDS = {
    "t_ns": "time",
    "p_WB_m": "position",
    "R_WB": "rotation",
    "covariance": "covariance",
    "v_B_mps": "velocity",
    "w_B_radps": "rate",
    "bias": "bias",
    "velocity_covariance": "covariance of velocity and rate",
    "real_bytes": "bytes of a real",
    "reset_count": "reset count",
}
NOT_COMPARED = ("t_ns", "subject", "update_us")  # the key, and the robot's own clock
DIAGONAL = [i * (i + 3) // 2 for i in range(6)]


@dataclass(frozen=True)
class PoseDistance:
    """Distances between two poses."""

    position_m: float = 0.0
    angle_deg: float = 0.0
    covariance: float = 0.0  # largest |dP_ij| over the desk's sigma_i sigma_j


@dataclass(frozen=True)
class Difference:
    """Differences between one frame's answers; if none is listed, all common bits are equal."""

    robot: Frame
    desk: Frame
    pose: list[str] = field(default_factory=list)  # fields of POSE with other bits
    report: dict[str, tuple[float, float]] = field(default_factory=dict)  # name: desk, robot
    missing: str = ""  # what the log lacks of the answer
    sizes: PoseDistance = PoseDistance()

    @property
    def same(self) -> bool:
        return not self.pose and not self.report


def differ(robot: Frame, desk: Frame) -> Difference:
    """Compares bit by bit what both have; an answer is a REPORT, with a POSE if it was accepted."""
    found = Difference(robot, desk)
    if robot.report is not None and desk.report is not None:
        found = replace(found, report=_reports(robot.report, desk.report))
    if robot.pose is not None and desk.pose is not None:
        words, sizes = _poses(robot.pose, desk.pose)
        return replace(found, pose=words, sizes=sizes, missing=_missing(robot, desk))
    if robot.pose is not None:
        found = replace(found, pose=["the desk gives no pose"])
    return replace(found, missing=_missing(robot, desk))


def _missing(robot: Frame, desk: Frame) -> str:
    lacking = [
        name
        for name, ours, theirs in (
            ("POSE", desk.pose, robot.pose),
            ("REPORT", desk.report, robot.report),
        )
        if ours is not None and theirs is None
    ]
    return " and ".join(lacking)


def _reports(robot: Report, desk: Report) -> dict[str, tuple[float, float]]:
    pairs = {
        name: (getattr(desk, name), getattr(robot, name))
        for name in (f.name for f in fields(Report))
        if name not in NOT_COMPARED
    }
    return {name: pair for name, pair in pairs.items() if _bits(pair[0]) != _bits(pair[1])}


def _poses(robot: Pose, desk: Pose) -> tuple[list[str], PoseDistance]:
    if robot == desk:
        return [], PoseDistance()
    words = [
        word
        for name, word in POSE_WORDS.items()
        if _bits(getattr(robot, name)) != _bits(getattr(desk, name))
    ]
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        sizes = PoseDistance(
            _finite(float(np.linalg.norm(robot.p_WB_m - desk.p_WB_m))),
            _finite(_angle_deg(desk.R_WB.T @ robot.R_WB)),
            _finite(_covariance(robot.covariance, desk.covariance)),
        )
    return words or ["its bytes"], sizes


def _bits(value: object) -> bytes:
    return value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()


def _angle_deg(R: Floats) -> float:
    """Returns the angle by the skew part: the trace would amplify float32's rounding."""
    s = np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return float(np.degrees(np.arctan2(s, np.trace(R) - 1)))


def _covariance(robot: Floats, desk: Floats) -> float:
    row, column = np.tril_indices(6)
    sigma = np.sqrt(desk[DIAGONAL])
    scale = sigma[row] * sigma[column]
    change = np.abs(robot - desk)
    return float(np.max(np.where(change > 0, change / scale, 0.0)))


def _finite(size: float) -> float:
    return size if np.isfinite(size) else float("inf")


# --- a log ----------------------------------------------------------------------------------------


FNV_OFFSET, FNV_PRIME = 2166136261, 16777619
WITH_ALL_ROOMS = 3  # PLR_SUPERVISE and PLR_KNOWN_MAP


class BitsVerdict(IntEnum):
    """The exit status."""

    SAME = 0
    DIFFERENT = 1
    NOT_COMPARABLE = 2


@dataclass(eq=False)
class Judgement:
    """The verdict on one part."""

    part: Part
    verdict: BitsVerdict = BitsVerdict.SAME
    why: str = ""
    differences: list[Difference] = field(default_factory=list)  # one for each answered frame
    desk: Config | None = None
    left_out: list[Frame] = field(default_factory=list)  # they probably did not reach the robot

    @property
    def same(self) -> int:
        """Returns the number of frames whose whole answer has the desk's bits."""
        return sum(d.same and not d.missing for d in self.differences)

    @property
    def first(self) -> Difference | None:
        return next((d for d in self.differences if not d.same), None)

    @property
    def loss(self) -> Loss | None:
        """Returns the last loss before or at the first difference."""
        first = self.first
        if first is None:
            return None
        before = [loss for loss in self.part.losses if loss.at <= first.robot.number]
        return max(before, default=None, key=lambda loss: loss.at)


@dataclass(frozen=True)
class Desk:
    """The programs and files for a replay."""

    programs: Programs
    start: str | None = None
    state: Path | None = None  # from which the first part that restored one continues

    def program(self, config: Config) -> Path:
        return self.programs.float64 if config.real_bytes == 8 else self.programs.float32


def judge(log: RobotLog, desk: Desk) -> list[Judgement]:
    """Judges every part by itself; raises PelorusError where not one can be compared."""
    judgements: list[Judgement] = []
    for part in log.parts:
        state = desk.state if not any(j.part.restored for j in judgements) else None
        judgements.append(_judge(part, desk, state))
    if not any(j.differences for j in judgements):
        raise PelorusError(f"{log.path}: {judgements[0].why}")
    return judgements


def verdict_of(judgements: Sequence[Judgement]) -> BitsVerdict:
    """Returns DIFFERENT if any part is, SAME if all are."""
    found = {judgement.verdict for judgement in judgements}
    if BitsVerdict.DIFFERENT in found:
        return BitsVerdict.DIFFERENT
    return BitsVerdict.NOT_COMPARABLE if BitsVerdict.NOT_COMPARABLE in found else BitsVerdict.SAME


def fingerprint(version: str, arithmetic: int, build: Config) -> int:
    """Returns plr_build_fingerprint (src/record/words.c) of a build of that version."""
    major, minor, patch = (int(number) for number in version.split("."))
    capacities = (build.max_landmarks, build.max_observations, build.block_observations)
    value = FNV_OFFSET
    number = major << 16 | minor << 8 | patch
    for part in (number, arithmetic, 8 * build.real_bytes, *capacities, WITH_ALL_ROOMS):
        for byte in part.to_bytes(4, "little"):
            value = (value ^ byte) * FNV_PRIME & 0xFFFFFFFF
    return value or 1


def of_this_version(build: Config) -> bool:
    """Returns whether a build has these tools' version and arithmetic."""
    return build.build_fingerprint == fingerprint(__version__, ARITHMETIC, build)


# --- one part -------------------------------------------------------------------------------------


def _judge(part: Part, desk: Desk, state: Path | None) -> Judgement:
    why = _obstacle(part, state)
    if why or part.config is None:
        return Judgement(part, BitsVerdict.NOT_COMPARABLE, why)
    found = _compared(part, desk, state, [])
    if found.verdict is BitsVerdict.NOT_COMPARABLE:
        return found
    if found.first is not None and part.unanswered:
        without = _compared(part, desk, state, part.unanswered)
        if without.same > found.same:
            found = without
    return _concluded(found)


def _obstacle(part: Part, state: Path | None) -> str:
    """Returns why no replay can be set up; empty if one can."""
    if not any(isinstance(m, Header) for m in part.messages):
        return "no HEADER came after the robot's restart: it had no calibration to work with"
    if all(frame.unread for frame in part.answered):
        return "not one frame was answered: there is nothing to compare"
    if part.config is None:
        return (
            "the log holds no CONFIG of the robot's build: without its settings, capacity and "
            "precision a replay is another filter; the robot tells them with its first answer"
        )
    if part.restored and state is None:
        return (
            "the robot went on from a saved state, which the log does not hold: nothing behind it "
            "can be computed here; with that state in a file of pelorus-replay (--save-state), "
            "give --load-state"
        )
    return ""


def _compared(part: Part, desk: Desk, state: Path | None, left_out: list[Frame]) -> Judgement:
    assert part.config is not None
    options: list[str] = []
    if part.restored:
        options = ["--load-state", str(state)]
    elif desk.start is not None and part.frames[0].number == 1:  # a second life has a START
        options = ["--start", desk.start]
    messages = replayed(desk.program(part.config), part.inputs(left_out), options)
    here = next((m for m in messages if isinstance(m, Config) and m.build_fingerprint), None)
    if here is None:
        return Judgement(part, BitsVerdict.NOT_COMPARABLE, "the replay's filter did not start")
    found = Judgement(part, desk=here, left_out=left_out)
    ours = frames_of(messages)
    absent = {id(frame) for frame in left_out}
    theirs = [f for f in part.frames if not f.unread and id(f) not in absent]
    why = _unlike(part.config, here)
    if not why and [f.stereo.t_ns for f in ours] != [f.stereo.t_ns for f in theirs]:
        why = (
            f"the replay took {len(ours)} of {len(theirs)} frames; it has room for "
            f"{here.max_observations} observations in one"
        )
    if why:
        found.verdict, found.why = BitsVerdict.NOT_COMPARABLE, why
        return found
    pairs = zip(theirs, ours, strict=True)
    found.differences = [differ(robot, mine) for robot, mine in pairs if robot.answered]
    return found


def _unlike(robot: Config, here: Config) -> str:
    """Returns in what the replay is another filter than the robot's; empty if in nothing."""
    if robot.block_observations != here.block_observations:
        return (
            f"the robot's build takes {robot.block_observations} observations a block and the "
            f"desk's {here.block_observations}: build the desk with "
            f"-DPLR_BLOCK_OBSERVATIONS={robot.block_observations}, and name its folder with --bin"
        )
    if robot.real_bytes != here.real_bytes:
        return f"the robot's reals have {robot.real_bytes} bytes, the desk's {here.real_bytes}"
    for id, value in robot.settings.items():
        ours = here.settings.get(id)
        if ours != value:
            name, theirs = describe(id, value)
            mine = "no such setting" if ours is None else describe(id, ours)[1]
            return (
                f"the robot's {name} is {theirs}, the desk's {mine}: a build of the robot's "
                "version, with its capacity, is needed (--bin)"
            )
    return ""


def _concluded(found: Judgement) -> Judgement:
    """Returns the verdict; after a loss, other bits are no fault of the robot."""
    first, loss = found.first, found.loss
    if first is not None and loss is not None:
        found.verdict = BitsVerdict.NOT_COMPARABLE
        where = "somewhere" if loss.at == NOWHERE else f"from frame {loss.at} on"
        found.why = (
            f"{where} the robot may have had other inputs than the log holds ({loss.words}); "
            "what comes behind cannot be compared"
        )
    elif first is not None:
        found.verdict = BitsVerdict.DIFFERENT
    elif lacking := _lacking(found):
        found.verdict = BitsVerdict.NOT_COMPARABLE
        found.why = f"the log does not hold {lacking}; what it holds has the same bits"
    return found


def _lacking(found: Judgement) -> str:
    absent = {id(frame) for frame in found.left_out}
    whole = [
        f"the answer to frame {f.number}" for f in found.part.unanswered if id(f) not in absent
    ]
    halves = [f"the {d.missing} of frame {d.robot.number}" for d in found.differences if d.missing]
    lacking = whole + halves
    more = f" and {len(lacking) - 3} more" if len(lacking) > 3 else ""
    return ", ".join(lacking[:3]) + more


# --- as JSON --------------------------------------------------------------------------------------


def comparison_json(log: RobotLog, judgements: Sequence[Judgement]) -> dict[str, Any]:
    """Returns all that `compare` reports; a part is one life of the robot."""
    return {
        "log": str(log.path),
        "verdict": verdict_of(judgements).name.lower(),
        "frames": sum(len(one.part.frames) for one in judgements),
        "same": sum(one.same for one in judgements),
        "remarks": log.remarks,
        "parts": [_part(one) for one in judgements],
    }


def _part(found: Judgement) -> dict[str, Any]:
    part = found.part
    differences = [asdict(one.sizes) for one in found.differences]
    return {
        "verdict": found.verdict.name.lower(),
        "why": found.why or None,
        "first_frame": part.frames[0].number,
        "last_frame": part.frames[-1].number,
        "answered": len(part.answered),
        "same": found.same,
        "refused": sum(frame.unread for frame in part.frames),
        "left_out": [frame.number for frame in found.left_out],
        "losses": [
            {"frame": None if loss.at == NOWHERE else loss.at, "what": loss.words}
            for loss in part.losses
        ],
        "robot": _build(part.config),
        "desk": _build(found.desk),
        "first": None if found.first is None else _difference(found.first),
        "largest": {name: max(sizes[name] for sizes in differences) for name in differences[0]}
        if differences
        else None,
    }


def _build(build: Config | None) -> dict[str, Any] | None:
    if build is None:
        return None
    return {
        "fingerprint": build.build_fingerprint,
        "this_version": of_this_version(build),
        "landmarks": build.max_landmarks,
        "observations": build.max_observations,
        "real_bytes": build.real_bytes,
    }


def _difference(found: Difference) -> dict[str, Any]:
    robot = found.robot
    return {
        "frame": robot.number,
        "t_ns": robot.stereo.t_ns,
        "pose": found.pose,
        "report": {
            name: {"desk": desk, "robot": own} for name, (desk, own) in found.report.items()
        },
        "sizes": asdict(found.sizes),
        "said": robot.words,
    }
