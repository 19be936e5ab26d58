# SPDX-License-Identifier: MIT
"""Real recordings through a build of the replay: how far off the filter is, beside its twists alone, and
whether its health says so.

usage: judge.py [--bin build/bin] [--only TEXT] [--f64] [-- REPLAY OPTIONS]

The recordings are those of $PELORUS_DATA, by default ../shared/data; one that is not there is left out. A row:

ATE, err0     m, as `pelorus evaluate` has them (03: RMS distance to the road)
reckoned      ATE of the twists or the IMU alone, m; ratio: ATE beside it
NEES/6        mean; 1 is due
good          share of the frames GOOD
false         share not GOOD though every component of the error is within 2 sigma and three points are used
silent        share GOOD though a component is beyond 5 sigma
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
from pelorus.trajectory import estimate_in, filled, truth_in
from pelorus.wire import messages_of

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("PELORUS_DATA", ROOT / "../shared/data"))
KLT = ("2011_09_26_drive_0001", "2011_09_26_drive_0036", "2011_09_30_drive_0020", "2011_10_03_drive_0042")


@dataclass(frozen=True)
class Case:
    """A recording, how it is converted, and the options of its replay."""

    name: str
    file: str
    convert: tuple[str, ...]
    options: tuple[str, ...] = ()
    truth: tuple[str, ...] = ()


def conf(name: str) -> tuple[str, ...]:
    return ("--config", str(ROOT / f"tools/config/{name}.conf"))


def cases() -> Iterator[Case]:
    """Every recording that development may look at; others are run where the work is judged."""
    for drive in KLT:
        file = f"klt/{drive}_sync_KLT.mat"
        yield Case(f"klt {drive[5:]}", file, ("klt",), (*conf("klt"), "--start-sigma", "0.01"))
    for drive in KLT:
        yield Case(f"klt {drive[5:]}, default", f"klt/{drive}_sync_KLT.mat", ("klt",))
    yield Case("0027", "ece276a/0027.npz", ("ece276a", "--truth", str(DATA / "truth/kitti-odometry-07.txt")), conf("0027"))
    yield Case("03", "ece276a/03.npz", ("ece276a",), conf("03"))
    yield Case("starry-night", "starry-night/dataset3.mat", ("starry-night",), conf("starry-night"))
    yield Case("starry-night, default", "starry-night/dataset3.mat", ("starry-night",))
    for n in (40, 100):
        yield Case(f"fresh_{n}, default", f"starry-night/dataset3_fresh_{n}lessnoisy.mat", ("starry-night",))
    yield Case("fresh_40, localization", "starry-night/dataset3_fresh_40lessnoisy.mat", ("starry-night",), ("--mode", "localization"))
    yield Case("euroc V102", "imu/euroc-V102-real-imu.npz", ("imu-npz",))
    yield Case("euroc V102, its conf", "imu/euroc-V102-real-imu.npz", ("imu-npz",), conf("imu-adis16448"))
    for name in ("tum_corridor1-60-seed0", "udel_gore_zupt-60-seed0"):
        yield Case(name.partition("-")[0], f"imu/{name}.npz", ("imu-npz",), conf("imu"))


def converted(case: Case, folder: Path) -> Path:
    """Converted once a folder."""
    out = folder / (case.file.replace("/", "-") + ".plr")
    if not out.exists():
        kind, *options = case.convert
        command = [sys.executable, "-m", "pelorus", "convert", kind, str(DATA / case.file), str(out), *options]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not out.exists():
            sys.exit(f"{case.name}: {done.stdout}{done.stderr}")
    return out


def run(program: Path, recording: Path, options: Sequence[str]) -> list[Message]:
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.plr"
        command = [str(program), str(recording), "--quiet", *options, "--out", str(log)]
        subprocess.run(command, check=True, capture_output=True)
        return messages_of(log)


def road(case: Case, program: Path, recording: Path, options: Sequence[str]) -> float:
    """Of 03, which has no poses: RMS distance to the road that a published map shows."""
    from pelorus.road import distance  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as folder:
        return distance(case, program, recording, options, folder)


def figures(messages: list[Message]) -> dict[str, float]:
    """What a log comes to."""
    reports = {m.t_ns: m for m in messages if isinstance(m, Report) and m.subject == Kind.STEREO and m.status == 0}
    good = np.mean([m.health == 0 for m in reports.values()])
    found, truth = estimate_in(messages), truth_in(messages)
    if found is None or truth is None:
        return {"good": float(good)}
    accuracy = assess(found[0], filled(truth, found[0].t_ns), found[1], 0, by_imu(messages))
    if accuracy is None:
        return {"good": float(good)}
    with np.errstate(divide="ignore", invalid="ignore"):
        worst = np.nanmax(np.abs(accuracy.error) / accuracy.sigma, axis=1)
    worst[0] = 0  # aligned there
    health = np.array([reports[t].health if t in reports else 3 for t in accuracy.t_ns.tolist()])
    used = np.array([reports[t].used if t in reports else 0 for t in accuracy.t_ns.tolist()])
    seen = used >= 3
    return {
        "ATE": accuracy.ate_m,
        "err0": accuracy.err0_m,
        "NEES/6": accuracy.nees_per_dof or np.nan,
        "good": float(good),
        "false": float(np.mean((health[seen] != 0) & (worst[seen] <= 2))),
        "silent": float(np.mean((health == 0) & (worst > 5))),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--only", default="", help="recordings whose name contains it")
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "pelorus-recordings")
    parser.add_argument("--f64", action="store_true")
    parser.add_argument("options", nargs="*")
    given = parser.parse_args()
    given.cache.mkdir(exist_ok=True)
    program = given.bin / ("pelorus-replay-f64" if given.f64 else "pelorus-replay")
    print(f"{'recording':36} {'ATE':>8} {'reckoned':>8} {'ratio':>6} {'err0':>8} {'NEES/6':>7} {'good':>6} {'false':>6} {'silent':>6}")
    for case in cases():
        if given.only not in case.name or not (DATA / case.file).exists():
            continue
        recording = converted(case, given.cache)
        f = figures(run(program, recording, [*case.options, *given.options]))
        reckoned = figures(run(program, recording, [*case.options, "--mode", "dead_reckoning"])).get("ATE", np.nan)
        ate = f.get("ATE", np.nan)
        row = (ate, reckoned, ate / reckoned, *(f.get(k, np.nan) for k in ("err0", "NEES/6", "good", "false", "silent")))
        print(f"{case.name:36} {row[0]:8.4g} {row[1]:8.4g} {row[2]:6.3f} {row[3]:8.4g} {row[4]:7.3g} {row[5]:6.3f} {row[6]:6.3f} {row[7]:6.3f}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
