# SPDX-License-Identifier: MIT
"""A filter's log by column: each stereo frame beside what the filter and its supervisor said of it,
and every reading.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pelorus import schema
from pelorus.errors import PelorusError
from pelorus.evidence import Evidence, EvidenceFlag
from pelorus.frames import Header, Imu, Kind, Message, Pose, Report, Stereo, Twist
from pelorus.layout import Floats
from pelorus.motion import Times
from pelorus.schema import number
from pelorus.settings import in_force
from pelorus.trajectory import is_finite
from pelorus.wire import header_of_messages

Flags = NDArray[np.bool_]
Counts = NDArray[np.int64]
Pixels = NDArray[np.float32]
FEW = 3  # points: fewer fix no pose
NO_READING = -1
CONTRADICTED = number("reason", "TWIST_CONTRADICTED") | number("reason", "POSE_MAY_BE_WRONG")
ODD_FLAGS = EvidenceFlag.OUTRIGHT | EvidenceFlag.WAITS | EvidenceFlag.LOCKED


@dataclass(frozen=True)
class Log:
    """`frames` in the order of arrival, each with its answer, and with its evidence where the log
    has some. `behind_ns` is the stamp of the newest reading that had arrived before the frame.
    """

    header: Header
    frames: list[Stereo]
    reports: list[Report]
    poses: list[Pose | None]
    evidence: list[Evidence | None]
    behind_ns: Times
    reading_ns: Times
    readings: Floats  # (n, 6): v, w of twists; a, w of an IMU
    by_imu: bool
    refused: list[Report]  # of readings
    sigma: Floats  # (6,) of a twist reading as the filter had it; zeros where it says nothing
    bias_sigma: Floats  # (6,) likewise, of the biases before anything was seen

    @cached_property
    def t_ns(self) -> Times:
        return np.array([frame.t_ns for frame in self.frames], np.int64)

    @cached_property
    def arrived_ns(self) -> Times:
        """When a frame came, by the readings' clock; by its own stamp where there are none."""
        return np.where(self.behind_ns == NO_READING, self.t_ns, self.behind_ns)

    @property
    def origin_ns(self) -> int:
        return int(self.t_ns[0])

    def column(self, name: str) -> Counts:
        """Of REPORT."""
        return np.array([getattr(report, name) for report in self.reports], np.int64)

    @cached_property
    def reasons(self) -> Counts:
        return self.column("reasons")

    def said(self, bits: int) -> Flags:
        """Frames of which a reason is one of these; a refused one has those of the frame before."""
        return np.asarray(((self.reasons & bits) != 0) & (self.column("status") == 0))

    @cached_property
    def shared(self) -> Counts:
        """How many points of each frame stood in the frame before."""
        return np.array([len(first) for first, _ in self._pairs], np.int64)

    @cached_property
    def repeated(self) -> Counts:
        """How many of these have the very pixels that they had there."""
        return np.array([_repeated(first, second) for first, second in self._pairs], np.int64)

    @cached_property
    def flow_px(self) -> Floats:
        """Median way of the shared points in the left picture; NaN where they are few."""
        return np.array([_flow(first, second) for first, second in self._pairs])

    @cached_property
    def _pairs(self) -> list[tuple[Pixels, Pixels]]:
        nothing = np.zeros((0, 4), np.float32)
        out = [(nothing, nothing)]
        for before, now in pairwise(self.frames):
            _, i, j = np.intersect1d(before.ids, now.ids, return_indices=True)
            out.append((before.pixels[i], now.pixels[j]))
        return out


def _repeated(first: Pixels, second: Pixels) -> int:
    return int((first == second).all(axis=1).sum())


def _flow(first: Pixels, second: Pixels) -> float:
    way = (second.astype(np.float64) - first)[:, :2]
    way = way[np.isfinite(way).all(axis=1)]
    return float(np.median(np.hypot(*way.T))) if len(way) >= FEW else np.nan


