# SPDX-License-Identifier: MIT
"""Makes the first tables of docs/BENCHMARKS.md from a folder of recordings, as they stand there.

usage: benchmarks.py [--bin build/bin] [--only TEXT]

The folder is $PELORUS_DATA, by default ../shared/data; absent recordings are left out. The path is
that of the truth. The course's filter is pelorus-replay-f64 --preset course and nothing else.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from judge import DATA, DRIVES, KITTI_07, Case, Figures, conf, converted, figures, parser_of, run
from pelorus.io.trajectory import truth_in
from pelorus.wire.framing import messages_of

STARRY = ("starry-night/dataset3.mat", ("starry-night",))
NOISE_5 = ("--pixel-sigma", "5")
BY_TWISTS = ("odometry alone", "the course's filter (float64)")
BY_IMU = ("IMU alone",)


@dataclass(frozen=True)
class Row:
    """A line of a table: its figure, and the options of the course's filter, if any."""

    case: Case
    figure: str
    course: tuple[str, ...] | None = None


def by_twists() -> Iterator[Row]:
    """Recordings whose body is moved by odometry."""
    known = conf("starry-night")
    yield Row(Case("Starry Night (starry-night)", *STARRY, known), "err0", ())
    noisy = Case("the same, `--pixel-sigma 5`", *STARRY, (*known, *NOISE_5))
    yield Row(noisy, "err0", NOISE_5)
    located = (*known, *NOISE_5, "--mode", "localization")
    yield Row(Case("the same at 5 px, `--mode localization`", *STARRY, located), "err0")
    drive_0027 = ("ece276a/0027.npz", ("ece276a", "--truth", KITTI_07))
    yield Row(Case("0027, KITTI raw, noisy twists (0027)", *drive_0027, conf("0027")), "ATE", ())
    unbiased = (*conf("0027"), "--bias", "off")
    yield Row(Case("the same, `--bias off`", *drive_0027, unbiased), "ATE")
    drive_03 = ("ece276a/03.npz", ("ece276a",))
    yield Row(Case("03, KITTI-360, gyro with a bias (03)", *drive_03, conf("03")), "road", ())
    for drive in DRIVES:
        file = f"klt/2011_{drive}_sync_KLT.mat"
        name = f"KITTI {drive.replace('_drive', '')}, KLT tracks (klt)"
        options = (*conf("klt"), "--start-sigma", "0.01")
        yield Row(Case(name, file, ("klt",), options), "ATE", ())


def by_imu() -> Iterator[Row]:
    """Recordings with a raw IMU."""
    for name, config in (
        ("tum_corridor1-60-seed0", "imu"),
        ("udel_gore_zupt-60-seed0", "imu"),
        ("euroc-V102-real-imu", "imu-adis16448"),
    ):
        case = Case(f"`{name}` ({config})", f"imu/{name}.npz", ("imu-npz",), conf(config))
        yield Row(case, "err0")


def metres(value: float) -> str:
    """Returns a length with as many digits as are significant."""
    return "" if np.isnan(value) else f"{value:.{3 if value < 1 else 2 if value < 10 else 1}f} m"


def path_m(recording: Path) -> str:
    """Returns the length of the true path."""
    truth = truth_in(messages_of(recording))
    if truth is None:
        return ""
    return f"{np.linalg.norm(np.diff(truth.poses.p, axis=0), axis=1).sum():.0f} m"


def by_course(program: Path, recording: Path, options: Sequence[str], figure: str) -> str:
    """Returns the course's figure, and its NEES/6; empty where its filter fails."""
    try:
        found = figures(run(program, recording, ["--preset", "course", *options]))
    except subprocess.CalledProcessError:
        return "lost"
    return cell(found, figure)


def cell(found: Figures, figure: str) -> str:
    """Returns the error, and NEES/6 if the truth has poses."""
    error = found.get("ATE" if figure == "road" else figure, np.nan)
    nees = found.get("NEES/6", np.nan)
    if np.isnan(nees):
        return metres(error)
    return f"{metres(error)}, {nees:.0f}" if nees > 10 else f"{metres(error)}, {nees:.2g}"


def line(row: Row, programs: Path, cache: Path, with_course: bool) -> str:
    """Returns a line of the table."""
    recording = converted(row.case, cache)
    replay = programs / "pelorus-replay"
    ours = figures(run(replay, recording, row.case.options))
    alone = figures(run(replay, recording, [*row.case.options, "--mode", "dead_reckoning"]))
    error = alone.get("ATE" if row.figure == "road" else row.figure, np.nan)
    cells = [row.case.name, path_m(recording), row.figure, metres(error)]
    if with_course:
        f64, course = programs / "pelorus-replay-f64", row.course
        cells.append("" if course is None else by_course(f64, recording, course, row.figure))
    good = f", {100 * ours['good']:.0f} %" if "good" in ours else ""
    return "| " + " | ".join([*cells, f"**{cell(ours, row.figure)}**{good}"]) + " |"


def main() -> None:
    """Prints them."""
    given = parser_of(__doc__, "recordings whose name contains it").parse_args()
    given.cache.mkdir(exist_ok=True)
    for others, rows in ((BY_TWISTS, by_twists()), (BY_IMU, by_imu())):
        heads = ["recording (config)", "path", "figure", *others, "**Pelorus (float32)**, GOOD"]
        print("| " + " | ".join(heads) + " |\n|" + "---|" * len(heads))
        for row in rows:
            if given.only in row.case.name and (DATA / row.case.file).exists():
                print(line(row, given.bin, given.cache, others is BY_TWISTS), flush=True)
        print()


if __name__ == "__main__":
    main()
