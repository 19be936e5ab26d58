#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes the seeds of fuzz_session: a short simulated recording as inputs of that harness.

usage: session_seeds.py FOLDER

tests/fuzz/corpus_session holds what this writes (seed-*) and what libFuzzer made of it. An input
is two bytes of choices (fuzz_session.c) and records [kind u8][size u16][payload], or a stream.
"""

from __future__ import annotations

import io
import struct
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from pelorus import wire
from pelorus.frames import Landmark, Message, Start, State, StateAction, Stereo, Truth, Twist
from pelorus.simulation.simulate import Options, simulate

Data = Twist | Stereo | Truth
MOST_SEEN = 8

# Of the first byte: mode in the two lowest bits, then
WORLD, BIAS, KNOWN_MAP, STORAGE, TIGHT, STREAM = 4, 8, 16, 32, 64, 128
SLAM, MAPPING, LOCALIZATION, DEAD_RECKONING = range(4)
# Of the second byte: start in the three lowest bits, then
DELAY, DEADLINE, OPEN_GATE = 8, 16, 32


def drive() -> list[Message]:
    """0.6 s: seven frames of at most eight observations, two twists a frame, known landmarks."""
    options = Options(
        seed=5,
        duration_s=0.6,
        twist_rate_hz=20,
        landmarks=40,
        observations=MOST_SEEN,
        known=True,
        bias_velocity_walk=1e-6,
        bias_gyro_walk=1e-8,
        outliers=0.1,
        drop=0,
    )
    messages = list(simulate(options).recording.messages())
    wanted = {int(i) for m in messages if isinstance(m, Stereo) for i in m.ids}
    return [m for m in messages if not isinstance(m, Landmark) or m.id in wanted]


def records(messages: Iterable[Message]) -> bytes:
    """Kind, size and payload of each, as the harness reads them."""
    out = b""
    for message in messages:
        payload = message.pack()
        out += struct.pack("<BH", message.kind, len(payload)) + payload
    return out


def stream(messages: Iterable[Message]) -> bytes:
    """As it comes off a wire."""
    out = io.BytesIO()
    writer = wire.Writer(out)
    for message in messages:
        writer.write(message)
    return out.getvalue()


def seeds() -> dict[str, bytes]:
    """Each mode and model, storage, the clock that jumps, a stream of bytes."""
    recording = drive()
    half = next(i for i, m in enumerate(recording) if isinstance(m, Stereo) and m.t_ns) + 8
    no_truth = [m for m in recording if not isinstance(m, Truth)]
    truth = next(m for m in recording if isinstance(m, Truth))
    start = Start(truth.t_ns, truth.R_WB, truth.p_WB_m)
    away = [replace(m, t_ns=m.t_ns + 10**13) for m in recording[half:] if isinstance(m, Data)]
    save = State(0, StateAction.SAVE)
    restore = State(truth.t_ns, StateAction.RESTORE)

    def choices(first: int, second: int = 0) -> bytes:
        return bytes([first, second])

    known = [m for m in recording if isinstance(m, Landmark)]
    return {
        "slam": choices(SLAM) + records(recording),
        "slam-bias-delay": choices(BIAS | SLAM, DELAY) + records(recording),
        "slam-tight-deadline": choices(TIGHT | KNOWN_MAP, DEADLINE) + records(recording),
        "world-open-gate": choices(WORLD | BIAS, OPEN_GATE) + records(recording),
        "mapping": choices(MAPPING) + records(recording),
        "localization-start": choices(LOCALIZATION, 3)
        + records([no_truth[0], *known, start, *no_truth[1 + len(known) :]]),
        "dead-reckoning": choices(DEAD_RECKONING, 2) + records(no_truth),
        "saved": choices(STORAGE)
        + records(
            [*recording[:half], save, *recording[half:], recording[0], restore, *recording[half:]]
        ),
        "clock-jumps": choices(SLAM) + records([*recording[:half], *away]),
        "stream": choices(STREAM | BIAS) + stream(recording),
    }


def main() -> int:
    """Write them all."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in seeds().items():
        (folder / f"seed-{name}").write_bytes(content)
        print(f"{folder / f'seed-{name}'}: {len(content)} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
