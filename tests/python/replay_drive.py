# SPDX-License-Identifier: MIT
"""A drive as messages, pelorus-replay to run over it, and what its log must be like.

The programs are looked for in $PELORUS_BIN, by default build/bin.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pelorus.evaluate.evaluation import judge
from pelorus.wire import framing
from pelorus.wire.frames import (
    Camera,
    End,
    Header,
    Landmark,
    Message,
    Pose,
    Stereo,
    Truth,
    Twist,
)
from pelorus.wire.settings import CALIBRATION_SIGMAS

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(os.environ.get("PELORUS_BIN", ROOT / "build" / "bin"))

OK, RECORDING, USAGE, OUTPUT = 0, 1, 2, 3  # exit statuses
SECOND = 1_000_000_000
FRAMES = 40
CAMERA = Camera(fx_px=320, fy_px=320, cx_px=320, cy_px=240, baseline_m=0.25)
R_CB = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
SPEED, RATE = 1.0, 0.2  # round a circle


def t_ns(k: int) -> int:
    """Time of step k."""
    return 5 * SECOND + k * SECOND // 10


def true_pose(k: int) -> tuple[Any, Any]:
    """Rotation and position, body to world, at step k."""
    a = RATE * 0.1 * k
    rotation = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    radius = SPEED / RATE
    return rotation, np.array([radius * math.sin(a), radius * (1 - math.cos(a)), 0])


def points() -> Any:
    """The landmarks in the world, (200, 3), metres."""
    chance = np.random.default_rng(1)
    angle, reach = chance.uniform(0, 2 * math.pi, 200), chance.uniform(7, 20, 200)
    height = chance.uniform(-3, 3, 200)
    return np.stack([reach * np.cos(angle), 5 + reach * np.sin(angle), height], 1)


def stereo(k: int, sigma_px: float = 0.0) -> Stereo:
    """What the camera sees at step k, at most 30 landmarks."""
    rotation, position = true_pose(k)
    q = (points() - position) @ rotation @ R_CB.T
    seen = np.nonzero((q[:, 2] > 2) & (abs(q[:, 0]) < q[:, 2]) & (abs(q[:, 1]) < q[:, 2]))[0][:30]
    x, y, z = q[seen].T
    left, right = 320 * x / z + 320, 320 * (x - 0.25) / z + 320
    v = 320 * y / z + 240
    pixels = np.stack([left, v, right, v], 1)
    pixels += sigma_px * np.random.default_rng(100 + k).normal(size=pixels.shape)
    return Stereo(t_ns(k), seen.astype(np.uint32), pixels.astype(np.float32))


def twist(k: int) -> Twist:
    """The reading of step k."""
    return Twist(t_ns(k), np.array([SPEED, 0, 0]), np.array([0, 0, RATE]))


def truth(k: int) -> Truth:
    """The true pose of step k."""
    return Truth(t_ns(k), *true_pose(k))


def header(**changes: Any) -> Header:
    """The HEADER of the drive, with changes."""
    return replace(Header(CAMERA, R_CB, name="circle"), **changes)


def drive(frames: int = FRAMES, sigma_px: float = 0.5) -> list[Message]:
    """A whole recording but for its END."""
    messages: list[Message] = [header()]
    for k in range(frames):
        messages += [twist(k), truth(k), stereo(k, sigma_px)]
    return messages


def known(sigma_m: float = 0.01) -> list[Message]:
    """The landmarks as LANDMARK (known)."""
    covariance = sigma_m**2 * np.array([1.0, 0, 1, 0, 0, 1])
    return [Landmark(i, p, covariance) for i, p in enumerate(points())]


def later(message: Message, seconds: int) -> Twist | Truth | Stereo:
    """The same message at another time."""
    assert isinstance(message, Twist | Truth | Stereo)
    return replace(message, t_ns=message.t_ns + seconds * SECOND)


def encode(messages: Iterable[Message], end: bool | End = True) -> bytes:
    """The bytes of a recording; `end` may be the END that a robot has said."""
    stream = io.BytesIO()
    writer = framing.Writer(stream)
    for message in messages:
        writer.write(message)
    if end:
        writer.end(end if isinstance(end, End) else None)
    return stream.getvalue()


# --- running it -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Result:
    """What one run gave."""

    status: int
    stdout: str
    stderr: str

    @property
    def summary(self) -> dict[str, Any]:
        loaded = json.loads(self.stdout)
        assert isinstance(loaded, dict)
        return loaded


def run(
    *arguments: str | Path,
    program: str = "pelorus-replay",
    stdin: bytes = b"",
    status: int | None = OK,
    force: bool = True,
) -> Result:
    """Run the program, which must end with that status; None: with any, but no crash. A test may
    write its files anew.
    """
    path = BIN / program
    if not path.exists():
        pytest.skip(f"{path} is not built")
    writes = force and any(option in arguments for option in ("--out", "--trajectory"))
    command = [str(path), *map(str, arguments), *(["--force"] if writes else [])]
    done = subprocess.run(command, input=stdin, capture_output=True, check=False, timeout=1800)
    assert done.returncode >= 0, f"killed by signal {-done.returncode}"
    result = Result(done.returncode, done.stdout.decode(), done.stderr.decode())
    assert status is None or result.status == status, result.stderr
    return result


def err0_m(log: Path) -> float:
    """A result's RMS position error against the truth in it, first poses aligned."""
    found = judge(log_of(log))["err0_m"]
    assert found is not None
    return found


# A simulated camera is what it is said to be: what is told is of the noise alone.
EXACT_CAMERA: tuple[str, ...] = tuple(
    word for name in CALIBRATION_SIGMAS for word in (f"--{name}", "0")
)


def judged(
    recording: Path, *options: str | Path, program: str = "pelorus-replay"
) -> dict[str, Any]:
    """The summary of a run, with the figures of its log against the truth in it."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.plr"
        result = run(recording, *options, "--json", "--out", log, program=program)
        return result.summary | judge(log_of(log))


Record = Callable[[Iterable[Message] | bytes], Path]


def recorder(folder: Path) -> Record:
    """Give a function that writes a recording into the folder."""

    def write(content: Iterable[Message] | bytes) -> Path:
        path = folder / "drive.plr"
        path.write_bytes(content if isinstance(content, bytes) else encode(content))
        return path

    return write


def log_of(path: Path) -> list[Message]:
    """The messages of an undamaged recording."""
    received, counts = framing.read_file(path)
    assert counts.clean
    return [frame.message for frame in received]


def poses_of(path: Path) -> list[Pose]:
    """Its POSE frames."""
    return [message for message in log_of(path) if isinstance(message, Pose)]


def bits_of(path: Path) -> str:
    """The SHA-256 of its POSE payloads."""
    return hashlib.sha256(b"".join(pose.pack() for pose in poses_of(path))).hexdigest()


def assert_healthy(path: Path) -> int:
    """Every pose is made of numbers, every variance positive; gives the number of poses."""
    poses = poses_of(path)
    diagonal = [i * (i + 3) // 2 for i in range(6)]
    for pose in poses:
        numbers = (pose.p_WB_m, pose.R_WB, pose.covariance, pose.v_B_mps, pose.w_B_radps, pose.bias)
        assert all(np.isfinite(part).all() for part in numbers)
        assert (pose.covariance[diagonal] > 0).all()
        assert np.allclose(pose.R_WB @ pose.R_WB.T, np.eye(3), atol=1e-5)
    return len(poses)
