# SPDX-License-Identifier: MIT
"""pelorus-replay on NaN, infinity and huge numbers in every field of every kind."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pelorus.wire import settings
from pelorus.wire.frames import (
    Config,
    Message,
    Start,
    Stereo,
    Twist,
)
from replay_drive import (
    FRAMES,
    OK,
    RECORDING,
    Record,
    assert_healthy,
    drive,
    err0_m,
    header,
    known,
    poses_of,
    run,
    t_ns,
)

STRANGE = (math.nan, math.inf, -math.inf, 1e300, -1e300)


def poisoned(message: Message, at: int, value: float, form: str = "<d") -> Message:
    """The message with a number of its payload replaced."""
    payload = bytearray(message.pack())
    struct.pack_into(form, payload, at, value)

    class Poisoned(Message):
        kind = message.kind

        def pack(self) -> bytes:
            return bytes(payload)

    return Poisoned()


@pytest.mark.parametrize("program", ["pelorus-replay", "pelorus-replay-f64"])
@pytest.mark.parametrize("timing", ["start", "end", "mid"])
@pytest.mark.parametrize("value", STRANGE)
def test_strange_numbers_in_twists(
    record: Record, tmp_path: Path, value: float, timing: str, program: str
) -> None:
    messages, out = drive(), tmp_path / "out.plr"
    for field in range(6):
        k = 5 + 5 * field
        i = next(i for i, m in enumerate(messages) if isinstance(m, Twist) and m.t_ns == t_ns(k))
        messages[i] = poisoned(messages[i], 8 + 8 * field, value)
    options = ("--twist-timing", timing, "--json", "--out", out)
    result = run(record(messages), *options, program=program)
    assert result.summary["messages_refused"] == 6, result.stderr
    assert assert_healthy(out) == FRAMES
    assert err0_m(out) < 0.3


@pytest.mark.parametrize("program", ["pelorus-replay", "pelorus-replay-f64"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3e38, -3e38, 1e20])
def test_strange_numbers_in_observations(
    record: Record, tmp_path: Path, value: float, program: str
) -> None:
    messages, out = drive(), tmp_path / "out.plr"
    for i, m in enumerate(messages):
        if isinstance(m, Stereo):
            pixels = m.pixels.copy()
            for n in range(4):
                pixels[n, n] = value
            messages[i] = replace(m, pixels=pixels)
    result = run(record(messages), "--json", "--out", out, program=program)
    assert result.summary["refused_observations"] == 4 * FRAMES
    assert "4 left out (not finite, or beyond any image)" in result.stderr
    assert assert_healthy(out) == FRAMES
    assert err0_m(out) < 0.2


@pytest.mark.parametrize("mode", ["slam", "mapping"])
@pytest.mark.parametrize("value", STRANGE)
def test_strange_numbers_in_truth(record: Record, tmp_path: Path, value: float, mode: str) -> None:
    out = tmp_path / "out.plr"
    for field in range(12):
        messages = drive(10)
        for k in (0, 4):
            i = 2 + 3 * k
            messages[i] = poisoned(messages[i], 8 + 8 * field, value)
        result = run(record(messages), "--mode", mode, "--json", "--out", out)
        poses = poses_of(out)
        assert all(np.isfinite(pose.p_WB_m).all() for pose in poses)
        assert all(np.isfinite(pose.covariance).all() for pose in poses)
        assert len(poses) == (10 if mode == "slam" else result.summary["frames"])


@pytest.mark.parametrize("value", STRANGE)
def test_strange_numbers_in_a_start(record: Record, tmp_path: Path, value: float) -> None:
    out = tmp_path / "out.plr"
    start = Start(t_ns(0), covariance=np.eye(6)[np.tril_indices(6)] * 1e-4)
    whole = replace(start, flags=type(start.flags)(3), bias_variance=np.full(6, 1e-4))
    offsets = [*range(8, 104, 8), *range(105, 369, 8)]
    for at in offsets:
        messages = [header(), poisoned(whole, at, value), *drive(6)[1:]]
        result = run(record(messages), "--bias", "on", "--json", "--out", out)
        assert assert_healthy(out) == 6
        assert result.summary["messages_refused"] == 1
        assert "START: refused" in result.stderr


@pytest.mark.parametrize("value", STRANGE)
def test_strange_numbers_in_a_header(record: Record, tmp_path: Path, value: float) -> None:
    out = tmp_path / "out.plr"
    for at in range(10, 202, 8):
        path = record([poisoned(header(), at, value), *drive(6)[1:]])
        result = run(path, "--json", "--out", out, status=None)
        assert result.status in (OK, RECORDING)
        if at < 146 and not math.isfinite(value):
            assert result.status == RECORDING
            assert "calibration" in result.stderr
        if at >= 146:  # a suggestion: left out
            assert result.status == OK
        if result.status == OK:
            assert_healthy(out)


def test_strange_settings_are_left_out_and_named(record: Record) -> None:
    for value in STRANGE:
        wanted = Config(dict.fromkeys(settings.SETTINGS, value) | {200: 1.0})
        result = run(record([header(), wanted, *drive(6)[1:]]), "--json")
        assert result.summary["messages_refused"] == len(settings.SETTINGS) + 1
        assert "CONFIG: pixel-sigma = " in result.stderr
        assert "setting 200 is not known" in result.stderr


@pytest.mark.parametrize("value", STRANGE)
def test_strange_numbers_in_known_landmarks(record: Record, tmp_path: Path, value: float) -> None:
    out = tmp_path / "out.plr"
    landmarks = known()
    for field in range(9):
        landmarks[field] = poisoned(landmarks[field], 18 + 8 * field, value)
    path = record([header(), *landmarks, *drive()[1:]])
    run(path, "--mode", "localization", "--json", "--out", out)
    assert assert_healthy(out) == FRAMES
    assert err0_m(out) < 0.2
