# SPDX-License-Identifier: MIT
"""Health as a time line: from when to when the filter was not good, and why, in words.

A result holds a REPORT for each frame. Frames in a row with the same health are a spell; spells of
the same health with less than a second between them are one, for a filter that says DEGRADED in
every third frame is degraded all the time. Where no frame came there is no REPORT either: a pause
of more than a second is a spell of its own. Frames before an IMU's start are none of it: nothing is
lost before it is known. A filter that never starts is LOST all the time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from pelorus.wire import schema
from pelorus.wire.frames import Kind, Message, Report

PAUSE_NS = 1_000_000_000  # after which the filter itself reports NO_FRAMES
NO_FRAMES = "no frames came"

SHORT = {
    "FEW_OBSERVATIONS": "fewer than 3 points used",
    "NO_OBSERVATIONS": "no point used for long",
    "GATE_LOCKED": "nearly all matches rejected, landmarks dropped",
    "BLOCK_FAILED": "an update could not be computed",
    "SINK_FAILED": "the map sink refused landmarks",
    "REFUSED_INPUT": "observations malformed, or an id twice in a frame",
    "NIS_HIGH": "innovations larger than the noise explains",
    "RANGE_LIMITED": "a landmark's correction was limited",
    "NOT_POSITIVE": "a variance ceased to be positive",
    "BUDGET": "no time for all observations",
    "TWIST_CONTRADICTED": "pictures contradict twists or IMU",
    "POSE_MAY_BE_WRONG": "the pose may be wrong",
    "BIAS_OFF_PRIOR": "a bias is far from its prior",
    "FROZEN_IMAGE": "identical pixels",
    "NOISE_MISFIT": "pictures and odometry differ by more than their sigmas, all along",
    "CALIBRATION_OFF": "a part of the calibration was refused: it would have moved too far",
    "RECOVERED": "landmarks dropped and covariance widened",
    "NO_FRAMES": NO_FRAMES,
    "STATE_DAMAGED": "the filter's memory was changed",
    "NO_TWISTS": "twists or IMU readings missing, refused or too old",
    "READINGS_REJECTED": "readings of a small sensor rejected or off",
    "RELOCATED": "the pose was found anew from known landmarks",
    "MAP_DISAGREES": "known landmarks and the pose disagree",
}
# Symptoms, which come after their causes where these are known, too.
SYMPTOMS = tuple(
    SHORT[name] for name in ("POSE_MAY_BE_WRONG", "FEW_OBSERVATIONS", "NO_OBSERVATIONS")
)
NOT_STARTED = schema.number("reason", "NOT_STARTED")
GOOD, DEGRADED, LOST = (schema.number("health", name) for name in ("GOOD", "DEGRADED", "LOST"))
HARMLESS = schema.LIMITS["harmless_reasons"]  # they do not affect the estimate's quality


@dataclass(frozen=True)
class Spell:
    """A spell from the first frame that is not good to the last.

    `why` has causes before symptoms, each by frequency; `counts` is the number of frames for each
    of them.
    """

    health: int
    from_ns: int
    to_ns: int
    frames: int
    why: tuple[str, ...]
    counts: tuple[int, ...] = ()

    def words(self, origin_ns: int) -> str:
        """Returns `lost from 37.0 to 40.1 s (31 frames): identical pixels`."""
        start, end = (f"{(t - origin_ns) * 1e-9:.1f}" for t in (self.from_ns, self.to_ns))
        when = f"at {start} s" if start == end else f"from {start} to {end} s"
        frames = f" ({self.frames} frame{'s' if self.frames > 1 else ''})" if self.frames else ""
        return f"{schema.HEALTHS[self.health]} {when}{frames}: {self.reasons}"

    @property
    def reasons(self) -> str:
        """Returns `identical pixels, no point used for long (2 of them)`."""
        counts = self.counts or (self.frames,) * len(self.why)
        some = (f" ({count} of them)" if count < self.frames else "" for count in counts)
        return ", ".join(map("".join, zip(self.why, some, strict=True)))


@dataclass(frozen=True)
class TimeLine:
    """All spells in the order of time, and the number of frames by health, since the start."""

    frames: int
    by_health: dict[str, int]
    spells: tuple[Spell, ...]
    before_start: int = 0  # frames that are not in the counts

    def summary(self) -> str:
        """Returns `good in 380 of 410 frames, lost in 30`."""
        good = self.by_health.get(schema.HEALTHS[GOOD], 0)
        others = [
            f"{name} in {count}"
            for name, count in self.by_health.items()
            if count and name != schema.HEALTHS[GOOD]
        ]
        waited = self.before_start
        start = f", after {waited} frames before the start" if waited else ""
        return ", ".join((f"good in {good} of {self.frames} frames", *others)) + start

    def lines(self, origin_ns: int) -> list[str]:
        """Returns the summary, and each spell."""
        return [self.summary(), *(spell.words(origin_ns) for spell in self.spells)]


def time_line(messages: Iterable[Message]) -> TimeLine | None:
    """Returns the time line of a filter's result; None where there is no answer to a frame."""
    answers = [m for m in messages if isinstance(m, Report) and m.subject == Kind.STEREO]
    if not answers:
        return None
    waited = next((k for k, a in enumerate(answers) if not a.reasons & NOT_STARTED), 0)
    answers = answers[waited:]
    counts = Counter(answer.health for answer in answers)
    by_health = {words: counts[number] for number, words in schema.HEALTHS.items()}
    told = answers[1:] if _why(answers[0]) == (SHORT["FEW_OBSERVATIONS"],) else answers
    spells = sorted(  # the first frame makes landmarks, and uses none yet
        (*_of_frames(told), *_pauses(answers)), key=lambda spell: (spell.from_ns, spell.to_ns)
    )
    return TimeLine(len(answers), by_health, tuple(spells), waited)


