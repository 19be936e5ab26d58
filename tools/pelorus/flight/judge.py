# SPDX-License-Identifier: MIT
"""Replays the parts of a log and judges each: the same bits, different, or not to be compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path

from pelorus import ARITHMETIC, __version__
from pelorus.errors import PelorusError
from pelorus.flight.difference import Difference, differ
from pelorus.flight.log import NOWHERE, Frame, Loss, Part, RobotLog, frames_of
from pelorus.native.replay import Programs, replayed
from pelorus.wire.frames import Config, Header
from pelorus.wire.settings import describe

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
