# SPDX-License-Identifier: MIT
"""Real recordings through a build of the replay: how far off the filter is, beside its odometry
alone, and whether its health says so.

usage: judge.py [--bin build/bin] [--only TEXT] [--f64 | --both] [-- REPLAY OPTIONS]
       judge.py --without supervisor [--bin-without BIN] [--write] [--only TEXT] [--f64]

The recordings are those of $PELORUS_DATA, by default ../shared/data; absent ones are left out. A
person who walks past the camera is simulated, 18 times, and shown by the worst figure of each kind.

ATE, err0   m, as `pelorus evaluate` has them; of 03 the RMS distance to the road
reckoned    ATE of the odometry alone, m; ratio: ATE beside it
NEES/6      mean; 1 is expected
good        share of the frames GOOD, since the start
false       share not GOOD though all of the error is within 2 sigma and three points are used
silent      share GOOD though a component is beyond 5 sigma; beyond 3: the same with 3
within 2    share GOOD of the frames whose error is within 2 sigma
diverged    frames in which a variance was not positive or the filter recovered
worst, sig  the largest error of the position, m, and in sigmas of an axis
f32/f64     with --both, which runs both precisions: ATE beside that of float64

--without supervisor  the error beside that of a replay without it (PLR_SUPERVISE=OFF), which is
                      built in build/without-supervisor if no --bin-without is given; --write puts
                      the table into docs/SUPERVISION.md
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pelorus.evaluate.evaluation import assess, by_imu
from pelorus.evaluate.health import GOOD, NOT_STARTED, time_line
from pelorus.evaluate.road import compare, read_road
from pelorus.io.trajectory import estimate_in, filled, truth_in
from pelorus.wire import schema
from pelorus.wire.frames import Kind, Message, Report
from pelorus.wire.framing import messages_of
from pelorus.wire.layout import Floats

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("PELORUS_DATA", ROOT / "../shared/data"))
DRIVES = ("09_26_drive_0001", "09_26_drive_0036", "09_30_drive_0020", "10_03_drive_0042")
KITTI_07 = str(DATA / "truth/kitti-odometry-07.txt")
PERSON = "wild2/01-person-walks-past"
COLUMNS = (
    *("ATE", "reckoned", "ratio", "err0", "NEES/6", "good", "false", "silent", "beyond 3"),
    *("within 2", "diverged", "worst", "sig", "f32/f64"),
)
LEAST_IS_WORST = ("good", "within 2")
DIVERGED = schema.number("reason", "NOT_POSITIVE") | schema.number("reason", "RECOVERED")
PAGE = ROOT / "docs/SUPERVISION.md"
MARKED = re.compile(r"(<!-- table: recordings, by judge\.py -->\n).*?(<!-- end -->)", re.DOTALL)
WORSE = 1.05  # an error with the supervisor beside the one without, above which it is told
Figures = dict[str, float]


@dataclass(frozen=True)
class Case:
    """A recording with the figure by which its runs are compared.

    It has the command that converts it (empty: it is a .plr already), and the options of its
    replay.
    """

    name: str
    file: str
    convert: tuple[str, ...]
    options: tuple[str, ...] = ()
    figure: str = "ATE"


def conf(name: str) -> tuple[str, ...]:
    """Returns the options of a config file in tools/config."""
    return ("--config", str(ROOT / f"tools/config/{name}.conf"))


def cases() -> Iterator[Case]:
    """Yields the recordings for development; the work is judged on others."""
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
    yield from by_real_imu()
    for name in ("tum_corridor1", "udel_gore_zupt"):
        yield Case(name, f"imu/{name}-60-seed0.npz", ("imu-npz",), conf("imu"))


START = "images/euroc-mh01-start"


def by_real_imu() -> Iterator[Case]:
    """Yields EuRoC's drives: with simulated points, with tracks of real pictures, with pictures."""
    for name, file, convert, figure in (
        ("euroc V101", "imu/euroc-V101-real-imu.npz", ("imu-npz",), "ATE"),
        ("euroc V102", "imu/euroc-V102-real-imu.npz", ("imu-npz",), "ATE"),
        ("euroc V203", "imu/euroc-V203-real-imu.npz", ("imu-npz",), "ATE"),
        ("euroc MH01 tracks", "imu/euroc-mh01-tracks.plr", (), "err0"),
        (
            "euroc MH01 pictures",
            START,
            ("euroc", "--truth", str(DATA / START / "truth.tum")),
            "err0",
        ),
    ):
        yield Case(f"{name}, default", file, convert, (), figure)
        yield Case(name, file, convert, conf("imu-adis16448"), figure)


