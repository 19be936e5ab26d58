# SPDX-License-Identifier: MIT
"""Is the time of a frame bounded, whatever is in it? A world that shares nothing with the other
tests, in numpy alone, and frames that no front end would make, on the emulated board that
docs/SIZES.md is measured on.

usage: bounded.py RECORDING [--seed 1] [--drives 6] [--frames 120]     writes the recording
       bounded.py RECORDING --image IMAGE [--board mps2_an386]         counts, of the image with it

A robot drives at 1 m/s by twists among 4000 points, 10 frames a second of up to 60 points. The
first frames of a drive are usual; then each is of a kind of KINDS. For each kind the instructions
of its costliest frame are held against the bound of docs/SIZES.md for frames that are as full.
Exit status 1 if a frame costs more than MOST times that bound, or a usual one more than it.

    python tests/independent/bounded.py hostile.plr
    cmake -S port/cortex_m -B build/robot --toolchain $PWD/port/cortex_m/toolchain.cmake \\
        -DPELORUS_BENCH_RECORDINGS=$PWD/hostile.plr
    cmake --build build/robot --target bench-hostile-mps2_an386-n32
    PYTHONPATH=tools python tests/independent/bounded.py hostile.plr \\
        --image build/robot/images/bench-hostile-mps2_an386-n32.elf
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pelorus.wire.frames import Camera, Header, Message, Stereo, Twist
from pelorus.wire.framing import write_file

Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
PERIOD_NS, STEPS = 100_000_000, 5
FX, CX, CY, BASELINE_M = 400.0, 320.0, 240.0, 0.12
POINTS, MOST_SEEN, USUAL_FRAMES, SLOTS = 4000, 60, 15, 32
MOST = 2.0  # of the bound: docs/SIZES.md says so
R_CB = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
KINDS = {
    "usual": "",
    "some wrong": "a third of the points is anywhere",
    "most wrong": "four of five",
    "permuted": "ids are exchanged",
    "jumped": "seen from another place: odometry and pictures exclude each other",
    "half jumped": "half of the points move by themselves",
    "new": "no id was seen before",
    "one pixel": "all at one place",
    "line": "all in one row",
    "no parallax": "disparities of zero and below",
    "no numbers": "NaN, infinity, 3e38",
    "doubled": "a third has the same id",
    "after a gap": "a second of frames is lost in a fast turn",
    "at once": "the same picture a nanosecond later",
}
HOSTILE = list(KINDS)[1:]


@dataclass
class World:
    """Points around a robot that drives."""

    rng: np.random.Generator
    points: Floats
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    t_ns: int = 1_000_000_000
    fresh: int = 1_000_000

    def drive(self, rate: float) -> Iterator[Twist]:
        """Moves on by a frame's period, at 1 m/s."""
        for _ in range(STEPS):
            dt = PERIOD_NS / STEPS * 1e-9
            yield Twist(
                self.t_ns,
                np.array([1.0, 0, 0]) + self.rng.normal(0, 0.05, 3),
                np.array([0, 0, rate]) + self.rng.normal(0, 0.005, 3),
            )
            self.t_ns += PERIOD_NS // STEPS
            self.heading += rate * dt
            self.x += dt * np.cos(self.heading)
            self.y += dt * np.sin(self.heading)

    def look(self, aside: float = 0.0, turned: float = 0.0) -> tuple[NDArray[np.uint32], Floats]:
        """Returns ids and pixels (uL, vL, uR, vR) of what is seen from here, or from beside it."""
        c, s = np.cos(self.heading + turned), np.sin(self.heading + turned)
        dx, dy = self.points[:, 0] - self.x, self.points[:, 1] - self.y - aside
        depth, left = c * dx + s * dy, c * dy - s * dx
        near = np.where(depth > 0.6, depth, np.inf)
        u, v = CX - FX * left / near, CY - FX * self.points[:, 2] / near
        inside = (depth > 0.6) & (depth < 40) & (u > 0) & (u < 2 * CX) & (v > 0) & (v < 2 * CY)
        ids = np.flatnonzero(inside)[:MOST_SEEN]
        pixels = np.stack([u, v, u - FX * BASELINE_M / near, v], axis=1)[ids]
        return ids.astype(np.uint32) + 1, pixels + self.rng.normal(0, 1, pixels.shape)

    def anywhere(self, n: int) -> Floats:
        u, v = self.rng.uniform(0, 2 * CX, n), self.rng.uniform(0, 2 * CY, n)
        return np.stack([u, v, u - self.rng.uniform(0, 60, n), v], axis=1)

    def spoil(self, kind: str, ids: NDArray[np.uint32], pixels: Floats) -> None:
        n = len(ids)
        if kind in ("some wrong", "most wrong"):
            wrong = self.rng.uniform(size=n) < (0.35 if kind == "some wrong" else 0.8)
            pixels[wrong] = self.anywhere(int(wrong.sum()))
        elif kind == "permuted":
            ids[:] = self.rng.permutation(ids)
        elif kind == "half jumped":
            pixels[::2, ::2] += 60
        elif kind == "new":
            ids[:] = np.arange(self.fresh, self.fresh + n)
            self.fresh += n
        elif kind == "one pixel":
            pixels[:] = 300, 200, 290, 200
        elif kind == "line":
            pixels[:, 1::2] = CY
        elif kind == "no parallax":
            pixels[:, 2] = pixels[:, 0] + self.rng.uniform(-0.01, 1, n)
        elif kind == "no numbers":
            odd = np.array([np.nan, np.inf, -np.inf, 3e38])
            pixels[np.arange(n), np.arange(n) % 4] = odd[self.rng.integers(0, 4, n)]
        elif kind == "doubled":
            ids[::3] = ids[:1]

    def frame(self, kind: str) -> Iterator[Message]:
        if kind == "after a gap":
            for _ in range(10):
                yield from self.drive(1.2)
        yield from self.drive(0.2)
        ids, pixels = self.look(1.5, 0.15) if kind == "jumped" else self.look()
        self.spoil(kind, ids, pixels)
        yield Stereo(self.t_ns, ids, pixels.astype(np.float32))
        if kind == "at once":
            yield Stereo(self.t_ns + 1, ids, pixels.astype(np.float32))