def log_of(messages: Sequence[Message]) -> Log:
    """PelorusError where no frame was answered."""
    frames, reports, poses, evidence = _answers(messages)
    answered = sorted(reports)
    if not answered:
        raise PelorusError("holds no answer of a filter to a stereo frame: `pelorus-replay --out`")
    behind, stamps, readings = _readings(messages)
    return Log(
        header_of_messages(messages),
        [frames[k] for k in answered],
        [reports[k] for k in answered],
        [poses.get(k) for k in answered],
        [evidence.get(k) for k in answered],
        behind[answered],
        stamps,
        readings,
        any(isinstance(m, Imu) for m in messages),
        [
            m
            for m in messages
            if isinstance(m, Report) and m.subject in (Kind.TWIST, Kind.IMU) and m.status
        ],
        _sigma(messages, "velocity-sigma", "gyro-sigma"),
        _sigma(messages, "bias-velocity-sigma", "bias-gyro-sigma"),
    )


def _answers(
    messages: Sequence[Message],
) -> tuple[list[Stereo], dict[int, Report], dict[int, Pose], dict[int, Evidence]]:
    """All frames, and what answers each, by its number. A robot's answer comes when it is ready, so
    it is known by its time; a pose stands before the report, evidence behind it.
    """
    frames: list[Stereo] = []
    waiting: dict[int, deque[int]] = {}
    reports: dict[int, Report] = {}
    poses: dict[int, Pose] = {}
    evidence: dict[int, Evidence] = {}
    pose: Pose | None = None
    last: int | None = None
    for m in messages:
        if isinstance(m, Stereo):
            waiting.setdefault(m.t_ns, deque()).append(len(frames))
            frames.append(m)
        elif isinstance(m, Pose) and m.after_stereo and is_finite(m):
            pose = m
        elif isinstance(m, Report) and m.subject == Kind.STEREO:
            last = waiting[m.t_ns].popleft() if waiting.get(m.t_ns) else None
            if last is not None:
                reports[last] = m
                if pose is not None:
                    poses[last] = pose
            pose = None
        elif isinstance(m, Evidence) and last is not None:
            evidence[last] = m
    return frames, reports, poses, evidence


def _readings(messages: Sequence[Message]) -> tuple[Times, Times, Floats]:
    """For each frame the newest stamp before it; stamps and readings that a filter may use. What is
    no number, or none that a sensor gives, was refused: it is no part of the motion.
    """
    by_imu = any(isinstance(m, Imu) for m in messages)
    behind: list[int] = []
    stamps: list[int] = []
    rows: list[Floats] = []
    for m in messages:
        if isinstance(m, Stereo):
            behind.append(stamps[-1] if stamps else NO_READING)
        elif isinstance(m, Imu):
            stamps += m.times_ns
            rows.append(np.hstack((m.a_B_mps2, m.w_B_radps)).astype(np.float64))
        elif isinstance(m, Twist) and not by_imu:
            stamps.append(m.t_ns)
            rows.append(np.concatenate((m.v_B_mps, m.w_B_radps))[None])
    readings = np.concatenate(rows) if rows else np.zeros((0, 6))
    most = schema.PLAUSIBLE["ACCELERATION" if by_imu else "SPEED"]
    bounds = np.repeat([most, schema.PLAUSIBLE["RATE"]], 3)
    good = (np.abs(readings) <= bounds).all(axis=1)
    return np.array(behind, np.int64), np.array(stamps, np.int64)[good], readings[good]


def _sigma(messages: Sequence[Message], *names: str) -> Floats:
    return np.repeat([in_force(messages, name) or 0.0 for name in names], 3)


def suspect(log: Log) -> Flags:
    """Frames that the supervisor or the gate found odd."""
    flags = np.array([0 if e is None else e.flags for e in log.evidence], np.int64)
    matched, gated = log.column("matched"), log.column("gated")
    rejected = (matched >= FEW) & (2 * gated > matched)
    return np.asarray(log.said(CONTRADICTED) | ((flags & ODD_FLAGS) != 0) | rejected)


def period(t_ns: Times) -> float:
    """What mostly lies between two, ns."""
    return float(np.median(np.abs(np.diff(t_ns)))) if len(t_ns) > 1 else 0.0


def runs(flags: Flags) -> list[tuple[int, int]]:
    """First and last index of each stretch of yes."""
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    return list(
        zip(
            np.nonzero(edges == 1)[0].tolist(),
            (np.nonzero(edges == -1)[0] - 1).tolist(),
            strict=True,
        )
    )
