# SPDX-License-Identifier: MIT
"""What the filter costs on each board: docs/SIZES.md, made and compared.

usage: PYTHONPATH=tools python -m firmware.sizes recordings FOLDER
       PYTHONPATH=tools python -m firmware.sizes write|check BUILD_FOLDER DOCUMENT N...

`recordings` makes what the bench images carry, twist.plr and imu.plr. `write` measures the images
of these capacities in a build folder and writes the document; `check` measures, and compares with
the document's rows of these capacities. tools/sizes.sh calls them in order.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import numpy as np
from pelorus.errors import PelorusError
from pelorus.program.console import err, out, progress
from pelorus.robot.emulator import MACHINES
from pelorus.wire.frames import Kind, Message, Stereo
from pelorus.wire.framing import Writer, read_file
from scipy.optimize import nnls

from firmware.image import measured
from firmware.stack import image_bound

FRAME_OBSERVATIONS = 20
BUSY_OBSERVATIONS = 60
# Of the two drives, which fit into a board's flash beside the filter, with some KB to spare.
SECONDS = {FRAME_OBSERVATIONS: "12", BUSY_OBSERVATIONS: "10.5"}
SEED = "31"
TOLERANCE = 0.03
PROCESSORS = {"mps2_an386": "m4f", "mps2_an500": "m7", "mps3_an547": "m55", "stm32f405": "m4f"}


@dataclass(frozen=True)
class Process:
    """What moves the body between frames."""

    name: str
    options: tuple[str, ...]  # of `pelorus simulate`
    step: str  # the bench image's name of a reading
    core: int  # rows of the state before the landmarks


# By their number in a HEADER.
PROCESSES = {
    0: Process("twist", (), "predict", 12),
    1: Process("imu", ("--imu-rate", "200"), "reading", 15),
}


# --- the recording -------------------------------------------------------------------------------


def write_recording(process: Process, target: Path) -> None:
    """Writes two drives one after the other: every frame of 20 observations, then the busiest
    possible.

    A file that holds them already is left alone: images are made of it.
    """
    parts = []
    for observations, seconds in SECONDS.items():
        part = target.with_suffix(f".{observations}.plr")
        command = [sys.executable, "-m", "pelorus", "simulate", str(part), "--force"]
        command += ["--seed", SEED, "--duration", seconds]
        command += ["--observations", str(2 * BUSY_OBSERVATIONS)]
        command += process.options
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        messages = [frame.message for frame in read_file(part)[0]]
        with part.open("wb") as stream:
            writer = Writer(stream)
            for message in thinned(messages, observations):
                writer.write(message)
            writer.end()
        parts.append(part)
    content = b"".join(part.read_bytes() for part in parts)
    if not target.exists() or target.read_bytes() != content:
        target.write_bytes(content)
    for part in parts:
        part.unlink()


def thinned(messages: list[Message], observations: int) -> list[Message]:
    """Keeps so many observations a frame, with continued tracks before new ones."""
    kept: set[int] = set()
    result: list[Message] = []
    for message in messages:
        if message.kind in (Kind.END, Kind.TRUTH):
            continue
        if isinstance(message, Stereo):
            goes_on = np.array([int(i) in kept for i in message.ids], bool)
            chosen = np.sort(np.argsort(~goes_on, kind="stable")[:observations])
            kept = {int(i) for i in message.ids[chosen]}
            result.append(Stereo(message.t_ns, message.ids[chosen], message.pixels[chosen]))
        else:
            result.append(message)
    return result


# --- one image -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Update:
    """The content and the cost of one frame."""

    instructions: float
    observations: int
    matched: int
    used: int
    created: int
    active: int


@dataclass(frozen=True)
class Run:
    """The costs of one process's drives."""

    steps: list[float] = field(default_factory=list)
    updates: list[Update] = field(default_factory=list)

    @property
    def full(self) -> list[float]:
        """Returns the frames of 20 observations."""
        return [u.instructions for u in self.updates if u.observations == FRAME_OBSERVATIONS]

    @property
    def spread(self) -> float:
        """Returns worst over median among frames with equal counts."""
        groups: dict[tuple[int, ...], list[float]] = {}
        for update in self.updates:
            key = (update.observations, update.matched, update.used, update.created, update.active)
            groups.setdefault(key, []).append(update.instructions)
        return max((max(group) / median(group) for group in groups.values()), default=1.0)


@dataclass(frozen=True)
class Bench:
    """The output of a bench image."""

    filter_bytes: int
    session_bytes: int
    stack_bytes: int
    run: Run


