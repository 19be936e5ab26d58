# SPDX-License-Identifier: MIT
"""Events put into recordings: how often `pelorus explain` names the first cause and its time, and
says of recordings without one that nothing happened.

usage: explain.py [--bin build/bin] [--only TEXT] [--seeds 2] [--first-seed 1] [--event NAME]

Twenty recordings and more: simulated drives by twists and by IMU, and windows of real ones from
$PELORUS_DATA. Into each one every event is put that fits it, at a time drawn where the robot moves.
Right is the first cause of the first episode, and its time within a second. A clean drive is one
in which the filter itself is GOOD in 95 of 100 frames; others have troubles of their own.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from injected_events import EVENTS, Event, Messages, S, moving
from judge import DATA, cases, converted, parser_of, run
from pelorus.evaluate.health import GOOD
from pelorus.explain import Explanation, explain
from pelorus.explain.log import Cause, Incident
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire import schema
from pelorus.wire.frames import Kind, Process, Stereo
from pelorus.wire.framing import header_of_messages, messages_of, write_file

WINDOW_S = 60.0
WITHIN_S = 1.0
CLEAN, TROUBLED = "clean", "not good alone"  # drives without an event, by the filter's own health
GOOD_LEAST = 0.95  # of the frames of a clean one


class Drive(NamedTuple):
    """A recording, and the options of its replay; simulated ones end in their seed."""

    name: str
    messages: Messages
    options: tuple[str, ...]


def simulated(seeds: range) -> Iterator[Drive]:
    """Drives that differ in speed, rate and scene."""
    for seed in seeds:
        for name, options in (
            ("plain", Options(seed=seed)),
            ("slow", Options(seed=seed, speed_mps=1.0, lap_s=30)),
            ("fast", Options(seed=seed, speed_mps=8.0, range_m=60, velocity_sigma_mps=0.1)),
            ("20 Hz", Options(seed=seed, frame_rate_hz=20, observations=100)),
            ("imu", Options(seed=seed, imu=SimulatedImu(imu_rate_hz=200))),
            ("imu fast", Options(seed=seed, speed_mps=5.0, imu=SimulatedImu(imu_rate_hz=400))),
        ):
            messages = list(simulate(options).recording.messages())
            yield Drive(f"{name} {seed}", messages, ())


def real(cache: Path) -> Iterator[Drive]:
    """Yields real drives with their settings; of the longer ones the first minutes."""
    for case in cases():
        fits = "default" not in case.name and "starry" not in case.name  # that one is dark at times
        if (DATA / case.file).exists() and fits:
            messages = messages_of(converted(case, cache))
            yield Drive(case.name, _first(messages, WINDOW_S), case.options)


def _first(messages: Messages, length_s: float) -> Messages:
    begin = next(m.t_ns for m in messages if isinstance(m, Stereo))
    end = begin + round(length_s * S)
    return [m for m in messages if getattr(m, "t_ns", 0) <= end and m.kind != Kind.END]


def explained(program: Path, messages: Messages, options: Sequence[str]) -> Explanation:
    """Explains a replay."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "in.plr"
        write_file(path, [m for m in messages if m.kind != Kind.END], len(messages))
        return explain(run(program, path, options))


class Tried(NamedTuple):
    """One event in one drive."""

    event: str
    drive: str
    right: bool
    words: str


def tried(program: Path, drive: Drive, event: Event, own: Explanation) -> Tried | None:
    """Tries an event in a drive; None where it does not fit.

    `own` is the drive's explanation without it: findings of a real drive itself do not count.
    """
    if not _fits(event, drive, own):
        return None
    chance = np.random.default_rng(zlib.crc32(f"{drive.name} {event.name}".encode()))
    times = list(moving(drive.messages))
    if not times:
        return None
    t = int(chance.choice(times))
    given = event.settings[chance.integers(len(event.settings))] if event.settings else ()
    changed = event.into(drive.messages, t, chance)
    if changed is None:
        return None
    found = explained(program, changed, (*drive.options, *given))
    when = f"{(t - found.origin_ns) / S:.1f} s {' '.join(given)}"
    if event.whole:
        words = f"{when}: {found.first.words if found.first else 'nothing was told'}"
        return Tried(event.name, drive.name, bool(found.setup) and not found.episodes, words)
    known = [(e.first.cause, e.from_ns) for e in own.episodes]
    told = [e.first for e in found.episodes if not _is_known(e.first, known)]
    if not told:
        return Tried(event.name, drive.name, False, f"{when}: nothing was told")
    off_s = (told[0].from_ns - t) / S
    right = told[0].cause in event.causes and abs(off_s) <= WITHIN_S
    words = f"{when}: {told[0].cause} {off_s:+.2f} s: {told[0].words}"
    return Tried(event.name, drive.name, right, words)


def _fits(event: Event, drive: Drive, own: Explanation) -> bool:
    by_imu = header_of_messages(drive.messages).process is Process.IMU
    if event.whole and own.setup:  # its own settings do not fit
        return False
    return event.wheels is None or event.wheels != by_imu


def good_share(found: Explanation) -> float:
    """Returns the share of the frames that are GOOD by the filter's own health."""
    return found.health.by_health[schema.HEALTHS[GOOD]] / found.health.frames


def _is_known(found: Incident, known: Sequence[tuple[Cause, int]]) -> bool:
    return any(
        cause is found.cause and abs(begin - found.from_ns) <= WITHIN_S * S
        for cause, begin in known
    )


def main() -> int:
    """Prints each event as it was tried, and the shares."""
    parser = parser_of(__doc__, "recordings whose name contains it")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument(
        "--event", default="", help="events whose name contains it; none: clean ones alone"
    )
    given = parser.parse_args()
    given.cache.mkdir(exist_ok=True)
    program = given.bin / "pelorus-replay"
    all_tried: list[Tried] = []
    seeds = range(given.first_seed, given.first_seed + given.seeds)
    for drive in itertools.chain(simulated(seeds), real(given.cache)):
        if given.only not in drive.name:
            continue
        own = explained(program, drive.messages, drive.options)
        words = "; ".join([*(e.first.words for e in own.episodes), *own.setup])
        kind = CLEAN if good_share(own) >= GOOD_LEAST else TROUBLED
        asked = (tried(program, drive, e, own) for e in EVENTS if given.event in e.name)
        clean = Tried(kind, drive.name, not own.episodes, words)
        for one in filter(None, itertools.chain([clean], asked)):
            all_tried.append(one)
            mark = "right" if one.right else "WRONG"
            print(f"{mark} {one.event:15} {one.drive:24} {one.words}", flush=True)
    for name in (CLEAN, TROUBLED, *(event.name for event in EVENTS)):
        rows = [one.right for one in all_tried if one.event == name]
        if rows:
            print(f"{name:15} {sum(rows):4} of {len(rows):4}")
    events = [one.right for one in all_tried if one.event not in (CLEAN, TROUBLED)]
    if events:
        print(f"{'all events':15} {sum(events):4} of {len(events):4}  {np.mean(events):.1%}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
