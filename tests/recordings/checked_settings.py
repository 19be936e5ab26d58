# SPDX-License-Identifier: MIT
"""What does `pelorus check` write, and does another tree's write the same?

usage: checked_settings.py OUT.json [--against OTHER.json] [--only TEXT] [--bin build/bin]

The recordings are those of judge.py, and simulated drives by twists and by an IMU, some of them
with a clock or a baseline that is off. Each is checked from bare settings. OUT.json has for each
the settings, the verdict, the figures and the CPU; with --against what differs is printed. Where a
change of `check` is meant to change nothing, nothing but CPU may differ. It takes about ten
minutes.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]

import judge  # noqa: E402
from pelorus.check.contents import shifted  # noqa: E402
from pelorus.wire import framing  # noqa: E402
from pelorus.wire.frames import Kind  # noqa: E402

MS = 1_000_000
# seed, options of `pelorus simulate`, and by how much the camera's clock is late, ms
DRIVES: tuple[tuple[int, tuple[str, ...], int], ...] = (
    *((seed, (), 0) for seed in range(7000, 7008)),
    (7100, (), 0),
    (7000, (), 12), (7001, (), 30), (7002, (), -50), (7003, (), 100),
    (8000, ("--baseline-error", "3"), 0), (8001, ("--baseline-error", "-5"), 0),
    *((seed, ("--imu-rate", "200"), 0) for seed in range(7200, 7204)),
    (7200, ("--imu-rate", "200"), 10),
    (7201, ("--imu-rate", "200"), -30),
    (7202, ("--imu-rate", "200"), 100),
)  # fmt: skip
COMPARED = ("settings", "verdict", "figures")


def simulated(folder: Path, only: str) -> Iterator[tuple[str, Path]]:
    """Yields name and file of each simulated drive whose name has `only` in it."""
    for seed, options, late_ms in DRIVES:
        name = " ".join((f"seed {seed}", *options, *([f"late {late_ms} ms"] if late_ms else [])))
        if only not in name:
            continue
        path = folder / f"{name.replace(' ', '_')}.plr"
        words = ["--duration", "40", "--seed", str(seed), *options]
        pelorus("simulate", str(path), *words)
        if late_ms:
            kept = [m for m in framing.messages_of(path) if m.kind != Kind.END]
            framing.write_file(path, shifted(kept, late_ms * MS))
        yield name, path


def recorded(folder: Path, only: str) -> Iterator[tuple[str, Path]]:
    """Yields the same of the recordings of judge.py that are there, each once."""
    for case in {case.file: case for case in judge.cases()}.values():
        if only in case.file and (judge.DATA / case.file).exists():
            yield case.file, judge.converted(case, folder)


def pelorus(*words: str) -> str:
    """Runs the command; returns what it wrote."""
    command = [sys.executable, "-m", "pelorus", *words]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    if not said.stdout:
        sys.exit(f"{' '.join(words)}: {said.stderr}")
    return said.stdout


def checked(path: Path, programs: Path) -> dict[str, Any]:
    """Returns what `pelorus check` finds, with its CPU in s."""
    was = os.times()
    out = path.with_suffix(".conf")
    said = json.loads(
        pelorus("check", str(path), "--out", str(out), "--force", "--json", "--bin", str(programs))
    )
    now = os.times()
    cpu_s = now.children_user + now.children_system - was.children_user - was.children_system
    return {name: said.get(name) for name in COMPARED} | {"cpu_s": round(cpu_s, 1)}


def compare(found: dict[str, Any], other: dict[str, Any]) -> None:
    """Prints what differs, and the CPU of both."""
    both = found.keys() & other.keys()
    for name in sorted(both):
        for what in COMPARED:
            if found[name][what] != other[name][what]:
                print(f"{name}: {what} {other[name][what]} -> {found[name][what]}")
    spent = [sum(one[name]["cpu_s"] for name in both) for one in (other, found)]
    print(f"{len(both)} compared, CPU {spent[0]:.0f} -> {spent[1]:.0f} s")


def main() -> None:
    """Checks, writes, and compares."""
    parser = argparse.ArgumentParser(description="what `pelorus check` writes")
    parser.add_argument("out", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    asked = parser.parse_args()
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for source in (simulated, recorded):
            for name, path in source(Path(folder), asked.only):
                found[name] = checked(path, asked.bin)
                print(f"{name}: {found[name]['verdict']}", file=sys.stderr, flush=True)
                asked.out.write_text(json.dumps(found, indent=1), encoding="utf-8")
    if asked.against is not None:
        compare(found, json.loads(asked.against.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main()