def drives(seed: int, count: int, frames: int) -> Iterator[tuple[str, Message]]:
    """Yields messages, each with the kind of its frame."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield "", Header(Camera(FX, FX, CX, CY, BASELINE_M), R_CB, name="hostile")
        low, high = np.array([-60.0, -60, -3]), np.array([60.0, 60, 3])
        world = World(rng, rng.uniform(low, high, (POINTS, 3)))
        for k in range(USUAL_FRAMES + frames):
            kind = "usual" if k < USUAL_FRAMES else HOSTILE[rng.integers(len(HOSTILE))]
            for message in world.frame(kind):
                yield kind, message


def bound_of(observations: int) -> float:
    """Returns the bound of docs/SIZES.md for a frame by twists."""
    text = (ROOT / "docs/SIZES.md").read_text(encoding="utf-8")
    found = re.search(
        r"^ +([\d.]+) \+ ([\d.]+) m n \+ ([\d.]+) n\^2 \+ ([\d.]+) b n \+ ([\d.]+) b n\^2$",
        text,
        re.MULTILINE,
    )
    assert found
    one, mn, nn, bn, bnn = map(float, found.groups())
    n, b = 12 + 3 * SLOTS, -(-min(observations, SLOTS) // 8)
    return one + mn * observations * n + nn * n * n + bn * b * n + bnn * b * n * n


def judge(kinds: list[str], image: Path, board: str) -> dict[str, float]:
    """Prints the costliest frame of each kind; returns the most over its bound, by kind."""
    from firmware.sizes import run_bench  # noqa: PLC0415 - with PYTHONPATH=tools

    updates = run_bench(board, image).run.updates
    assert len(updates) == len(kinds), (len(updates), len(kinds))
    most: dict[str, float] = {}
    print(f"{'kind':12} frames | instructions, median, most | over the bound, most")
    for kind in KINDS:
        of_kind = [u for u, name in zip(updates, kinds, strict=True) if name == kind]
        if not of_kind:
            continue
        shares = [u.instructions / bound_of(u.observations) for u in of_kind]
        costs = [u.instructions for u in of_kind]
        most[kind] = max(shares)
        print(
            f"{kind:12} {len(of_kind):6} | {np.median(costs):9.0f} {max(costs):9.0f} "
            f"| {max(shares):.2f}"
        )
    return most


def main() -> int:
    """Writes the recording, or counts. Returns the exit status."""
    parser = argparse.ArgumentParser()
    parser.add_argument("recording", type=Path)
    parser.add_argument("--image", type=Path)
    parser.add_argument("--board", default="mps2_an386")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drives", type=int, default=6)
    parser.add_argument("--frames", type=int, default=120)
    asked = parser.parse_args()
    made = list(drives(asked.seed, asked.drives, asked.frames))
    if asked.image is None:
        write_file(asked.recording, [message for _, message in made])
        return 0
    kinds = [kind for kind, message in made if isinstance(message, Stereo)]
    most = judge(kinds, asked.image, asked.board)
    print(f"at most {max(most.values()):.2f} of the bound")
    return int(max(most.values()) > MOST or most.get("usual", 0.0) > 1)


if __name__ == "__main__":
    sys.exit(main())