# --- a person who walks past ----------------------------------------------------------------------


def people(folder: Path) -> Iterator[Case]:
    """Yields the drives of wild2/01, made in `folder` if they are missing; none without the
    data.
    """
    if not (DATA / PERSON).is_dir():
        return
    made = folder / "wild2" / Path(PERSON).name
    whole = made / "made"  # a run that was ended early leaves some of the drives
    if not whole.exists():
        for part in (PERSON, "wild2/common"):
            target = folder / "wild2" / Path(part).name
            # contents alone: the share may be read-only, and its modes would come along
            shutil.copytree(DATA / part, target, copy_function=shutil.copyfile, dirs_exist_ok=True)
        print("making 18 drives with a person: some minutes", file=sys.stderr, flush=True)
        make = [sys.executable, "make.py"]
        said = subprocess.run(make, cwd=made, capture_output=True, text=True, check=False)
        if said.returncode:
            sys.exit(f"{made}: make.py, which needs numpy, scipy and ruamel.yaml:\n{said.stderr}")
        whole.touch()
    # imu.yaml is left out: the defaults stand, as for who fills in plr_config by himself
    for drive in sorted(path.parent for path in made.glob("*/tracks.csv")):
        named = {"imu": "imu.csv", "truth": "truth.tum", "calibration": "camchain.yaml"}
        pairs = ((f"--{option}", str(drive / file)) for option, file in named.items())
        convert = ("csv", *(word for pair in pairs for word in pair))
        yield Case(f"person {drive.name}", str(drive / "tracks.csv"), convert, (), "worst")


def worst_of(found: Sequence[Figures]) -> Figures:
    """Returns the worst of each figure."""
    names = {name: None for one in found for name in one}
    return {
        name: (min if name in LEAST_IS_WORST else max)(one.get(name, np.nan) for one in found)
        for name in names
    }


# --- runs -----------------------------------------------------------------------------------------


def converted(case: Case, folder: Path) -> Path:
    """Returns the converted recording, made once a folder."""
    source = DATA / case.file
    if not case.convert:
        return source
    out = folder / (case.file.strip("/").replace("/", "-") + ".plr")
    if not out.exists():
        kind, *options = case.convert
        of_tracks = ("--stereo",) if kind == "csv" else ()
        command = [sys.executable, "-m", "pelorus", "convert", kind, *of_tracks, str(source)]
        command += [str(out), *options]
        said = subprocess.run(command, capture_output=True, text=True, check=False)
        if not out.exists():
            sys.exit(f"{case.name}: {said.stdout}{said.stderr}")
    return out


