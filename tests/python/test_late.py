# SPDX-License-Identifier: MIT
"""Recordings that do not stand in the order of time: what `info` and `check` tell of them, and that
what they tell puts the replay in order."""

from __future__ import annotations

import json
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from pelorus.io.arrivals import late_ones
from pelorus.wire import framing
from pelorus.wire.frames import Imu, Kind, Message, Stereo, Twist
from replay_drive import BIN

MS = 1_000_000


def frame(t_ms: float) -> Stereo:
    return Stereo(round(t_ms * MS), np.empty(0, np.uint32), np.empty((0, 4), np.float32))


def twist(t_ms: float) -> Twist:
    return Twist(round(t_ms * MS), np.zeros(3), np.zeros(3))


def batch(t_ms: float, count: int) -> Imu:
    return Imu(round(t_ms * MS), np.zeros((count, 3)), np.zeros((count, 3)), 10 * MS)


ORDERS: list[tuple[list[Message], dict[Kind, tuple[int, int, float]]]] = [
    ([twist(0), frame(0), twist(50), twist(100), frame(100)], {}),
    ([frame(0), twist(0), frame(40), twist(40)], {}),  # of equal times either may be first
    ([batch(0, 5), frame(60), batch(50, 5)], {Kind.IMU: (1, 10, 0.02)}),
    ([batch(0, 5), frame(60), frame(90), batch(50, 5)], {Kind.IMU: (4, 10, 0.05)}),
    ([frame(90), batch(0, 5), twist(95)], {Kind.IMU: (5, 5, 0.09)}),
    ([twist(0), frame(50.25), twist(20)], {Kind.TWIST: (1, 2, 0.051)}),
    ([twist(0), twist(80), frame(30), frame(40)], {Kind.STEREO: (2, 2, 0.05)}),
    ([twist(50), twist(50), twist(20), frame(60), frame(30)], {}),  # their own kind goes back
]


@pytest.mark.parametrize(("messages", "due"), ORDERS)
def test_what_stands_behind_newer_ones_is_counted_and_how_long_these_would_wait(
    messages: list[Message], due: dict[Kind, tuple[int, int, float]]
) -> None:
    found = {late.kind: (late.late, late.of, late.wait_s) for late in late_ones(messages)}
    assert found == due


def rebatched(source: Path, target: Path, batch: int, late_s: float) -> None:
    """Each message of `batch` readings behind its last one, as a driver sends it."""
    messages = [r.message for r in framing.read_file(source)[0] if r.message.kind is not Kind.END]
    timed = [m for m in messages if isinstance(m, Stereo)]
    imus = [m for m in messages if isinstance(m, Imu)]
    readings = [row for m in imus for row in zip(m.times_ns, m.a_B_mps2, m.w_B_radps, strict=True)]
    arriving: list[tuple[float, int, Message]] = [(m.t_ns, 0, m) for m in timed]
    for k in range(0, len(readings), batch):
        part = readings[k : k + batch]
        times = [row[0] for row in part]
        period = next((b - a for a, b in pairwise(times)), 0)
        a, w = (np.array([row[i] for row in part]) for i in (1, 2))
        arriving.append((times[-1] + late_s * 1e9, 1, Imu(times[0], a, w, period)))
    arriving.sort(key=lambda entry: entry[:2])
    with target.open("wb") as stream:
        writer = framing.Writer(stream)
        for message in messages:
            if not isinstance(message, Stereo | Imu):
                writer.write(message)
        for _, _, message in arriving:
            writer.write(message)
        writer.end()


def replayed(*words: object) -> dict[str, int]:
    """The summary."""
    command = [str(BIN / "pelorus-replay"), *map(str, words), "--json"]
    done = subprocess.run(command, capture_output=True, check=True)
    return dict(json.loads(done.stdout))


@pytest.mark.parametrize(("batch", "late_s"), [(7, 0.0), (1, 0.08)])
def test_a_late_imu_is_told_by_info_and_check_and_mended_by_what_they_say(
    tmp_path: Path, pelorus: Run, batch: int, late_s: float
) -> None:
    drive, late = tmp_path / "drive.plr", tmp_path / "late.plr"
    options = ("--imu-rate", 200, "--rest", 2, "--duration", 8, "--landmarks", 200)
    pelorus("simulate", drive, *options)
    rebatched(drive, late, batch, late_s)

    assert "stand behind" not in pelorus("info", drive).out
    remarks = json.loads(pelorus("info", late, "--json").out)["remarks"]
    (told,) = [words for words in remarks if "stand behind a newer STEREO" in words]
    wait = told.split("--twist-delay ")[1].rstrip(")")

    assert told in pelorus("check", late, "--out", tmp_path / "tuned.conf").out.replace("\n", " ")
    whole, torn, mended = (
        replayed(*words) for words in ((drive,), (late,), (late, "--twist-delay", wait))
    )
    assert torn["frames_good"] < whole["frames_good"] / 2
    assert torn["late"] > 0 == mended["late"]
    for name in ("frames", "used", "gated", "imu_refused", "frames_good"):
        assert mended[name] == whole[name]
