# SPDX-License-Identifier: MIT
"""Real recordings through a build of the replay: how far off the filter is, beside its odometry
alone, and whether its health says so.

usage: judge.py [--bin build/bin] [--only TEXT] [--f64] [-- REPLAY OPTIONS]

The recordings are those of $PELORUS_DATA, by default ../shared/data; absent ones are left out.

ATE, err0   m, as `pelorus evaluate` has them; of 03 the RMS distance to the road
reckoned    ATE of the odometry alone, m; ratio: ATE beside it
NEES/6      mean; 1 is due
good        share of the frames GOOD, since the start
false       share not GOOD though all of the error is within 2 sigma and three points are used
silent      share GOOD though a component is beyond 5 sigma
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pelorus.evaluation import assess, by_imu
from pelorus.frames import Kind, Message, Report
from pelorus.health import time_line
from pelorus.road import compare, read_road
from pelorus.schema import HEALTHS
from pelorus.trajectory import estimate_in, filled, truth_in
from pelorus.wire import messages_of

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("PELORUS_DATA", ROOT / "../shared/data"))
DRIVES = ("09_26_drive_0001", "09_26_drive_0036", "09_30_drive_0020", "10_03_drive_0042")
KITTI_07 = str(DATA / "truth/kitti-odometry-07.txt")
COLUMNS = ("ATE", "reckoned", "ratio", "err0", "NEES/6", "good", "false", "silent")
Figures = dict[str, float]


@dataclass(frozen=True)
class Case:
    """A recording, how it is converted, and the options of its replay."""

    name: str
    file: str
    convert: tuple[str, ...]
    options: tuple[str, ...] = ()


def conf(name: str) -> tuple[str, ...]:
    """The options of a config file in tools/config."""
    return ("--config", str(ROOT / f"tools/config/{name}.conf"))


def cases() -> Iterator[Case]:
    """What development may look at; other recordings are run where the work is judged."""
    for drive in DRIVES:
        file = f"klt/2011_{drive}_sync_KLT.mat"
        yield Case(f"klt {drive}", file, ("klt",), (*conf("klt"), "--start-sigma", "0.01"))
        yield Case(f"klt {drive}, default", file, ("klt",))
    yield Case("0027", "ece276a/0027.npz", ("ece276a", "--truth", KITTI_07), conf("0027"))
    yield Case("03", "ece276a/03.npz", ("ece276a",), conf("03"))
    starry = "starry-night/dataset3"
    yield Case("starry-night", f"{starry}.mat", ("starry-night",), conf("starry-night"))
    yield Case("starry-night, default", f"{starry}.mat", ("starry-night",))
    for n in (40, 100):
        file = f"{starry}_fresh_{n}lessnoisy.mat"
        yield Case(f"fresh_{n}, default", file, ("starry-night",))
    fresh = f"{starry}_fresh_40lessnoisy.mat"
    located = ("--mode", "localization")
    yield Case("fresh_40, localization", fresh, ("starry-night",), located)
    euroc = "imu/euroc-V102-real-imu.npz"
    yield Case("euroc V102, default", euroc, ("imu-npz",))
    yield Case("euroc V102", euroc, ("imu-npz",), conf("imu-adis16448"))
    for name in ("tum_corridor1", "udel_gore_zupt"):
        yield Case(name, f"imu/{name}-60-seed0.npz", ("imu-npz",), conf("imu"))


def converted(case: Case, folder: Path) -> Path:
    """Converted once a folder."""
    out = folder / (case.file.replace("/", "-") + ".plr")
    if not out.exists():
        kind, *options = case.convert
        command = [sys.executable, "-m", "pelorus", "convert", kind, str(DATA / case.file)]
        command += [str(out), *options]
        said = subprocess.run(command, capture_output=True, text=True, check=False)
        if not out.exists():
            sys.exit(f"{case.name}: {said.stdout}{said.stderr}")
    return out


def run(program: Path, recording: Path, options: Sequence[str]) -> list[Message]:
    """The messages of a replay's log."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.plr"
        command = [str(program), str(recording), "--quiet", *options, "--out", str(log)]
        subprocess.run(command, check=True, capture_output=True)
        return messages_of(log)


def figures(messages: list[Message]) -> Figures:
    """What a log comes to."""
    answers = [m for m in messages if isinstance(m, Report) and m.subject == Kind.STEREO]
    reports = {m.t_ns: m for m in answers if m.status == 0}
    found, truth = estimate_in(messages), truth_in(messages)
    out: Figures = {}
    line = time_line(list(reports.values()))
    if line is not None and any(m.matched for m in reports.values()):
        out["good"] = line.by_health[HEALTHS[0]] / line.frames
    if found is None:
        return out
    if truth is None:  # 03
        way = read_road(DATA / "truth/kitti360-0003-path.csv")
        return out | {"ATE": compare(found[0].poses.p, way, 45.0).road_m}
    accuracy = assess(found[0], filled(truth, found[0].t_ns), found[1], 0, by_imu(messages))
    if accuracy is None:
        return out
    with np.errstate(divide="ignore", invalid="ignore"):
        worst = np.nanmax(np.abs(accuracy.error) / accuracy.sigma, axis=1)
    worst[0] = 0  # aligned there
    of_frame = [reports.get(t) for t in accuracy.t_ns.tolist()]
    health = np.array([3 if report is None else report.health for report in of_frame])
    seen = np.array([report is not None and report.used >= 3 for report in of_frame])
    out |= {"ATE": accuracy.ate_m, "err0": accuracy.err0_m}
    out["NEES/6"] = accuracy.nees_per_dof or np.nan
    if seen.any():
        out["false"] = float(np.mean((health[seen] != 0) & (worst[seen] <= 2)))
        out["silent"] = float(np.mean((health == 0) & (worst > 5)))
    return out


def parser_of(about: str | None, only: str) -> argparse.ArgumentParser:
    """The options that the harnesses of recordings share."""
    parser = argparse.ArgumentParser(
        description=about, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    cache = Path(tempfile.gettempdir()) / "pelorus-recordings"
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--only", default="", help=only)
    parser.add_argument("--cache", type=Path, default=cache, help="of converted recordings")
    return parser


def main() -> int:
    """Prints the table."""
    parser = parser_of(__doc__, "recordings whose name contains it")
    parser.add_argument("--f64", action="store_true")
    parser.add_argument("options", nargs="*")
    given = parser.parse_args()
    given.cache.mkdir(exist_ok=True)
    program = given.bin / ("pelorus-replay-f64" if given.f64 else "pelorus-replay")
    print(f"{'recording':28}" + "".join(f"{name:>9}" for name in COLUMNS))
    for case in cases():
        if given.only not in case.name or not (DATA / case.file).exists():
            continue
        recording = converted(case, given.cache)
        found = figures(run(program, recording, [*case.options, *given.options]))
        alone = figures(run(program, recording, [*case.options, "--mode", "dead_reckoning"]))
        found["reckoned"] = alone.get("ATE", np.nan)
        found["ratio"] = found["ATE"] / found["reckoned"]
        row = "".join(f"{found.get(name, np.nan):9.3g}" for name in COLUMNS)
        print(f"{case.name:28}{row}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