def run(program: Path, recording: Path, options: Sequence[str]) -> list[Message]:
    """Returns the messages of a replay's log."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.plr"
        command = [str(program), str(recording), "--quiet", *options, "--out", str(log)]
        subprocess.run(command, check=True, capture_output=True)
        return messages_of(log)


def figures(messages: list[Message]) -> Figures:
    """Returns the figures of a log."""
    answers = [m for m in messages if isinstance(m, Report) and m.subject == Kind.STEREO]
    reports = {m.t_ns: m for m in answers if m.status == 0}
    found, truth = estimate_in(messages), truth_in(messages)
    out: Figures = {"diverged": sum(m.reasons & DIVERGED != 0 for m in answers)}
    line = time_line(list(reports.values()))
    if line is not None and any(m.matched for m in reports.values()):
        out["good"] = line.by_health[schema.HEALTHS[GOOD]] / line.frames
    if found is None:
        return out
    if truth is None:  # 03
        way = read_road(DATA / "truth/kitti360-0003-path.csv")
        return out | {"ATE": compare(found[0].poses.p, way, 45.0).road_m}
    accuracy = assess(found[0], filled(truth, found[0].t_ns), found[1], 0, by_imu(messages))
    if accuracy is None:
        return out
    with np.errstate(divide="ignore", invalid="ignore"):
        sigmas = np.abs(accuracy.error) / accuracy.sigma
    sigmas[0] = 0  # the alignment makes them zero
    out |= {"ATE": accuracy.ate_m, "err0": accuracy.err0_m}
    out["NEES/6"] = accuracy.nees_per_dof or np.nan
    out["worst"] = float(np.linalg.norm(accuracy.estimate.p - accuracy.truth.p, axis=1).max())
    out["sig"] = float(np.nanmax(sigmas[:, :3]))
    of_frame = [reports.get(t) for t in accuracy.t_ns.tolist()]
    return out | _honesty(of_frame, np.nanmax(sigmas, axis=1))


def _honesty(reports: Sequence[Report | None], worst: Floats) -> Figures:
    """Returns whether health fits the error, whose largest component is given in sigmas."""
    good = np.array([report is not None and report.health == GOOD for report in reports])
    seen = np.array([report is not None and report.used >= 3 for report in reports])
    started = np.array([report is None or not report.reasons & NOT_STARTED for report in reports])
    out: Figures = {}
    if seen.any():
        out["false"] = float(np.mean(~good[seen] & (worst[seen] <= 2)))
        out["silent"] = float(np.mean(good & (worst > 5)))
        out["beyond 3"] = float(np.mean(good & (worst > 3)))
        right = started & (worst <= 2)
        out["within 2"] = float(np.mean(good[right])) if right.any() else np.nan
    return out


# --- with and without the supervisor --------------------------------------------------------------


def built_without() -> Path:
    """Returns the programs of a build without the supervisor."""
    folder = ROOT / "build/without-supervisor"
    configure = ["cmake", "-S", str(ROOT), "-B", str(folder), "-DCMAKE_BUILD_TYPE=Release"]
    configure += ["-DPELORUS_BUILD_TESTS=OFF", "-DPLR_SUPERVISE=OFF"]
    build = ["cmake", "--build", str(folder), "--target", "pelorus-replay", "pelorus-replay-f64"]
    print(f"building in {folder}", file=sys.stderr, flush=True)
    for command in (configure, build):
        said = subprocess.run(command, capture_output=True, text=True, check=False)
        if said.returncode:
            sys.exit(f"{' '.join(command)}:\n{said.stdout}{said.stderr}")
    return folder / "bin"


def beside(name: str, figure: str, whole: Figures, alone: Figures) -> str:
    """Returns a row: the error with and without the supervisor, and what else it changes."""
    ratio = whole[figure] / alone[figure]
    told = f"**{ratio:.2f}**" if ratio > WORSE else f"{ratio:.2f}"
    cells = [name, "road" if name == "03" else figure]
    cells += [f"{one[figure]:.3g}" for one in (whole, alone)] + [told]
    for key in ("NEES/6", "beyond 3"):
        cells.append(", ".join("" if key not in f else f"{f[key]:.2g}" for f in (whole, alone)))
    return "| " + " | ".join(cells) + " |"


def comparison(program: Path, without: Path, given: argparse.Namespace) -> Iterator[str]:
    """Yields the lines of the table: every real recording, and the worst drive with a person."""
    yield "| recording | figure | with, m | without, m | ratio | NEES/6 | GOOD beyond 3 sigma |"
    yield "|---|---|---|---|---|---|---|"

    def both(case: Case) -> tuple[Figures, Figures]:
        recording = converted(case, given.cache)
        options = [*case.options, *given.options]
        whole, alone = (figures(run(one, recording, options)) for one in (program, without))
        return whole, alone

    for case in wanted(cases(), given.only):
        if "tum" not in case.name and "udel" not in case.name:  # those are a simulator's
            yield beside(case.name, case.figure, *both(case))
    pairs = {case.name: both(case) for case in wanted(people(given.cache), given.only)}
    if pairs:
        ratios = {name: whole["worst"] / alone["worst"] for name, (whole, alone) in pairs.items()}
        last = max(ratios, key=ratios.__getitem__)
        print(*(f"{x:.2f} {name}" for name, x in ratios.items()), sep="\n", file=sys.stderr)
        wholes, alones = zip(*pairs.values(), strict=True)
        yield beside(
            f"{len(pairs)} with a person, the worst", "worst", *map(worst_of, (wholes, alones))
        )
        yield beside(
            f"of these, the worst ratio: {last.removeprefix('person ')}", "worst", *pairs[last]
        )


def compare_supervisor(program: Path, given: argparse.Namespace) -> None:
    """Prints the table, or puts it where docs/SUPERVISION.md holds it."""
    page = PAGE.read_text(encoding="utf-8")
    if given.write and (given.only or not MARKED.search(page)):
        sys.exit(
            "--write: not beside --only"
            if given.only
            else f"{PAGE}: holds no `<!-- table: recordings, by judge.py -->` and `<!-- end -->`"
        )
    without = (given.bin_without or built_without()) / program.name
    lines = []
    for line in comparison(program, without, given):
        print(line, flush=True)
        lines.append(line + "\n")
    if given.write:
        text = MARKED.sub(lambda found: found[1] + "".join(lines) + found[2], page)
        PAGE.write_text(text, encoding="utf-8")


# --- the table ------------------------------------------------------------------------------------


def parser_of(about: str | None, only: str) -> argparse.ArgumentParser:
    """Returns the options that the harnesses of recordings share."""
    parser = argparse.ArgumentParser(
        description=about, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    cache = Path(tempfile.gettempdir()) / "pelorus-recordings"
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--only", default="", help=only)
    parser.add_argument("--cache", type=Path, default=cache, help="of converted recordings")
    return parser


def wanted(some: Iterator[Case], only: str) -> Iterator[Case]:
    """Yields the cases that are named, and whose recording exists."""
    return (case for case in some if only in case.name and (DATA / case.file).exists())


def judged(programs: Sequence[Path], case: Case, given: argparse.Namespace) -> list[Figures]:
    """Returns the figures of each program."""
    recording = converted(case, given.cache)
    out = []
    for program in programs:
        found = figures(run(program, recording, [*case.options, *given.options]))
        alone = figures(run(program, recording, [*case.options, "--mode", "dead_reckoning"]))
        found["reckoned"] = alone.get("ATE", np.nan)
        found["ratio"] = found["ATE"] / found["reckoned"]
        out.append(found)
    if len(out) == 2:
        out[0]["f32/f64"] = out[0]["ATE"] / out[1]["ATE"]
    return out


def print_rows(name: str, found: Sequence[Figures]) -> None:
    """Prints a row for each precision."""
    for title, one in zip((name, "  in float64"), found, strict=False):
        row = "".join(f"{one.get(column, np.nan):9.3g}" for column in COLUMNS)
        print(f"{title:28}{row}", flush=True)


def main() -> int:
    """Prints the table."""
    parser = parser_of(__doc__, "recordings whose name contains it")
    precision = parser.add_mutually_exclusive_group()
    precision.add_argument("--f64", action="store_true")
    precision.add_argument("--both", action="store_true")
    parser.add_argument("--without", choices=("supervisor",))
    parser.add_argument("--bin-without", type=Path)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("options", nargs="*")
    given = parser.parse_args()
    given.cache.mkdir(exist_ok=True)
    names = ["pelorus-replay-f64"] if given.f64 else ["pelorus-replay"]
    if given.without:
        compare_supervisor(given.bin / names[0], given)
        return 0
    programs = [given.bin / name for name in (*names, *(["pelorus-replay-f64"] * given.both))]
    print(f"{'recording':28}" + "".join(f"{name:>9}" for name in COLUMNS))
    for case in wanted(cases(), given.only):
        print_rows(case.name, judged(programs, case, given))
    if not given.only or "person" in given.only:
        drives = [judged(programs, case, given) for case in wanted(people(given.cache), given.only)]
        if drives:
            print_rows(
                f"person, worst of {len(drives)}",
                [worst_of(one) for one in zip(*drives, strict=True)],
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