def run_bench(board: str, image: Path) -> Bench:
    """Runs the image, and reads its lines."""
    found = measured(board, image)
    sizes, per_clock = found.sizes, found.instructions_per_clock
    run = Run()
    process = PROCESSES[0]
    for row in found.rows:
        if "process" in row:
            process = PROCESSES[row["process"]]
        elif process.step in row:
            run.steps.append(row[process.step] * per_clock)
        else:
            instructions = row.pop("update") * per_clock
            row.pop("evicted")
            run.updates.append(Update(instructions, **row))
    return Bench(sizes["filter"], sizes["session"], found.stack_bytes, run)


@dataclass(frozen=True)
class Cost:
    """A row of the document."""

    board: str
    capacity: int
    flash: int
    ram: int
    filter: int
    session: int
    stack_bound: int
    stack_seen: int
    runs: dict[str, Run]


def section_sizes(image: Path) -> tuple[int, int]:
    """Returns flash and RAM of an image, in bytes; RAM with its stack."""
    table = subprocess.run(
        ["arm-none-eabi-size", str(image)], capture_output=True, text=True, check=True
    ).stdout
    text, data, bss = map(int, table.splitlines()[1].split()[:3])
    return text + data, data + bss


def objects_of(firmware: Path, board: str, capacity: int, bits: int = 32) -> list[Path]:
    """Returns the folders of an image's object files."""
    library = f"pelorus-{PROCESSORS[board]}-n{capacity}-f{bits}"
    folder = firmware.parents[1] / "CMakeFiles"
    return [folder / f"{name}.dir" for name in (library, f"port-{board}", firmware.stem)]


def measure(build: Path, board: str, capacity: int) -> Cost:
    """Measures one board and capacity."""
    firmware = build / "images" / f"pelorus-{board}-n{capacity}.elf"
    flash, ram = section_sizes(firmware)
    benches = {
        process.name: run_bench(
            board, build / "images" / f"bench-{process.name}-{board}-n{capacity}.elf"
        )
        for process in PROCESSES.values()
    }
    bench = next(iter(benches.values()))
    return Cost(
        board=board,
        capacity=capacity,
        flash=flash,
        ram=ram,
        filter=bench.filter_bytes,
        session=bench.session_bytes - bench.filter_bytes,
        stack_bound=image_bound(firmware, objects_of(firmware, board, capacity)).stack_bytes,
        stack_seen=max(each.stack_bytes for each in benches.values()),
        runs={name: each.run for name, each in benches.items()},
    )


# --- the bound -----------------------------------------------------------------------------------

TERMS = ("1", "m", "m n", "n^2", "b n", "b n^2")


