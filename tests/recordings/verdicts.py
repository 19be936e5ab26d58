# SPDX-License-Identifier: MIT
"""Is `pelorus check` right in both directions? Clean drives, of which it must accuse none, and
drives with a fault put in, which it must name: one program, one set of thresholds, one run.

usage: verdicts.py [--drives N] [--seed S] [--only TEXT] [--injected [--share 0.1]] [--verdicts]
                   [--bin build/bin]

found      clean simulated drives of every kind of robot (tests/python/robots.py) through a
           converter's search for faults and that of `check`: how many are FOUND faulty
--injected and the faults of tests/python/injected.py in real recordings and simulated drives: how
           many are named rightly; --share tries a part of them, drawn at random
--verdicts and `check` as a whole on clean drives, simulated (N of them) and real: how many that are
           right (ATE at most 0.5 % of the way) it says not to trust

Real recordings are those of $PELORUS_DATA, by default ../shared/data; absent ones are left out.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/python"))

import everyday  # noqa: E402 - what the tests drive
import injected  # noqa: E402
import robots  # noqa: E402
from pelorus.check import checked  # noqa: E402
from pelorus.check.verdict import Grade  # noqa: E402
from pelorus.commands.cli import main as pelorus  # noqa: E402
from pelorus.converters.streams import converted  # noqa: E402
from pelorus.faults.named import judged_of  # noqa: E402
from pelorus.io.recording import Recording  # noqa: E402
from pelorus.io.trajectory import truth_in  # noqa: E402
from pelorus.wire import framing  # noqa: E402

DATA = Path(os.environ.get("PELORUS_DATA", ROOT / "../shared/data"))
RIGHT_SHARE, RIGHT_M = 0.005, 0.02  # of the way; or, of one that hardly moves, so far
# what is so, and no fault of any part of the robot
TRUE_OF_A_DRIVE = ("time-gap",)
SEEDS = range(10200, 10206)


@dataclass(frozen=True)
class Real:
    """A recording, how it is converted, and whether faults are put into it."""

    name: str
    file: str
    convert: tuple[str, ...]
    options: tuple[str, ...] = ()
    faults: bool = True


def reals() -> Iterator[Real]:
    """Yields the recordings of docs/TESTING.md."""
    yield Real("Starry Night", "starry-night/dataset3.mat", ("starry-night",))
    for name, drive in (("0001", "09_26_drive_0001"), ("0036", "09_26_drive_0036")):
        file = f"klt/2011_{drive}_sync_KLT.mat"
        yield Real(name, file, ("klt",), ("--twist-timing", "end"))
    for name in ("03", "0027"):
        yield Real(name, f"ece276a/{name}.npz", ("ece276a",), ("--twist-timing", "end"))
    for name in ("euroc-V102-real-imu", "tum_corridor1-60-seed0", "udel_gore_zupt-60-seed0"):
        yield Real(name, f"imu/{name}.npz", ("imu-npz",))


def opened(case: Real, folder: Path) -> Path | None:
    """Returns the converted recording; None where the file is absent."""
    source = DATA / case.file
    if not source.exists():
        return None
    path = folder / f"{case.name.replace(' ', '-')}.plr"
    words = ["convert", *case.convert, str(source), str(path), *case.options]
    return path if pelorus(words) == 0 else None


# --- clean drives ---------------------------------------------------------------------------------


def found_in(drive: robots.Drive) -> tuple[Recording, list[str]]:
    """Returns what a converter and `check` find, in words."""
    recording, findings = converted(drive.streams, None, True)
    said = {f.subject: f"{f.subject}: {f.evidence}" for f in findings if f.found}
    faults = judged_of(list(recording.messages()), recording).faults
    said |= {f.name: f"{f.name}: {f.words}" for f in faults if f.name != "untold"}
    return recording, [words for name, words in said.items() if name not in TRUE_OF_A_DRIVE]


def clean(count: int, seed: int, only: str) -> list[tuple[str, int, int]]:
    """Returns kind, drives, and how many of them are called faulty."""
    asked: Counter[str] = Counter()
    false: Counter[str] = Counter()
    for kind, by, own in robots.chosen(count, seed):
        drive = robots.drive(kind, by, own) if only in f"{kind}, by {by}" else None
        if drive is None:
            continue
        _, said = found_in(drive)
        asked[drive.name] += 1
        false[drive.name] += bool(said)
        if said:
            print(f"{drive.name}, seed {own}:", *said, sep="\n    ", flush=True)
    return [(name, asked[name], false[name]) for name in asked]


# --- faults put in --------------------------------------------------------------------------------


def with_faults(only: str, folder: Path, share: float) -> list[tuple[str, int, int, int]]:
    """Returns recording, injected faults, those named right, and those beyond the data."""
    rows = []
    drives: list[tuple[str, Recording]] = []
    for case in reals():
        if only in case.name:
            path = opened(case, folder)
            drives += [] if path is None else list(injected.recordings([str(path)]))
    for seed in SEEDS:
        settings = everyday.drawn(seed)
        if only in f"{seed} ({settings.kind})":
            drives.append((f"{seed} ({settings.kind})", everyday.drive(settings, seed)))
    for name, recording in drives:
        right, asked, beyond = injected.injected(Path(name).stem, recording, share)
        rows.append((Path(name).stem, asked, right, beyond))
        print(f"{name}: {right} of {asked}", flush=True)
    return rows


# --- whole verdicts -------------------------------------------------------------------------------


def verdict_of(name: str, path: Path, program: Path) -> tuple[bool, bool]:
    """Returns whether the result is right, and whether the verdict is not to trust it."""
    with tempfile.TemporaryDirectory() as folder:
        found = checked.check(program, path, {}, Path(folder))
    figures = {title: after for title, _, after in found.rows}
    truth = truth_in(framing.messages_of(path))
    way = (
        0.0 if truth is None else float(np.sum(np.linalg.norm(np.diff(truth[1].p, axis=0), axis=1)))
    )
    ate = figures.get("ATE m (truth, to compare)", "-")
    # what was not tuned has no figures; of clean drives it is the verdict that is wrong
    right = ate == "-" or float(ate) <= max(RIGHT_SHARE * way, RIGHT_M)
    bad = found.grade is Grade.BAD
    print(f"{name}: {found.verdict}; ATE {ate} m of {way:.1f} m", flush=True)
    for remark in found.verdict.remarks:
        if bad and remark.grade is Grade.BAD:
            print(f"    {remark.text}", flush=True)
    return right, bad


def verdicts(
    count: int, seed: int, only: str, program: Path, folder: Path
) -> list[tuple[str, int, int, int]]:
    """Returns kind, drives, right ones, and how many of these are not trusted."""
    rows: dict[str, list[tuple[bool, bool]]] = {}
    for kind, by, own in robots.chosen(count, seed):
        drive = robots.drive(kind, by, own) if only in f"{kind}, by {by}" else None
        if drive is not None:
            path = folder / f"{own}.plr"
            converted(drive.streams, None, True)[0].write(path)
            said = verdict_of(f"{drive.name}, seed {own}", path, program)
            rows.setdefault(drive.name, []).append(said)
    for case in reals():
        path_of = opened(case, folder) if only in case.name else None
        if path_of is not None:
            rows[case.name] = [verdict_of(case.name, path_of, program)]
    return [
        (
            name,
            len(said),
            sum(right for right, _ in said),
            sum(right and bad for right, bad in said),
        )
        for name, said in rows.items()
    ]


def table(title: tuple[str, ...], rows: Sequence[tuple[str | int, ...]]) -> None:
    """Prints a table with sums, as in docs/TESTING.md."""
    print(f"| {' | '.join(title)} |", f"|{'---|' * len(title)}", sep="\n")
    for row in rows:
        print(f"| {' | '.join(str(x) for x in row)} |")
    sums = [sum(int(row[k]) for row in rows) for k in range(1, len(title))]
    print(f"| **all** | {' | '.join(str(x) for x in sums)} |", flush=True)


def main() -> None:
    """Prints the tables that are asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--drives", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--injected", action="store_true")
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--verdicts", action="store_true")
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if not asked.verdicts:
            rows = clean(asked.drives, asked.seed, asked.only)
            table(("clean drives", "drives", "found faulty"), rows)
        if asked.injected:
            named = with_faults(asked.only, Path(folder), asked.share)
            table(("faults put in", "faults", "named", "less than can be told"), named)
        if asked.verdicts:
            program = asked.bin / "pelorus-replay"
            said = verdicts(asked.drives, asked.seed, asked.only, program, Path(folder))
            table(("`check` on clean drives", "drives", "right", "not to be trusted"), said)


if __name__ == "__main__":
    main()
