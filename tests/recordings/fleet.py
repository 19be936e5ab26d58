# SPDX-License-Identifier: MIT
"""Measures `pelorus fleet`: hundreds of recordings, two workers of which one is killed.

    python tests/recordings/fleet.py FOLDER [--count 300] [--seconds 60] [--long 36000]

FOLDER is filled with simulated drives, if they are not there yet: one is damaged, one is long. The
rows are made by `pelorus fleet` on two workers; one is killed when a tenth of them have
come; then one by one in this process. They must be the same.

The speed-up is told by CPU time, for a busy machine has no other: all CPU of one by one, over half
of all that two workers, their scheduler and the command take together, or over that of the busier
worker, whichever is more. What was lost with the killed worker counts as taken.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import sys
import threading
import time
from pathlib import Path

from pelorus.commands.cli import main as pelorus
from pelorus.fleet import cluster, table
from pelorus.fleet.examine import Work, digest_of_tools, examine
from pelorus.fleet.table import Found, Journal, Row

# A minute each, and judged in a second; and one of ten hours, which is read in pieces.
FEW_POINTS = ("--observations", "15", "--landmarks", "400")
SHORT = (*FEW_POINTS, "--frame-rate", "5", "--twist-rate", "20")
LONG = (*FEW_POINTS, "--frame-rate", "1", "--twist-rate", "5")
MISHAPS: tuple[tuple[str, ...], ...] = (
    (),
    ("--frozen-from", "2", "--frozen-for", "1"),
    ("--dead-encoder-from", "2", "--dead-encoder-for", "1"),
    ("--imu-rate", "100", "--rest", "1"),
)
DAMAGE_EVERY = 9001  # bytes


def make(folder: Path, count: int, seconds: str, long_s: str) -> None:
    """Simulates the drives that are missing."""
    folder.mkdir(exist_ok=True)
    for k in range(count - 2):
        path = folder / f"drive-{k:03}.plr"
        if not path.exists():
            words = ("--seed", str(k), "--duration", seconds, *SHORT)
            pelorus(["simulate", str(path), *words, *MISHAPS[k % len(MISHAPS)]])
    path = folder / "long.plr"
    if not path.exists():
        pelorus(["simulate", str(path), "--duration", long_s, *LONG])
    torn = bytearray((folder / "drive-000.plr").read_bytes())
    for at in range(DAMAGE_EVERY, len(torn), DAMAGE_EVERY):
        torn[at] ^= 0x55
    (folder / "damaged.plr").write_bytes(torn)


def cpu_s() -> float:
    """Returns the CPU time of this process and of the replays that it has waited for."""
    return sum(os.times()[:4])


def peak_mb() -> float:
    """Returns the most memory that this process had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def one_by_one(folder: Path, work: Work) -> dict[str, Row]:
    """Returns the rows as this process makes them, by recording."""
    rows = {}
    for path in sorted(folder.glob("*.plr")):
        about = path.stat()
        found = Found(folder.resolve(), path.name, about.st_size, about.st_mtime_ns)
        rows[path.name] = examine(found, work)
    return rows


def on_two(folder: Path, target: Path, kill_at: int) -> tuple[list[float], list[int]]:
    """Runs the command on two workers; returns each worker's CPU, and whose process was killed."""
    rows, killed, ended = Journal(target.with_name(target.name + ".rows")), [], threading.Event()
    lost: list[float] = []
    with cluster.client_of(None, workers=2) as client:

        def kill_one() -> None:
            while not ended.wait(0.5):
                if sum(1 for _ in rows.rows()) >= kill_at:
                    address, pid = next(iter(client.run(os.getpid).items()))
                    lost.append(client.run(cpu_s, workers=[address])[address])
                    os.kill(pid, signal.SIGKILL)
                    killed.append(pid)
                    return

        watching = threading.Thread(target=kill_one)
        watching.start()
        words = (
            "--out",
            str(target),
            "--no-check",
            "--force",
            "--scheduler",
            client.scheduler.address,
        )
        try:
            pelorus(["fleet", str(folder), *words])
        finally:
            ended.set()
            watching.join()
        peaks = ", ".join(f"{peak:.0f}" for peak in client.run(peak_mb).values())
        print(f"most memory of the workers {peaks} MB", flush=True)
        return [*client.run(cpu_s).values(), *lost], killed


def busiest(workers: list[float]) -> float:
    """Returns the CPU of the busier worker; that of the killed one was the less busy one's."""
    one, other, *lost = workers
    return max(min(one, other) + sum(lost), one, other)


def main() -> int:
    """Measures, prints, and returns whether a row is lost or another one."""
    parser = argparse.ArgumentParser(description="measures pelorus fleet")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seconds", default="60")
    parser.add_argument("--long", default="36000")
    asked = parser.parse_args()
    make(asked.folder, asked.count, asked.seconds, asked.long)
    os.environ |= cluster.ENVIRONMENT
    work = Work(checked=False, tools=digest_of_tools(None))
    target = asked.folder.with_name(asked.folder.name + ".parquet")
    begun_s, was_s = time.monotonic(), time.process_time()  # without the workers', told by them
    workers, killed = on_two(asked.folder, target, asked.count // 10)
    two_wall_s, own_s = time.monotonic() - begun_s, time.process_time() - was_s
    got = {row.recording: row for row in table.read(target)}
    shares = ", ".join(f"{spent:.0f}" for spent in workers)
    print(f"two workers, {len(killed)} killed: {two_wall_s:.0f} s by the clock", flush=True)
    print(f"CPU of workers {shares} s, of scheduler and command {own_s:.0f} s", flush=True)
    begun_s, was_s = time.monotonic(), cpu_s()
    expected = one_by_one(asked.folder, work)
    one_s = cpu_s() - was_s
    print(f"one by one: {time.monotonic() - begun_s:.0f} s by the clock, CPU {one_s:.0f} s")
    lost = sorted(expected.keys() - got.keys())
    other = sorted(name for name in expected.keys() & got.keys() if expected[name] != got[name])
    print(f"{len(got)} rows, lost: {lost}, other than one by one: {other}")
    each_s = max(busiest(workers), (sum(workers) + own_s) / 2)
    print(f"speed-up by CPU: {one_s:.0f} s over {each_s:.0f} s = {one_s / each_s:.2f}")
    return int(bool(lost or other or not killed))


if __name__ == "__main__":
    sys.exit(main())
