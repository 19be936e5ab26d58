#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Builds pelorus-replay for other systems, runs what this machine can run, and compares the bits.

usage: cross.py [--out FOLDER] [--compile-only] [SYSTEM...]

The compiler is the one of the package ziglang. It is given the library as one file (amalgamate.py)
and the replay as another. Each program that can be run here, by qemu-user, by the package wasmtime
or by wine, replays a simulated recording of twists and one of an IMU; the SHA-256 of the
trajectories must be that of build/bin/pelorus-replay, or of the first target where there is none.
With --compile-only nothing is linked or run, and no library of a system built, which takes minutes.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import amalgamate

ROOT = Path(__file__).resolve().parents[1]
NATIVE = ROOT / "build/bin/pelorus-replay"
COMMON = (
    *("-std=c99", "-ffp-contract=off", "-fno-math-errno", "-fno-sanitize=all", "-g0"),
    *("-DPLR_MAX_LANDMARKS=256", "-DPLR_MAX_OBSERVATIONS=1024", "-DPLR_MAX_CALIBRATION=11"),
    *("-DPLR_VISION_PIXELS=3145728", "-DPLR_VISION_TRACKS=400"),
)
WARNINGS = ("-Wall", "-Wextra", "-Werror")
RECORDINGS = {
    "twists": ("--seed", "3", "--duration", "4", "--observations", "25"),
    "imu": ("--seed", "4", "--duration", "4", "--observations", "25", "--imu-rate", "200"),
}
SETTINGS = ("--slots", "20", "--quiet")

Run = Callable[[Path, Sequence[str], Path], None]


@dataclass(frozen=True)
class Target:
    """A system: zig's name of it, the library's flags, and the program that runs it here."""

    triple: str
    library: tuple[str, ...] = ()
    program: str = "pelorus-replay"
    runner: str = ""  # a program that runs it; empty: it runs as it is
    level: int = 3  # of optimisation

    @property
    def windows(self) -> bool:
        return "windows" in self.triple


X86_64_V3 = ("-mcpu=x86_64_v3",)
PORTABLE = ("-DPLR_PORTABLE=1",)
RELAXED = ("-mcpu=generic+simd128+relaxed_simd",)
WASM = "pelorus-replay.wasm"
TARGETS = {
    "linux-x86_64": Target("x86_64-linux-gnu.2.17", X86_64_V3),
    "linux-aarch64": Target("aarch64-linux-musl", runner="qemu-aarch64-static"),
    "linux-riscv64": Target("riscv64-linux-musl", runner="qemu-riscv64-static"),
    "windows-x86_64": Target("x86_64-windows-gnu", X86_64_V3, "pelorus-replay.exe", "wine64"),
    "macos-x86_64": Target("x86_64-macos", X86_64_V3, runner="-"),
    "macos-aarch64": Target("aarch64-macos", runner="-"),
    "wasi": Target("wasm32-wasi", PORTABLE, WASM, "wasmtime"),
    "wasi-relaxed": Target("wasm32-wasi", RELAXED, WASM, "wasmtime"),
}


