# SPDX-License-Identifier: MIT
"""Collects a log's incidents in episodes: first cause, consequences, what was seen before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pelorus.evaluate.health import LOST, Spell, TimeLine, time_line
from pelorus.explain.contradiction import contradictions
from pelorus.explain.inputs import of_inputs, of_small, rejected
from pelorus.explain.log import FEW, Cause, FilterLog, Flags, Incident, S, log_of
from pelorus.explain.setup import GATED_MOST, gated_share, of_setup, refusals
from pelorus.math.motion import runs
from pelorus.wire import schema
from pelorus.wire.frames import Kind, Message, Text

if TYPE_CHECKING:
    from pelorus.check.verdict import Verdict

NOT_POSITIVE = schema.number("reason", "NOT_POSITIVE")

APART_NS = S  # what begins this long after the end of another is an episode of its own
TOGETHER_NS = S  # of events within a second the one that causes the others comes first
BEFORE_NS = S  # figures are given for the last second before
LINES = 20
LASTS_S = 0.05  # anything shorter is called a moment
EPISODES_TOLD = 4
SPELLS_TOLD = 3
TEXTS_TOLD = 3


@dataclass(frozen=True)
class Episode:
    """An episode: `first` is its cause, `others` its consequences, `spells` the health."""

    first: Incident
    others: tuple[Incident, ...]
    spells: tuple[Spell, ...]
    before: str

    @property
    def from_ns(self) -> int:
        return self.first.from_ns

    @property
    def to_ns(self) -> int:
        """Returns when its last finding ends and health is good again."""
        ends = [f.to_ns for f in (self.first, *self.others)] + [s.to_ns for s in self.spells]
        return max(ends)


@dataclass(frozen=True)
class Explanation:
    """What was found in a whole log."""

    origin_ns: int
    end_ns: int
    episodes: tuple[Episode, ...]
    setup: tuple[str, ...]
    health: TimeLine
    remarks: tuple[str, ...] = ()  # what the log lacks
    unexplained: tuple[Spell, ...] = ()  # spells of bad health that no finding explains
    messages: Sequence[Message] = field(default=(), repr=False, compare=False)

    @cached_property
    def verdict(self) -> Verdict:
        """Returns the verdict on the run, as in every command."""
        from pelorus.check.verdict import verdict_of_log  # noqa: PLC0415 - it takes seconds

        return verdict_of_log(self.messages)

    @property
    def diverged(self) -> int:
        """Returns the number of episodes that are divergences."""
        return sum(episode.first.cause is Cause.DIVERGED for episode in self.episodes)

    @property
    def first(self) -> Incident | None:
        """Returns the first cause of the first episode, else what is wrong throughout."""
        if self.episodes:
            return self.episodes[0].first
        if self.setup:
            return Incident(Cause.SETTINGS, self.origin_ns, self.end_ns, self.setup[0])
        return None

    def seconds(self, t_ns: int) -> float:
        """Returns the time since the first frame, s."""
        return (t_ns - self.origin_ns) / S

    def lines(self) -> list[str]:
        """Returns at most twenty lines, without the verdict."""
        out = list(self._head())
        out += [f"log: {words}" for words in self.remarks]
        out += [f"setup: {words}" for words in self.setup]
        out += self._unexplained()
        told = self._most_telling()
        room = (LINES - 1 - len(out)) // max(len(told), 1)
        for number, episode in told:
            out += self._episode(number, episode, room)
        hidden = len(self.episodes) - EPISODES_TOLD
        if hidden > 0:
            out.append(f"{hidden} more: --json has all of them")
        return out[:LINES]

    def _most_telling(self) -> list[tuple[int, Episode]]:
        """Returns the most important episodes with their numbers, divergences first."""
        numbered = list(enumerate(self.episodes, 1))
        worst = sorted(numbered, key=lambda one: one[1].first.cause is not Cause.DIVERGED)
        return sorted(worst[:EPISODES_TOLD], key=lambda one: one[0])

    def _head(self) -> Iterator[str]:
        count = len(self.episodes)
        what = "no event" if not count else "one event" if count == 1 else f"{count} events"
        whole, along = self.seconds(self.end_ns), ""
        if not count and self.setup:
            along = ", but something is wrong all along"
        if count == 1:
            what += f" ({self.episodes[0].first.cause})"
        elif self.diverged:
            what += f", {self.diverged} of them {Cause.DIVERGED}"
        yield f"{what} in {whole:.1f} s{along}; health: {self.health.summary()}"

    def _unexplained(self) -> Iterator[str]:
        for spell in self.unexplained[:SPELLS_TOLD]:
            yield f"not explained: {spell.words(self.origin_ns)}"
        if len(self.unexplained) > SPELLS_TOLD:
            yield f"not explained: {len(self.unexplained) - SPELLS_TOLD} times more"

    def _episode(self, number: int, episode: Episode, room: int) -> list[str]:
        span = f"{self.seconds(episode.from_ns):.2f} to {self.seconds(episode.to_ns):.2f} s"
        head, *lines = self.told_of(episode)
        return [f"{number}. {span}: {head}", *(f"   {words}" for words in lines)][: max(room, 2)]

    def told_of(self, episode: Episode) -> list[str]:
        """Returns an episode's lines: first cause, what was seen before, advice, consequences."""
        first = episode.first
        then = [(f.from_ns, self._follows(f, first)) for f in episode.others]
        then += [(s.from_ns, s.words(self.origin_ns)) for s in episode.spells]
        return [
            f"{first.cause}{self._lasting(first)}: {first.words}",
            f"before: {episode.before}",
            f"what to do: {first.remedy}",
            *(words for _, words in sorted(then)),
        ]

    def _follows(self, one: Incident, first: Incident) -> str:
        by_it = one.rank > first.rank and one.from_ns <= first.to_ns + TOGETHER_NS
        why = ", probably by it" if by_it else ""
        return f"{self.seconds(one.from_ns):.2f} s{why}: {one.cause}: {one.words}"

    def _lasting(self, found: Incident) -> str:
        """Returns how long it lasted, in words; empty if it was a moment."""
        seconds = self.seconds(found.to_ns) - self.seconds(found.from_ns)
        return f", {seconds:.1f} s long" if seconds >= LASTS_S else ""

    def json(self) -> dict[str, Any]:
        """Returns the result as JSON, with times in s since the first frame, and in ns."""
        return {
            "happened": bool(self.episodes),
            "first_cause": None if self.first is None else self._finding(self.first),
            "episodes": [
                {
                    "from_s": self.seconds(e.from_ns),
                    "to_s": self.seconds(e.to_ns),
                    "first": self._finding(e.first),
                    "before": e.before,
                    "then": [self._finding(f) for f in e.others],
                    "health": [s.words(self.origin_ns) for s in e.spells],
                }
                for e in self.episodes
            ],
            "setup": list(self.setup),
            "remarks": list(self.remarks),
            "not_explained": [spell.words(self.origin_ns) for spell in self.unexplained],
            "health": self.health.by_health,
            "origin_ns": self.origin_ns,
            "duration_s": self.seconds(self.end_ns),
        }

    def _finding(self, found: Incident) -> dict[str, Any]:
        return {
            "cause": found.cause,
            "from_s": self.seconds(found.from_ns),
            "to_s": self.seconds(found.to_ns),
            "from_ns": found.from_ns,
            "words": found.words,
            "what_to_do": found.remedy,
        }


