# SPDX-License-Identifier: MIT
"""What a filter writes: its settings, poses, reports and landmarks (CONFIG and LANDMARK may come
from a recorder too).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import ClassVar

import numpy as np

from pelorus.frames.base import (
    Floats,
    Kind,
    MalformedPayload,
    Message,
    bytes_of,
    f64,
    identity,
    need,
    within,
    zeros,
)
from pelorus.frames.recorder import NO_BUDGET

SETTINGS_MAX = 64
HEALTH_MAX = 3
SETTING = np.dtype([("id", "u1"), ("value", "<f8")])


class Role(IntEnum):
    """Where a landmark comes from."""

    KNOWN = 0
    EVICTED = 1
    FINAL = 2


@dataclass(frozen=True, eq=False)
class Config(Message):
    """Settings by id (see `pelorus.settings`), and of which build they are in force."""

    settings: dict[int, float] = field(default_factory=dict)
    build_fingerprint: int = 0
    max_landmarks: int = 0
    max_observations: int = 0
    block_observations: int = 0
    real_bytes: int = 0

    kind: ClassVar[Kind] = Kind.CONFIG
    _FIXED: ClassVar[struct.Struct] = struct.Struct("<IHHBBB")

    def pack(self) -> bytes:
        fixed = self._FIXED.pack(
            self.build_fingerprint,
            self.max_landmarks,
            self.max_observations,
            self.block_observations,
            self.real_bytes,
            len(self.settings),
        )
        return fixed + np.array(list(self.settings.items()), SETTING).tobytes()

    @classmethod
    def unpack(cls, payload: bytes) -> Config:
        need(payload, cls._FIXED.size)
        *build, count = cls._FIXED.unpack_from(payload)
        within("n", count, 0, SETTINGS_MAX)
        need(payload, cls._FIXED.size + count * SETTING.itemsize)
        rows = np.frombuffer(payload, SETTING, count, cls._FIXED.size)
        return cls({int(row["id"]): float(row["value"]) for row in rows}, *build)


@dataclass(frozen=True, eq=False)
class Landmark(Message):
    """A landmark in the world with its covariance, packed, m^2."""

    id: int
    p_W_m: Floats = zeros(3)
    covariance: Floats = zeros(6)
    role: Role = Role.KNOWN
    t_ns: int = 0
    times_seen: int = 0

    kind: ClassVar[Kind] = Kind.LANDMARK
    SIZE: ClassVar[int] = 90
    _FIXED: ClassVar[struct.Struct] = struct.Struct("<QBBII")

    def pack(self) -> bytes:
        fixed = self._FIXED.pack(self.t_ns, self.role, 0, self.id, self.times_seen)
        return fixed + bytes_of(self.p_W_m, 3) + bytes_of(self.covariance, 6)

    @classmethod
    def unpack(cls, payload: bytes) -> Landmark:
        need(payload, cls.SIZE)
        t_ns, role, _, number, seen = cls._FIXED.unpack_from(payload)
        within("role", role, 0, max(Role))
        return cls(number, f64(payload, 18, 3), f64(payload, 42, 6), Role(role), t_ns, seen)


POSE_REALS = (9, 21, 3, 3, 6, 21)  # R, covariance, v, w, bias, covariance of (v, w)
UNKNOWN_VARIANCE = 2.0**40  # of a filter that has diverged


@dataclass(frozen=True, eq=False)
class Pose(Message):
    """What the filter knew after a message; reals have `real_bytes` bytes, the position eight."""

    t_ns: int
    p_WB_m: Floats = zeros(3)
    R_WB: Floats = identity()
    covariance: Floats = zeros(21)
    v_B_mps: Floats = zeros(3)
    w_B_radps: Floats = zeros(3)
    bias: Floats = zeros(6)
    velocity_covariance: Floats = zeros(21)
    real_bytes: int = 8
    after_stereo: bool = False
    reset_count: int = 0

    kind: ClassVar[Kind] = Kind.POSE
    _FIXED: ClassVar[struct.Struct] = struct.Struct("<QBBH3d")

    @property
    def knows_covariance(self) -> bool:
        """False once the filter has diverged."""
        return bool(self.covariance[0] < UNKNOWN_VARIANCE)

    def pack(self) -> bytes:
        p = np.asarray(self.p_WB_m, float)
        fixed = self._FIXED.pack(
            self.t_ns, self.real_bytes, int(self.after_stereo), self.reset_count, *p
        )
        rotation = np.asarray(self.R_WB, float).reshape(9)
        parts = (rotation, self.covariance, self.v_B_mps, self.w_B_radps, self.bias)
        reals = np.concatenate((*parts, self.velocity_covariance))
        return bytes(fixed + reals.astype(_real(self.real_bytes)).tobytes())

    @classmethod
    def unpack(cls, payload: bytes) -> Pose:
        need(payload, cls._FIXED.size)
        t_ns, real_bytes, flags, reset_count, *p = cls._FIXED.unpack_from(payload)
        if real_bytes not in (4, 8):
            raise MalformedPayload(f"reals of {real_bytes} bytes, 4 or 8 are defined")
        count = sum(POSE_REALS)
        need(payload, cls._FIXED.size + real_bytes * count)
        reals = np.frombuffer(payload, _real(real_bytes), count, cls._FIXED.size).astype(float)
        rotation, covariance, v, w, bias, velocity = np.split(reals, np.cumsum(POSE_REALS)[:-1])
        return cls(
            t_ns=t_ns,
            p_WB_m=np.array(p),
            R_WB=rotation.reshape(3, 3),
            covariance=covariance,
            v_B_mps=v,
            w_B_radps=w,
            bias=bias,
            velocity_covariance=velocity,
            real_bytes=real_bytes,
            after_stereo=bool(flags & 1),
            reset_count=reset_count,
        )


def _real(real_bytes: int) -> str:
    return {4: "<f4", 8: "<f8"}[real_bytes]


@dataclass(frozen=True, eq=False)
class Report(Message):
    """What the filter did with one message; the counts are described on the format's page."""

    t_ns: int
    subject: int = 0
    status: int = 0
    health: int = 0
    reasons: int = 0
    budget: int = NO_BUDGET
    observations: int = 0
    matched: int = 0
    used: int = 0
    gated: int = 0
    created: int = 0
    evicted: int = 0
    refused: int = 0
    duplicates: int = 0
    no_room: int = 0
    poor: int = 0
    left_out: int = 0
    blocks_failed: int = 0
    active: int = 0
    nis_dof: int = 0
    nis: float = 0.0
    update_us: int = 0

    kind: ClassVar[Kind] = Kind.REPORT
    _FIXED: ClassVar[struct.Struct] = struct.Struct("<QBbBx2H14HfI")
    _UPPER: ClassVar[struct.Struct] = struct.Struct("<H")  # of reasons; since format 1.2

    def pack(self) -> bytes:
        upper, lower = divmod(self.reasons, 1 << 16)
        fixed = self._FIXED.pack(*vars(replace(self, reasons=lower)).values())
        return fixed + self._UPPER.pack(upper)

    @classmethod
    def unpack(cls, payload: bytes) -> Report:
        need(payload, cls._FIXED.size)
        report = cls(*cls._FIXED.unpack_from(payload))
        if len(payload) > cls._FIXED.size:
            need(payload, cls._FIXED.size + cls._UPPER.size)
            (upper,) = cls._UPPER.unpack_from(payload, cls._FIXED.size)
            report = replace(report, reasons=upper << 16 | report.reasons)
        within("status", report.status, -128, 0)
        within("health", report.health, 0, HEALTH_MAX)
        return report
