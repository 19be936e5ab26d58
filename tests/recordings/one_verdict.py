# SPDX-License-Identifier: MIT
"""Do the commands speak with one voice? Clean drives, simulated ones of every kind of robot and
real ones, through `try` (which is `check` and `report`) and `explain`, as their user types them.

usage: one_verdict.py [--drives N] [--seed S] [--only TEXT] [--real] [--bin build/bin]

one voice   the verdict of `check`, of the report's page and of `explain` with the settings that
            `check` wrote are the same words
as given    that of `explain` without them is the same, or the other one that `check` names
false       "do not trust this", of drives that are right: ATE at most 0.5 % of the way

Real recordings are those of verdicts.py.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/python"))

import robots  # noqa: E402 - what the tests drive
import verdicts  # noqa: E402
from pelorus.check.verdict import VERDICTS  # noqa: E402
from pelorus.commands.cli import main as pelorus  # noqa: E402
from pelorus.converters.streams import converted  # noqa: E402

SAID = re.compile(f"^(?:{'|'.join(VERDICTS.values())})(?:, to [0-9.]+% of the way)?$", re.MULTILINE)
SHOWN = re.compile(r'<div class="verdict \w+"><strong>(.*?)</strong>')
BEFORE = re.compile(r"^with the settings as they are: (.*)$", re.MULTILINE)


class Voices(NamedTuple):
    """What each command printed, and whether the result is right; `way` in m."""

    check: str
    report: str
    page: str
    explain: str
    before: str  # explain with the settings as they are
    named: str  # in the words of check
    ate_m: float | None
    way_m: float

    @property
    def is_one(self) -> bool:
        return self.check == self.report == self.explain == self.page

    @property
    def is_one_as_given(self) -> bool:
        return _grade(self.before) == _grade(self.named or self.check)

    @property
    def is_right(self) -> bool:
        most = max(verdicts.RIGHT_SHARE * self.way_m, verdicts.RIGHT_M)
        return self.ate_m is None or self.ate_m <= most

    @property
    def is_bad(self) -> bool:
        return self.check.startswith("do not")


def _grade(words: str) -> str:
    """Returns the verdict without the position error."""
    return words.partition(", to ")[0]


def printed(*words: str) -> str:
    """Returns what a command prints; one that fails ends the program, with its own words."""
    out, complaints = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(complaints):
        status = pelorus(list(words))
    if status != 0:
        raise SystemExit(f"pelorus {' '.join(words)} ended with {status}:\n{complaints.getvalue()}")
    return out.getvalue()


def asked(drive: Path, folder: Path) -> Voices:
    """Runs all four commands."""
    told = printed("try", str(drive), "--out", str(folder))
    check, report = SAID.findall(told)[:2]
    named = BEFORE.search(told)
    shown = SHOWN.search((folder / "report.html").read_text(encoding="utf-8"))
    assert shown is not None
    page = shown[1][0].lower() + shown[1][1:]
    conf = folder / "tuned.conf"
    tuned = ("--config", str(conf)) if conf.exists() else ()
    after = json.loads(printed("explain", str(drive), "--json", *tuned))
    before = json.loads(printed("explain", str(drive), "--json"))
    figures = json.loads(printed("evaluate", str(drive), "--json", *tuned) or "{}")
    way_m, ate_m = float(figures.get("path_m") or 0.0), figures.get("ate_m")
    return Voices(
        check, report, page, after["verdict"], before["verdict"], named[1] if named else "",
        ate_m, way_m,
    )  # fmt: skip


def drives(
    count: int, seed: int, only: str, real: bool, folder: Path
) -> Iterator[tuple[str, Path]]:
    """Yields name and recording."""
    for kind, by, own in robots.chosen(count, seed):
        drive = robots.drive(kind, by, own) if only in f"{kind}, by {by}" else None
        if drive is not None:
            path = folder / f"{own}.plr"
            converted(drive.streams, None, True)[0].write(path)
            yield f"{drive.name}, seed {own}", path
    for case in verdicts.reals() if real else ():
        opened = verdicts.opened(case, folder) if only in case.name else None
        if opened is not None:
            yield case.name, opened


def main() -> int:
    """Prints a line for each drive, and the counts; returns 1 where the commands disagree."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--drives", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--real", action="store_true", help="real recordings, too")
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    given = parser.parse_args()
    os.environ["PELORUS_BIN"] = str(given.bin)
    heard: list[Voices] = []
    with tempfile.TemporaryDirectory() as folder:
        every = drives(given.drives, given.seed, given.only, given.real, Path(folder))
        for name, path in every:
            begun = time.perf_counter()
            voices = asked(path, Path(folder) / f"try-{path.stem}")
            heard.append(voices)
            marks = [
                "" if voices.is_one else "MANY VOICES",
                "" if voices.is_one_as_given else "OTHER AS GIVEN",
                "FALSE" if voices.is_bad and voices.is_right else "",
            ]
            took = f"{time.perf_counter() - begun:.0f} s"
            print(f"{name} ({took}): {voices.check} {' '.join(filter(None, marks))}", flush=True)
            if any(marks):
                print(f"    {voices}", flush=True)
    right = [one for one in heard if one.is_right]
    print(f"drives {len(heard)}, one voice {sum(one.is_one for one in heard)}, ", end="")
    print(f"as given {sum(one.is_one_as_given for one in heard)}, right {len(right)}, ", end="")
    print(f"false {sum(one.is_bad for one in right)}")
    return int(not all(one.is_one for one in heard))


if __name__ == "__main__":
    sys.exit(main())