def explain(messages: Sequence[Message]) -> Explanation:
    """Explains a log; raises PelorusError where no filter answered."""
    log = log_of(messages)
    health = time_line(messages)
    assert health is not None  # log_of refuses a log without answers
    inputs = list(of_inputs(log))
    odd = (*of_small(log, messages), *(_behind(one, inputs) for one in contradictions(log)))
    found = sorted((*inputs, *odd), key=_order)
    begin = found[0].from_ns if found else None
    calm = _calm(log, begin)
    setup = tuple(of_setup(log, calm))
    if gated_share(log, calm) <= GATED_MOST:
        found += [one for one in rejected(log) if not _near(one, found)]
    if not setup:  # with wrong sigmas a filter is lost now and then without an event
        found += list(_unexplained(log, health, found))
    groups = [*_grouped(sorted(found, key=_order)), *_grouped(list(divergences(log)))]
    groups.sort(key=lambda group: _order(group[0]))
    episodes = tuple(_episode(log, group, health) for group in groups)
    end_ns = int(log.t_ns.max())
    told = {spell for episode in episodes for spell in episode.spells}
    rest = () if setup else tuple(spell for spell in health.spells if spell not in told)
    refused = refusals(log)
    remarks = (*([] if refused in ("", *setup) else [refused]), *_remarks(log, messages))
    return Explanation(log.origin_ns, end_ns, episodes, setup, health, remarks, rest, messages)


