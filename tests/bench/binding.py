#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What a frame costs from Python, beside the C library's own time for it.

usage: binding.py [ROUNDS]

A minute of driving, 50 slots, float32. Each round replays it by pelorus-replay, which writes the
time of each plr_filter_update into its log, and by pelorus.Filter, around which a clock is read; of
a frame the least of all rounds counts, for another program may have disturbed the others.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter_ns

import numpy as np
from pelorus import Calibration, Filter, observations
from pelorus.native.replay import find_programs
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Config, Header, Message, Report, Stereo, Truth, Twist
from pelorus.wire.framing import messages_of
from pelorus.wire.layout import Floats
from pelorus.wire.schema import SETTINGS

SLOTS = 50


def by_program(recording: Path, log: Path) -> tuple[list[Message], Floats]:
    """Its log, and us of each frame."""
    command = [
        find_programs(None).float32,
        recording,
        f"--slots={SLOTS}",
        "--quiet",
        "--force",
        "--out",
        log,
    ]
    subprocess.run([*map(str, command)], check=True)
    found = messages_of(log)
    return found, np.array([m.update_us for m in found if isinstance(m, Report)], float)


def by_python(messages: list[Message], config: dict[str, float]) -> tuple[Floats, Floats]:
    """us of each frame and of each twist."""
    filter = Filter(
        Calibration.of_header(next(m for m in messages if isinstance(m, Header))), config
    )
    start = next(m for m in messages if isinstance(m, Truth))
    filter.set_pose(start.t_ns, start.R_WB, start.p_WB_m)
    frames, twists = [], []
    for m in messages:
        begin = perf_counter_ns()
        if isinstance(m, Twist):
            filter.predict(m.t_ns, m.v_B_mps, m.w_B_radps)
            twists.append(perf_counter_ns() - begin)
        elif isinstance(m, Stereo):
            filter.update(m.t_ns, observations(m.ids, m.pixels))
            frames.append(perf_counter_ns() - begin)
    return np.array(frames) * 1e-3, np.array(twists) * 1e-3


def main() -> int:
    """Prints the two and their ratio; the exit status."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 9
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        recording, log = Path(folder) / "drive.plr", Path(folder) / "log.plr"
        simulate(Options(seed=1, duration_s=60.0)).recording.write(recording)
        messages = messages_of(recording)
        program, frames, twists = [], [], []
        for _ in range(rounds):
            found, us = by_program(recording, log)
            force = next(m for m in found if isinstance(m, Config) and m.build_fingerprint)
            config = {SETTINGS[id].name: value for id, value in force.settings.items()}
            own, twist = by_python(messages, config)
            program.append(us)
            frames.append(own)
            twists.append(twist)
    library, python, twist = (np.min(rows, axis=0).mean() for rows in (program, frames, twists))
    print(f"{len(program[0])} frames, {SLOTS} slots, least of {rounds} rounds")
    print(f"a frame: C library {library:.1f} us, Python {python:.1f} us, {python / library:.3f}")
    print(f"a twist: Python {twist:.2f} us")
    return 0


if __name__ == "__main__":
    sys.exit(main())