def compile_to(output: Path, source: Path, target: Target, flags: Sequence[str]) -> None:
    """Compiles one file, and links it where the output is no object."""
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", target.triple]
    command = [*zig, f"-O{target.level}", *COMMON, *flags]
    done = subprocess.run(
        [*command, str(source), "-o", str(output)], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise SystemExit(f"{target.triple}: {source.name} does not compile:\n{done.stderr[:4000]}")


def replay_sources(target: Target) -> list[Path]:
    """Returns the sources of pelorus-replay, without libzstd, for this system."""
    other = "posix" if target.windows else "windows"
    left_out = {"compressed_zstd.c", f"system_{other}.c", "pictures_none.c"}
    return sorted(p for p in (ROOT / "port/posix").glob("*.c") if p.name not in left_out)


def build_library(target: Target, folder: Path, bits: int = 32) -> Path:
    """Builds the library in this precision, as an object file in the folder, with its sources."""
    folder.mkdir(parents=True, exist_ok=True)
    header, library = amalgamate.library(ROOT)
    (folder / "pelorus.h").write_text(header, encoding="utf-8")
    (folder / "pelorus.c").write_text(library, encoding="utf-8")
    made = folder / f"pelorus-{bits}.o"
    pic = [] if target.windows or ".wasm" in target.program else ["-fPIC"]
    flags = [*WARNINGS, *target.library, *pic, real(bits), "-c"]
    compile_to(made, folder / "pelorus.c", target, flags)
    return made


def real(bits: int) -> str:
    """Returns the option for the precision."""
    return f"-DPLR_REAL={bits}"


def port_flags(target: Target, bits: int) -> list[str]:
    """Returns the library's options for the files of `port`."""
    arch = "x86-64-v3" if X86_64_V3[0] in target.library else ""
    return [*WARNINGS, real(bits), f'-DPELORUS_ARCH="{arch}"']


def write_replay(target: Target, folder: Path) -> Path:
    """Writes the program's source, one file, into the folder."""
    replay = amalgamate.program(ROOT, replay_sources(target))
    (source := folder / "replay.c").write_text(replay, encoding="utf-8")
    return source


def program_flags(target: Target, bits: int, name: str) -> list[str]:
    """Returns the options for the program's source."""
    names = [f'-DPELORUS_NAME="{name}"', "-D_XOPEN_SOURCE=700"]
    large = ["-D_FILE_OFFSET_BITS=64"] if target.windows else []
    return [*port_flags(target, bits), *names, *large]


def compile_only(target: Target, folder: Path, bits: int = 32) -> None:
    """Compiles library and program, and links nothing."""
    build_library(target, folder, bits)
    flags = [*program_flags(target, bits, "pelorus-replay"), "-c"]
    compile_to(folder / "replay.o", write_replay(target, folder), target, flags)


def build(target: Target, folder: Path, bits: int = 32) -> Path:
    """Builds the program in the folder."""
    library = build_library(target, folder, bits)
    program = folder / target.program.replace("replay", "replay-f64" if bits == 64 else "replay")
    objects = [str(library), *([] if target.windows else ["-lm"]), "-s"]
    flags = [*program_flags(target, bits, program.stem), *objects]
    compile_to(program, write_replay(target, folder), target, flags)
    return program


def runner_of(target: Target) -> str | None:
    """Returns the program that runs it, where there is one; Debian hides wine."""
    return shutil.which(target.runner, path=f"{os.environ.get('PATH', '')}:/usr/lib/wine")


def run_program(target: Target, program: Path, words: Sequence[str], folder: Path) -> None:
    """Runs it in the folder."""
    if target.runner == "wasmtime":
        run_wasm(program, words, folder)
        return
    command = [found] if (found := runner_of(target)) else []
    home = {"WINEPREFIX": str(program.parent / "wine"), "WINEDEBUG": "-all"}  # where it needs them
    subprocess.run(
        [*command, str(program), *words],
        cwd=folder, check=True, stdout=subprocess.DEVNULL, env=os.environ | home,
    )  # fmt: skip


def run_wasm(program: Path, words: Sequence[str], folder: Path) -> None:
    """Runs it by wasmtime, which gives it the folder."""
    import wasmtime  # noqa: PLC0415 - only where it is needed

    engine = wasmtime.Engine()
    linker = wasmtime.Linker(engine)
    linker.define_wasi()
    system = wasmtime.WasiConfig()
    system.argv = ["pelorus-replay", *words]
    system.preopen_dir(str(folder), ".")
    system.inherit_stderr()
    store = wasmtime.Store(engine)
    store.set_wasi(system)
    instance = linker.instantiate(store, wasmtime.Module.from_file(engine, str(program)))
    start = instance.exports(store)["_start"]
    try:
        start(store)  # type: ignore[operator]
    except wasmtime.ExitTrap as ended:
        if ended.code != 0:
            raise SystemExit(f"wasmtime: pelorus-replay ended with status {ended.code}") from ended


def can_run(target: Target) -> bool:
    """Returns whether this machine has what runs it."""
    if target.runner == "wasmtime":
        return subprocess.run(
            [sys.executable, "-c", "import wasmtime"], capture_output=True, check=False
        ).returncode == 0  # fmt: skip
    return not target.runner or runner_of(target) is not None


def digest(run: Callable[[Sequence[str]], None], folder: Path) -> str:
    """Returns SHA-256 over the trajectories of all recordings."""
    sums = hashlib.sha256()
    for name in RECORDINGS:
        run([f"{name}.plr", *SETTINGS, "--trajectory", f"{name}.tum"])
        text = (folder / f"{name}.tum").read_bytes()
        if (poses := len(text.splitlines())) < 20:
            raise SystemExit(f"{name}: a trajectory of {poses} poses proves nothing")
        sums.update(text)
        (folder / f"{name}.tum").unlink()
    return sums.hexdigest()


def simulate(folder: Path) -> None:
    """Simulates the recordings anew."""
    for name, words in RECORDINGS.items():
        command = [sys.executable, "-m", "pelorus", "simulate", *words, str(folder / f"{name}.plr")]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def asked_for(
    what: str, known: Iterable[str], folder: str, flags: Sequence[str] = ()
) -> argparse.Namespace:
    """Parses the command line: `out`, where to build; `systems`, all where none is named; flags."""
    names = list(known)
    parser = argparse.ArgumentParser(description=what.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / folder, help="where to build")
    for flag in flags:
        parser.add_argument(flag, action="store_true")
    parser.add_argument("systems", nargs="*", metavar="SYSTEM", help=", ".join(names))
    given = parser.parse_args()
    if unknown := sorted(set(given.systems) - set(names)):
        parser.error(f"no system {', '.join(unknown)}; there are {', '.join(names)}")
    given.out.mkdir(parents=True, exist_ok=True)
    given.out = given.out.resolve()
    given.systems = given.systems or names
    return given


def main() -> int:
    """Does what the command line asks for; returns the exit status."""
    given = asked_for(__doc__, TARGETS, "build/cross", ["--compile-only"])
    if given.compile_only:
        for name in given.systems:
            compile_only(TARGETS[name], given.out / name)
            print(f"{name:15} compiled", flush=True)
        return 0
    return compare(given.out, given.systems)


def compare(out: Path, names: Sequence[str]) -> int:
    """Builds, runs and compares the bits; returns the exit status."""
    differ = 0
    with tempfile.TemporaryDirectory(prefix="pelorus-") as temporary:
        folder = Path(temporary)
        simulate(folder)
        wanted = ""
        if NATIVE.is_file():
            native = Target("this machine's")
            wanted = digest(lambda words: run_program(native, NATIVE, words, folder), folder)
            print(f"{'build/bin':15} {wanted[:16]}...")
        for name in names:
            target, begun = TARGETS[name], time.monotonic()
            program = build(target, out / name)
            built = f"{program.stat().st_size // 1024} KB in {time.monotonic() - begun:.0f} s"
            if not can_run(target):
                why = "no such system here" if target.runner == "-" else f"no {target.runner} here"
                print(f"skipped: {name} is built, {built}, and not run: {why}")
                continue

            def run(words: Sequence[str], target: Target = target, program: Path = program) -> None:
                run_program(target, program, words, folder)

            found = digest(run, folder)
            wanted = wanted or found
            differ += found != wanted
            said = "the same" if found == wanted else "NOT the same"
            print(f"{name:15} {found[:16]}... {said}; {built}", flush=True)
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
