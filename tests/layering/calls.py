#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Reads gcc's call graph of src/: nobody calls himself, by whatever way, and every stack frame has
a bound that is known when it is compiled.

usage: calls.py PROJECT_ROOT

Calls through a pointer (a model's table, the map, the port) are not in the graph; none of them goes
back into the caller by design. Exit status 77 (skipped) without gcc.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

SKIPPED = 77
FLAGS = ["-std=c99", "-O1", "-ffp-contract=off", "-fno-math-errno", "-fcallgraph-info=su"]
FLAGS += ["-DPLR_PORTABLE=1"]  # for any processor
NODE = re.compile(r'node: { title: "([^"]+)" label: "[^"]*?(\d+) bytes \(([a-z,]+)\)')
EDGE = re.compile(r'edge: { sourcename: "([^"]+)" targetname: "([^"]+)"')


def call_graph(root: Path, source: Path, folder: Path) -> str:
    """What gcc writes about one file."""
    output = folder / f"{source.parent.name}-{source.stem}.o"
    includes = [f"-I{root / 'include'}", f"-I{root / 'src'}"]
    subprocess.run(["gcc", *FLAGS, *includes, "-c", source, "-o", output], check=True)
    return output.with_suffix(".ci").read_text(encoding="utf-8")


def find_cycle(calls: dict[str, set[str]]) -> list[str]:
    """A chain of calls that ends where it began, or nothing."""
    done: set[str] = set()
    for start in calls:
        path: list[str] = []
        steps = [iter([start])]
        while steps:
            name = next(steps[-1], None)
            if name is None:
                steps.pop()
                if path:
                    done.add(path.pop())
            elif name in path:
                return [*path[path.index(name) :], name]
            elif name not in done:
                path.append(name)
                steps.append(iter(calls.get(name, ())))
    return []


def main() -> int:
    """Compiles everything and judges; the exit status."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    if not shutil.which("gcc"):
        print("skipped: no gcc")
        return SKIPPED
    root = Path(sys.argv[1]).resolve()
    sources = sorted((root / "src").glob("*/*.c"))
    with tempfile.TemporaryDirectory(prefix="pelorus-calls-") as folder:
        graphs = [call_graph(root, source, Path(folder)) for source in sources]
    calls: dict[str, set[str]] = {}
    frames: list[tuple[int, str]] = []
    breaches = 0
    for graph in graphs:
        for caller, callee in EDGE.findall(graph):
            calls.setdefault(caller, set()).add(callee)
        for name, size, kind in NODE.findall(graph):
            frames.append((int(size), name))
            if kind == "dynamic":
                print(f"{name}: its stack frame has no bound that is known beforehand")
                breaches += 1
    if cycle := find_cycle(calls):
        print("recursion:", " -> ".join(cycle))
        breaches += 1
    print(f"{len(frames)} functions, {breaches} breaches; the largest frames, in bytes:")
    for size, name in sorted(frames, reverse=True)[:5]:
        print(f"  {size:6} {name.rpartition(':')[2]}")
    return 1 if breaches or not frames else 0


if __name__ == "__main__":
    sys.exit(main())