def _remarks(log: FilterLog, messages: Sequence[Message]) -> Iterator[str]:
    if not any(log.evidence):
        yield (
            "it holds no EVIDENCE, so it is not known what the supervisor saw: it comes from an "
            "older pelorus-replay, or from a robot that is not asked for it"
        )
    if not any(m.kind == Kind.END for m in messages):
        yield "it has no END: it was cut short, and what came later is not told"
    if not len(log.readings):
        yield "it holds no twists and no readings of an IMU: pictures are compared with nothing"

    texts = [m.text for m in messages if isinstance(m, Text)]
    yield from (f"the recording says: {words}" for words in texts[:TEXTS_TOLD])
    if len(texts) > TEXTS_TOLD:
        yield f"and {len(texts) - TEXTS_TOLD} remarks more: pelorus info"


def divergences(log: FilterLog) -> Iterator[Incident]:
    """Yields frames after which a variance was not positive: the arithmetic failed."""
    for first, last in runs(log.said(NOT_POSITIVE)):
        count = last - first + 1
        words = f"a variance ceased to be positive in {count} frame{'s' * (count > 1)}; the filter "
        words += "went on from its pose and dropped its landmarks"
        yield log.incident(Cause.DIVERGED, first, last, words)


def _behind(found: Incident, inputs: Sequence[Incident]) -> Incident:
    """Returns the finding; if the filter noticed it when an input failed, it begins there."""
    if found.noticed_ns is None:
        return found
    near = [f for f in inputs if abs(f.from_ns - found.noticed_ns) <= TOGETHER_NS]
    begin = max((f.from_ns for f in near), default=found.from_ns)
    return found._replace(from_ns=max(begin, found.from_ns))


def _order(found: Incident) -> tuple[int, int]:
    return found.from_ns, found.rank


def _calm(log: FilterLog, begin_ns: int | None) -> Flags:
    """Returns the frames before the first event; all where they are few or there is no event."""
    if begin_ns is None:
        return np.ones(len(log.t_ns), bool)
    return np.asarray(log.t_ns < begin_ns)


def _unexplained(log: FilterLog, health: TimeLine, found: Sequence[Incident]) -> Iterator[Incident]:
    """Yields spells where the filter was lost and no finding explains it."""
    for spell in health.spells:
        if spell.health < LOST or _near(spell, (*found, *divergences(log))):
            continue
        meanwhile = (log.t_ns >= spell.from_ns) & (log.t_ns <= spell.to_ns)
        seen = log.column("observations")[meanwhile]
        if len(seen) and np.median(seen) < FEW:
            words = f"{np.median(seen):.0f} points in sight: darkness, or nothing to see"
            yield Incident(Cause.LOST_TRACKS, spell.from_ns, spell.to_ns, words)
        else:
            words = f"the filter was lost: {', '.join(spell.why)}"
            yield Incident(Cause.LOST, spell.from_ns, spell.to_ns, words)


def _near(one: Incident | Spell, found: Sequence[Incident]) -> bool:
    return any(
        f.from_ns - APART_NS <= one.to_ns and one.from_ns <= f.to_ns + APART_NS for f in found
    )


def _grouped(found: Sequence[Incident]) -> list[list[Incident]]:
    groups: list[list[Incident]] = []
    end = 0
    for one in found:
        if groups and one.from_ns <= end + APART_NS:
            groups[-1].append(one)
            end = max(end, one.to_ns)
        else:
            groups.append([one])
            end = one.to_ns
    return groups


def _episode(log: FilterLog, group: Sequence[Incident], health: TimeLine) -> Episode:
    begin = group[0].from_ns
    together = [f for f in group if f.from_ns <= begin + TOGETHER_NS]
    first = min(together, key=lambda f: (f.rank, f.from_ns))
    others = tuple(f for f in group if f is not first)
    end = max(f.to_ns for f in group)
    spells = tuple(
        s for s in health.spells if s.from_ns <= end + APART_NS and s.to_ns >= begin - TOGETHER_NS
    )
    return Episode(first, others, spells, _before(log, first.from_ns))


def _before(log: FilterLog, t_ns: int) -> str:
    """Returns figures of the last second before it."""
    rows = (log.arrived_ns < t_ns) & (log.arrived_ns >= t_ns - BEFORE_NS)
    if not rows.any():
        return "it began with it"
    matched, used = (log.column(name)[rows] for name in ("matched", "used"))
    dof = log.column("nis_dof")[rows].sum()
    nis = sum(r.nis for r, row in zip(log.reports, rows, strict=True) if row)
    health = int(log.column("health")[rows].max())
    words = f"health {schema.HEALTHS[health]}, {np.median(matched):.0f} points matched and "
    words += f"{np.median(used):.0f} used a frame"
    return words + (f", NIS {nis / dof:.2f} (1 is expected)" if dof else "")
