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
from typing import Any

import numpy as np
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire import frames, framing
from pelorus.wire.frames import (
    Config,
    End,
    Landmark,
    Message,
    Reading,
    Start,
    StartFlag,
    State,
    StateAction,
    Stereo,
    Truth,
    Twist,
)
from pelorus.wire.schema import SENSORS

Data = Twist | Stereo | Truth
MOST_SEEN = 8
SECOND = 1_000_000_000

# Of the first byte: mode in the two lowest bits, then
WORLD, BIAS, KNOWN_MAP, STORAGE, TIGHT, STREAM = 4, 8, 16, 32, 64, 128
SLAM, MAPPING, LOCALIZATION, DEAD_RECKONING = range(4)
# Of the second byte: start in the three lowest bits, then
DELAY, DEADLINE, OPEN_GATE = 8, 16, 32


def drive(**changes: Any) -> list[Message]:
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
    messages = list(simulate(replace(options, **changes)).recording.messages())
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
    writer = framing.Writer(out)
    for message in messages:
        writer.write(message)
    return out.getvalue()


def choices(first: int, second: int = 0) -> bytes:
    """An input's first two bytes."""
    return bytes([first, second])


def seeds() -> dict[str, bytes]:
    """Each mode and model, a stream of bytes, and what the functions below set up."""
    recording = drive()
    no_truth = [m for m in recording if not isinstance(m, Truth)]
    return {
        "slam": choices(SLAM) + records(recording),
        "slam-bias-delay": choices(BIAS | SLAM, DELAY) + records(recording),
        "slam-tight-deadline": choices(TIGHT | KNOWN_MAP, DEADLINE) + records(recording),
        "world-open-gate": choices(WORLD | BIAS, OPEN_GATE) + records(recording),
        "mapping": choices(MAPPING) + records(recording),
        "localization-start": choices(LOCALIZATION, 3) + records(started(no_truth, 1e-4)),
        "diverges": choices(LOCALIZATION, 3) + records(started(no_truth, 4.0)),
        "dead-reckoning": choices(DEAD_RECKONING, 2) + records(no_truth),
        "saved": choices(STORAGE) + records(saved(recording)),
        "clock-jumps": choices(SLAM) + records(jumping(recording)),
        "evicts": choices(TIGHT) + records(drive(known=False, loss=0.5, observations=4)),
        "gate-locks": choices(SLAM) + records(locked()),
        "readings": choices(BIAS | SLAM) + records(measured(recording)),
        "stream": choices(STREAM | BIAS) + stream(recording),
        "imu": choices(BIAS | SLAM) + records(by_imu()),
        "imu-late": choices(BIAS | SLAM, DELAY) + records(by_imu()),
        "imu-from-rest": choices(BIAS | SLAM, 2) + records(from_rest()),
        "imu-spoilt": choices(BIAS | STORAGE) + records(spoilt(by_imu())),
    }


def started(messages: list[Message], variance: float) -> list[Message]:
    """With a START at identity, known to that variance, and landmarks to a millimetre.

    In float32 the filter diverges if the variance is large (docs/NUMERICS.md, section 1).
    """
    truth = next(m for m in drive() if isinstance(m, Truth))
    covariance = variance * np.eye(6)[np.tril_indices(6)]
    start = Start(truth.t_ns, truth.R_WB, truth.p_WB_m, StartFlag.COVARIANCE, covariance)
    sharp = 1e-6 * np.eye(3)[np.tril_indices(3)]
    known = [replace(m, covariance=sharp) for m in messages if isinstance(m, Landmark)]
    data = [m for m in messages[1:] if not isinstance(m, Landmark)]
    return [messages[0], *known, start, *data]


def saved(recording: list[Message]) -> list[Message]:
    """Saved in mid-flight; the next drive goes on from there, on another clock, moved a little."""
    half = _half(recording)
    end = End(0, 0, 0, 0, 0)
    save = State(0, StateAction.SAVE)
    restore = State(SECOND, StateAction.RESTORE, np.full(6, 1e-4))
    rest = [replace(m, t_ns=m.t_ns + SECOND) for m in recording[half:] if isinstance(m, Data)]
    return [*recording[:half], save, end, recording[0], restore, *rest]


def jumping(recording: list[Message]) -> list[Message]:
    """The clock is set ahead by hours in mid-flight."""
    half = _half(recording)
    away = [replace(m, t_ns=m.t_ns + 10**13) for m in recording[half:] if isinstance(m, Data)]
    return [*recording[:half], *away]


def measured(recording: list[Message]) -> list[Message]:
    """With a wheel at each twist, a position at each truth, and a standstill of one axis."""
    arm = np.array([0.5, -0.2, 0.1])
    out = [recording[0]]
    for message in recording[1:]:
        out.append(message)
        match message:
            case Twist(t_ns, v, w):
                speed = v + np.cross(w, arm)
                out.append(Reading(t_ns, SENSORS["wheel"], 5, speed, np.full(3, 0.1), arm))
            case Truth(t_ns, R, p):
                out.append(Reading(t_ns, SENSORS["position"], 7, p + R @ arm, np.full(3, 0.3), arm))
                out.append(Reading(t_ns, SENSORS["standstill"], 2, sigma=np.full(3, 0.05)))
    return out


def by_imu(**changes: Any) -> list[Message]:
    """Batches of an IMU at 100 Hz in place of the twists."""
    imu = SimulatedImu(imu_rate_hz=100.0, imu_batch=5)
    return drive(known=False, imu=imu, **changes)


def from_rest() -> list[Message]:
    """Without a START: the filter finds its tilt while the body stands, for 1.2 s."""
    imu = SimulatedImu(imu_rate_hz=100.0, imu_batch=20, rest_s=1.2)
    messages = drive(known=False, imu=imu, duration_s=1.6, observations=3)
    return [m for m in messages if not isinstance(m, Start | Truth)]


def spoilt(recording: list[Message]) -> list[Message]:
    """Absurd readings, none at all, twists among them, a clock that jumps; saved in the end."""
    half = len(recording) // 2
    out: list[Message] = []
    for at, message in enumerate(recording):
        if isinstance(message, frames.Imu) and at % 3 == 0:
            a = message.a_B_mps2.copy()
            a[0] = np.nan, 1e30, -1e5
            out += [replace(message, a_B_mps2=a), Twist(message.t_ns)]
        elif isinstance(message, frames.Imu | Stereo | Truth) and at > half:
            out.append(replace(message, t_ns=message.t_ns + 10**13))
        else:
            out.append(message)
    return [*out, State(0, StateAction.SAVE)]


def locked() -> list[Message]:
    """The gate lets hardly anything pass for more than ten frames."""
    recording = drive(known=False, duration_s=1.4, outliers=0.0, loss=0.0, observations=6)
    return [recording[0], Config({15: 1e-3}), *recording[1:]]  # gate-d2


def _half(recording: list[Message]) -> int:
    return [i for i, m in enumerate(recording) if isinstance(m, Stereo)][3] + 1


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