def terms(process: Process, capacity: int, observations: int) -> list[float]:
    """Returns the terms of the bound; n is the state's dimension, b the number of blocks."""
    n = process.core + 3 * capacity
    blocks = -(-min(observations, capacity) // 8)
    return [1.0, observations, observations * n, n * n, blocks * n, blocks * n * n]


def fit_bound(process: Process, costs: list[Cost]) -> list[float]:
    """Returns coefficients just large enough for the worst frame of any board."""
    worst: dict[tuple[int, int], float] = {}
    for cost in costs:
        for update in cost.runs[process.name].updates:
            key = (cost.capacity, update.observations)
            worst[key] = max(worst.get(key, 0.0), update.instructions)
    rows = np.array([terms(process, *key) for key in worst])
    values = np.array(list(worst.values()))
    coefficients, _ = nnls(rows / values[:, None], np.ones(len(values)))
    short_by = max(values / (rows @ coefficients))
    return [float(np.ceil(c * max(1.0, short_by) * 10)) / 10 for c in coefficients]


# --- the document --------------------------------------------------------------------------------

BOUND = "its bound"  # fitted to all capacities, so fewer of them give another one
MEMORY_TITLE = "board | N | flash | RAM | filter | session | stack, bound | stack, seen"
TIME_TITLE = (
    "board | N | {step}, median | worst | frame of 20, median | worst | worst / median at the "
    f"same counts | busiest frame | {BOUND}"
)


def document(costs: list[Cost]) -> str:
    """Returns the text of docs/SIZES.md."""
    memory = [
        f"| {cost.board} | {cost.capacity} | {cost.flash} | {cost.ram} | {cost.filter} | "
        f"{cost.session} | {cost.stack_bound} | {cost.stack_seen} |"
        for cost in costs
    ]
    parts = {
        f"{process.name}_{part}": text
        for process in PROCESSES.values()
        for part, text in zip(("time", "formula"), time_of(process, costs), strict=True)
    }
    return TEMPLATE.format(
        memory="\n".join((_title(MEMORY_TITLE), *memory)),
        tolerance=f"{TOLERANCE:.0%}",
        busy=BUSY_OBSERVATIONS,
        spread_limit=SPREAD_LIMIT,
        **parts,
    )


def time_of(process: Process, costs: list[Cost]) -> tuple[str, str]:
    """Returns the table of a process, and the bound of its frames."""
    bound = fit_bound(process, costs)
    lines = [_title(TIME_TITLE.format(step=process.step))]
    for cost in costs:
        run = cost.runs[process.name]
        busiest = max(update.instructions for update in run.updates)
        limit = float(np.dot(bound, terms(process, cost.capacity, BUSY_OBSERVATIONS)))
        lines.append(
            f"| {cost.board} | {cost.capacity} | {median(run.steps):.0f} | {max(run.steps):.0f} | "
            f"{median(run.full):.0f} | {max(run.full):.0f} | {run.spread:.3f} | {busiest:.0f} | "
            f"{limit:.0f} |"
        )
    formula = " + ".join(
        f"{c:g} {name}" if name != "1" else f"{c:g}"
        for c, name in zip(bound, TERMS, strict=True)
        if c
    )
    return "\n".join(lines), formula


def _title(names: str) -> str:
    count = names.count("|") + 1
    return f"| {names} |\n|---|{'---:|' * (count - 1)}"


# The search for a frame's motion takes one to six evaluations, so frames of the same counts may
# differ.
SPREAD_LIMIT = 1.1

TEMPLATE = """# What it costs

Made by `tools/sizes.sh`; `tools/sizes.sh --check` measures again and fails where a number has moved
by more than {tolerance} (stack seen: 64 bytes; worst / median: never above {spread_limit}).
The images are float32, bias on, blocks of 8, at most 128 observations a frame (64 for N = 8 and
16), with every room of the library; compiler `arm-none-eabi-gcc` 12.2, what frames are spent in at
-O3, the rest and what few frames need (`PLR_SELDOM`) at -Os (`port/cortex_m/cmake/CortexM.cmake`).

## Memory

In bytes. *Flash*: code, constants and initial values. *RAM*: everything static, with the stack of
8 KB, its guard, both rings of the link (4 KB each), telemetry (MAVLink) and 64 known landmarks.
*Filter* is `sizeof(plr_filter)`, the state with its workspace; *session* is what the loop adds to
it: wire buffers, messages, held twists. *Stack, bound* is the deepest chain of calls that there can
be, from the compiler's own account (`-fstack-usage`, call graph; calls through pointers are
resolved by the table in `tools/firmware/stack.py`; no recursion, no frame without a
bound) with one interrupt on top. *Stack, seen* is what the bench image used,
without interrupts and session.

{memory}

Without the front end, and before the linker leaves out what nobody calls, all of it at -Os for a
Cortex-M7 (N = 32) has 144476 bytes:

    arm-none-eabi-gcc -Os -mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16 -std=c99 \\
        -ffp-contract=off -fno-math-errno -I$ROOT/include -I$ROOT/src -c \\
        $(ls $ROOT/src/*/*.c | grep -v vision) && arm-none-eabi-size -t *.o

There is no heap and no stdio: the linker refuses `malloc`, `printf` and their like, and the library
has no writable globals (`tests/layering`).

## Instructions

Instructions, **not cycles**: QEMU counts them (`-icount shift=0`) and knows neither caches nor wait
states nor dual issue. They repeat exactly; the resolution is one tick of SysTick, 40 instructions
on MPS2. A recording is part of each image: simulated drives with a frame every 100 ms, first with
exactly 20 observations in each frame, then with up to {busy}; in one image with a twist every
10 ms, in the other with a reading of an IMU every 5 ms.

A frame of these drives costs at most what stands below its table, in instructions, with m
observations in the frame, n rows of the state (12 + 3 N with twists, 15 + 3 N with an IMU), and
b = min(m, N) / 8 blocks, rounded up. The coefficients are fitted to the worst frames of all boards
and scaled until none is above; *its bound* is the formula at m = {busy}, beside the busiest frame
that was met. Every loop has a count that N and m bound, and a library function that is not of
constant time for such a count does not exist in it; so there is a worst case. It is above the
formula, for how often the search for the motion goes round depends on what is in a frame: of 3338
frames that no front end would make, of up to 60 observations and N = 32 by twists on mps2_an386,
the costliest takes 3.75 million instructions, 1.61 times the formula (half of the points move by
themselves, or the pictures exclude the odometry: `tests/independent/bounded.py`). Plan with twice
the formula.
After frames that were lost in a fast turn the motion is searched for once more, in at most 17
evaluations of all points (`search_by_agreement`). A pose that is found from known landmarks,
because it was lost or is too uncertain for them (`src/known_map/placing.c`), takes at most 40
samples of three and asks 64 landmarks at most: with wrong ones among 20 as much as one and a half
of such frames, among 64 as much as three (compared at the desk). None of these is in these frames.

### With twists

{twist_time}

A predict costs the same for every N. A frame of these drives costs at most

    {twist_formula}

### With an IMU

{imu_time}

A reading costs the same for every N. A frame of these drives costs at most

    {imu_formula}
"""


Numbers = dict[tuple[str, str], dict[str, float]]


def numbers(text: str) -> Numbers:
    """Returns the numbers of a row by column title, for each (board and capacity, table)."""
    rows: Numbers = {}
    titles: list[str] = []
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[0] == "board":
            titles = cells
        elif cells[0] in MACHINES:
            values = map(float, cells[2:])
            names = [f"{k}: {name}" for k, name in enumerate(titles[2:])]
            rows[f"{cells[0]} N={cells[1]}", titles[2]] = dict(zip(names, values, strict=True))
    return rows


def differences(old: str, new: str, capacities: list[int]) -> list[str]:
    """Returns what differs by more than the tolerance, or is missing, at these capacities."""
    all_of_them, now = numbers(old), numbers(new)
    ends = tuple(f"={n}" for n in capacities)  # of "board N=32"
    before = {key: row for key, row in all_of_them.items() if key[0].endswith(ends)}
    in_part = len(before) < len(all_of_them)
    found = [
        f"{row}, {table}: in the document, and not measured"
        for row, table in before.keys() - now.keys()
    ]
    found += [
        f"{row}, {table}: measured, and not in the document"
        for row, table in now.keys() - before.keys()
    ]
    for row, table in before.keys() & now.keys():
        for name, is_now in now[row, table].items():
            was = before[row, table].get(name, 0.0)
            title = name.partition(": ")[2]
            if title == BOUND and in_part:
                continue
            allowed = 64.0 if title == "stack, seen" else TOLERANCE * was
            if abs(is_now - was) > allowed:
                found.append(f"{row}, {table}: {title}: {was:g} in the document, {is_now:g} now")
    return sorted(found)


def measure_all(build: Path, capacities: list[int]) -> list[Cost]:
    """Measures every firmware image of these capacities with a bench image and an emulator."""
    found = []
    for path in (build / "images").glob(f"bench-{PROCESSES[0].name}-*-n*.elf"):
        _, _, board, capacity = path.stem.split("-")
        if int(capacity[1:]) in capacities and board in MACHINES:
            found.append((list(MACHINES).index(board), int(capacity[1:]), board))
    if not found:
        raise PelorusError(f"{build}/images: no bench images; tools/sizes.sh builds them")
    return [measure(build, board, n) for _, n, board in progress(sorted(found), "measuring")]


def main(arguments: list[str]) -> int:
    """Runs the command that the module's text describes."""
    match arguments:
        case ["recordings", folder]:
            for process in PROCESSES.values():
                write_recording(process, Path(folder) / f"{process.name}.plr")
        case ["write", build, path, *named]:
            capacities = [int(n) for n in named]
            Path(path).write_text(document(measure_all(Path(build), capacities)))
        case ["check", build, path, *named]:
            if not Path(path).exists():
                raise PelorusError(f"{path}: no such file; tools/sizes.sh makes it")
            capacities = [int(n) for n in named]
            costs = measure_all(Path(build), capacities)
            wrong = differences(Path(path).read_text(), document(costs), capacities)
            wrong += [
                f"{cost.board} N={cost.capacity}, {process}: worst / median {run.spread:.3f} is"
                f" above {SPREAD_LIMIT}"
                for cost in costs
                for process, run in cost.runs.items()
                if run.spread > SPREAD_LIMIT
            ]
            for line in wrong:
                err.print(line)
            if wrong:
                err.print(f"{path} is out of date, or something got dearer: tools/sizes.sh")
                return 1
            out.print(f"{path}: {len(costs)} images, every number within its tolerance")
        case _:
            err.print(__doc__)
            return 2
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except PelorusError as error:
        err.print(f"error: {error}")
        sys.exit(1)