def reasons(bits: int) -> tuple[str, ...]:
    """Returns the reasons in a mask, in words, without harmless ones; unknown ones by number."""
    found = []
    for k in range(bits.bit_length()):
        if bits & ~HARMLESS & 1 << k:
            name = schema.REASON_NAMES.get(1 << k, "")
            found.append(SHORT.get(name) or schema.REASONS.get(1 << k, f"reason {k}"))
    return tuple(found)


def _why(answer: Report) -> tuple[str, ...]:
    if answer.status == 0:
        return reasons(answer.reasons)
    # it has the reasons of the frame before
    words = schema.STATUSES.get(answer.status, f"status {answer.status}")
    return (f"frame refused, {words.partition(':')[0].partition(';')[0]}",)


def _of_frames(answers: Sequence[Report]) -> Iterator[Spell]:
    """Yields spells by health, so that a moment of LOST shows in a long DEGRADED."""
    for health in sorted(set(schema.HEALTHS) - {GOOD}):
        why: Counter[str] = Counter()
        open_: Spell | None = None
        for answer in (answer for answer in answers if answer.health == health):
            if open_ is not None and answer.t_ns - open_.to_ns > PAUSE_NS:
                yield _closed(open_, why)
                open_, why = None, Counter()
            why.update(_why(answer))
            first = answer.t_ns if open_ is None else open_.from_ns
            frames = 1 if open_ is None else open_.frames + 1
            open_ = Spell(health, first, max(answer.t_ns, first), frames, ())
        if open_ is not None:
            yield _closed(open_, why)


def _closed(spell: Spell, why: Counter[str]) -> Spell:
    told = why.most_common() or [("no reason given", spell.frames)]
    told.sort(key=lambda reason: reason[0] in SYMPTOMS)
    return replace(spell, why=tuple(words for words, _ in told), counts=tuple(n for _, n in told))


def _pauses(answers: Sequence[Report]) -> Iterator[Spell]:
    times = [answer.t_ns for answer in answers if answer.status == 0]
    for before, after in pairwise(times):
        if after - before > PAUSE_NS:
            yield Spell(LOST, before, after, 0, (NO_FRAMES,))
