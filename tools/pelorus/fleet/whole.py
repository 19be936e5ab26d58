# SPDX-License-Identifier: MIT
"""Reads a log in pieces, and adds up what they tell.

So one of ten hours needs no more memory than one of minutes: explaining a log takes some 20 bytes
of memory for each of its own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pelorus.check.verdict import Grade, Verdict, judged_log
from pelorus.evaluate.evaluation import judge, path_m
from pelorus.explain import Explanation, explain
from pelorus.explain.log import Cause, Incident
from pelorus.fleet.table import finite
from pelorus.io.trajectory import Trajectory, estimate_in, truth_in
from pelorus.math.consistency import Figures
from pelorus.math.se3 import Poses
from pelorus.wire.frames import (
    Config,
    Header,
    Kind,
    Landmark,
    Message,
    Pose,
    Report,
    Role,
    Stereo,
    Truth,
)
from pelorus.wire.framing import Counts, end_of, frames_in, without_header

PIECE_BYTES = 16 << 20  # of frames on the wire: ten minutes of 60 points at 10 Hz, with the answers


def in_pieces(path: Path, counts: Counts, piece_bytes: int) -> Iterator[list[Message]]:
    """Yields the messages, at least one piece; each ends before a frame and has its own END.

    What holds for all of it stands ahead of each piece: header, settings, known landmarks.
    """
    ahead: list[Message] = []
    piece: list[Message] = []
    begun = 0
    for frame in frames_in(path, counts):
        message = frame.message
        if isinstance(message, Stereo) and frame.offset - begun >= piece_bytes:
            yield [*piece, end_of(Counter(m.kind for m in piece))]
            piece, begun = list(ahead), frame.offset
        if _holds_for_all(message):
            ahead.append(message)
        piece.append(message)
    if not any(isinstance(message, Header) for message in ahead):
        raise without_header(path)
    yield piece


def _holds_for_all(message: Message) -> bool:
    is_known = isinstance(message, Landmark) and message.role == Role.KNOWN
    return is_known or isinstance(message, Header | Config)


def holds_answers(piece: list[Message]) -> bool:
    """Returns whether a filter has answered to the frames: it is a log, not a recording alone."""
    return any(isinstance(m, Pose) and m.after_stereo for m in piece)


POSES_MOST = 40_000  # of a long log: with more, every second one is left out, and again
EVALUATED = (
    *("truth_frames", "err0_m", "ate_m", "rot_deg", "nees_per_dof"),
    *("map_landmarks", "map_rms_m", "map_nees_per_dof"),
)


@dataclass(frozen=True)
class Part:
    """What is kept of a piece: no message."""

    verdict: Verdict
    faults: list[str]
    grave: list[str]  # those of the faults that spoil the result
    found: Explanation
    frames: int
    good: int
    sums: dict[str, float]

    @classmethod
    def of(cls, messages: Sequence[Message]) -> Part:
        found = explain(messages)
        run, known, verdict = judged_log(messages)
        names = ("gated", "matched", "innovation_d2", "innovation_rows")
        sums = {name: float(run.frames[name].sum()) for name in names}
        faults = [fault.name for fault in known.faults]
        grave = [fault.name for fault in known.faults if fault.grave]
        good = round(run.good_share * run.health.frames)
        return cls(
            verdict, faults, grave, replace(found, messages=()), run.health.frames, good, sums
        )


@dataclass
class Course:
    """The path of a long log beside the truth, thinned out so that it stays small."""

    ahead: list[Message] = field(default_factory=list)
    poses: list[Message] = field(default_factory=list)
    made: list[Message] = field(default_factory=list)  # landmarks whose place is known
    truths: list[Trajectory] = field(default_factory=list)
    path_m: float = 0.0
    _known: set[int] = field(default_factory=set)
    _stride: int = 1
    _seen: int = 0
    _last: Poses | None = None

    def add(self, messages: Sequence[Message]) -> None:
        """Adds a piece."""
        if not self.ahead:
            self.ahead = [m for m in messages if isinstance(m, Header | Config) or _is_known(m)]
            self._known = {m.id for m in self.ahead if isinstance(m, Landmark)}
        for m in messages:
            if isinstance(m, Pose) and m.after_stereo:
                if self._seen % self._stride == 0:
                    self.poses.append(m)
                self._seen += 1
            elif isinstance(m, Landmark) and not _is_known(m) and m.id in self._known:
                self.made.append(m)
        while len(self.poses) > POSES_MOST:
            self.poses, self._stride = self.poses[::2], 2 * self._stride
        # Of all times: that of a piece's first frame stands before it, in the piece before.
        if (truth := truth_in([m for m in messages if isinstance(m, Truth)])) is not None:
            self.truths.append(truth)
        if (estimate := estimate_in(messages)) is not None:
            poses = estimate[0].poses
            self.path_m += path_m(poses)
            if self._last is not None:
                self.path_m += float(np.linalg.norm(poses.p[0] - self._last.p))
            self._last = poses.at(-1)

    def figures(self) -> Figures:
        """Returns the figures of the whole path."""
        return judge([*self.ahead, *self.poses, *self.made], self._truth())

    def _truth(self) -> Trajectory | None:
        if not self.truths:
            return None
        t_ns, first = np.unique(np.concatenate([x.t_ns for x in self.truths]), return_index=True)
        R = np.concatenate([x.poses.R for x in self.truths])[first]
        p = np.concatenate([x.poses.p for x in self.truths])[first]
        return Trajectory(t_ns, Poses(R, p))


def _is_known(message: Message) -> bool:
    return isinstance(message, Landmark) and message.role == Role.KNOWN


def is_answered(messages: Sequence[Message]) -> bool:
    """Returns whether a filter reported on a frame of this piece."""
    return any(isinstance(m, Report) and m.subject == Kind.STEREO for m in messages)


def columns_of(parts: Sequence[Part]) -> dict[str, Any]:
    """Returns the columns of `explain`; the verdict on a long log is that on its worst piece."""
    worst = max(parts, key=lambda part: part.verdict.grade)  # the first of equal ones
    origin_ns, end_ns = parts[0].found.origin_ns, parts[-1].found.end_ns
    total = {name: sum(part.sums[name] for part in parts) for name in parts[0].sums}
    frames = sum(part.frames for part in parts)
    first = next((p.found.episodes[0].first for p in parts if p.found.episodes), None)
    return {
        "grade": worst.verdict.mark,
        "verdict": worst.verdict.words,
        "cause": _cause(parts, worst, first),
        "why": worst.verdict.doubts,
        "what_to_set": [f"{name} = {value}" for name, value in worst.verdict.settings.items()],
        "faults": _once(part.faults for part in parts),
        "setup": _once(part.found.setup for part in parts),
        "remarks": _once(part.found.remarks for part in parts),
        "events": sum(len(part.found.episodes) for part in parts),
        "diverged": sum(part.found.diverged for part in parts),
        "first_cause": None if first is None else str(first.cause),
        "first_s": None if first is None else (first.from_ns - origin_ns) * 1e-9,
        "first_words": None if first is None else first.words,
        "what_to_do": _remedy(parts, worst, first),
        "duration_s": (end_ns - origin_ns) * 1e-9,
        "frames": frames,
        "good_share": sum(part.good for part in parts) / max(frames, 1),
        "nis": _ratio(total["innovation_d2"], total["innovation_rows"]),
        "gated_share": _ratio(total["gated"], total["matched"]),
        "pieces": len(parts),
    }


def _cause(parts: Sequence[Part], worst: Part, first: Incident | None) -> str | None:
    """Returns the fault that spoils the result, else the first event, else what lasts."""
    grave = _once(part.grave for part in parts)
    if grave:
        return grave[0]
    if first is not None:
        return str(first.cause)
    if any(part.found.setup for part in parts):
        return str(Cause.SETTINGS)
    if worst.faults:
        return worst.faults[0]
    return None if worst.verdict.grade is Grade.GOOD else "doubtful"


def _remedy(parts: Sequence[Part], worst: Part, first: Incident | None) -> str | None:
    if first is not None and not any(part.grave for part in parts):
        return first.remedy
    return "; ".join(worst.verdict.to_set) or None


def _once(lists: Any) -> list[str]:
    """Returns what the lists hold, each once."""
    return list(dict.fromkeys(one for found in lists for one in found))


def _ratio(part: float, whole: float) -> float | None:
    return finite(part / whole) if whole else None
