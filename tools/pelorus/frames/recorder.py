# SPDX-License-Identifier: MIT
"""What a recorder, a robot or a reference writes."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pelorus.frames.base import (
    Floats,
    Kind,
    Message,
    bytes_of,
    f64,
    identity,
    need,
    within,
    zeros,
)

NO_BUDGET = 65535
OBSERVATIONS_MAX = 4096
NAME_BYTES_MAX = 63
TEXT_BYTES_MAX = 240
OBSERVATION = np.dtype([("id", "<u4"), ("pixels", "<f4", (4,))])


def header_name(words: str) -> str:
    """The words as a HEADER can hold them: whole characters of UTF-8, and not too many.

    A file's name may hold bytes that are no text; they become question marks.
    """
    stored = words.encode("utf-8", errors="replace")[:NAME_BYTES_MAX]
    return stored.decode("utf-8", errors="ignore")


class BodyAxes(IntEnum):
    """Which way the body's x, y and z point."""

    FORWARD_LEFT_UP = 0
    FORWARD_RIGHT_DOWN = 1
    OTHER = 2


class TwistTiming(IntEnum):
    """When a reading holds: START on [t_j, t_j+1), END on (t_j-1, t_j], MID the mean of both."""

    START = 0
    END = 1
    MID = 2


class StartFlag(IntFlag):
    """Which fields of a START are given."""

    COVARIANCE = 1
    BIAS_PRIOR = 2


class StateAction(IntEnum):
    """What a STATE asks for."""

    SAVE = 1
    RESTORE = 2


@dataclass(frozen=True, eq=False)
class Camera:
    """A rectified stereo pair; pixels and metres."""

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    baseline_m: float


@dataclass(frozen=True, eq=False)
class Noise:
    """What the recorder suggests; negative: nothing."""

    pixel_sigma_px: float = -1.0
    velocity_sigma_mps: float = -1.0
    gyro_sigma_radps: float = -1.0
    bias_velocity_sigma_mps: float = -1.0
    bias_gyro_sigma_radps: float = -1.0
    bias_velocity_walk: float = -1.0
    bias_gyro_walk: float = -1.0
    velocity_sigma_x_mps: float = -1.0  # of single axes of the body; 0 or negative: as for all
    velocity_sigma_y_mps: float = -1.0
    velocity_sigma_z_mps: float = -1.0
    gyro_sigma_x_radps: float = -1.0
    gyro_sigma_y_radps: float = -1.0
    gyro_sigma_z_radps: float = -1.0


@dataclass(frozen=True, eq=False)
class Header(Message):
    """Calibration and conventions. q_C = R_CB s_B + t_CB_m, C the left camera, B the body."""

    camera: Camera
    R_CB: Floats = identity()
    t_CB_m: Floats = zeros(3)
    body_axes: BodyAxes = BodyAxes.OTHER
    twist_timing: TwistTiming = TwistTiming.START
    image_width_px: int = 0
    image_height_px: int = 0
    noise: Noise = Noise()
    name: str = ""
    version_major: int = 1
    version_minor: int = 2
    units: int = 0

    kind: ClassVar[Kind] = Kind.HEADER
    _FIXED: ClassVar[struct.Struct] = struct.Struct("<6B2H5d9d3d7d")
    _AXES: ClassVar[struct.Struct] = struct.Struct("<6d")  # behind the name; since format 1.2

    def pack(self) -> bytes:
        name = self.name.encode("utf-8")
        if len(name) > NAME_BYTES_MAX:
            raise ValueError(f"name of {len(name)} bytes, at most {NAME_BYTES_MAX} fit a HEADER")
        camera, noise = vars(self.camera).values(), list(vars(self.noise).values())
        rotation = np.asarray(self.R_CB, float).reshape(9)
        translation = np.asarray(self.t_CB_m, float).reshape(3)
        return (
            self._FIXED.pack(
                self.version_major,
                self.version_minor,
                self.body_axes,
                self.twist_timing,
                self.units,
                len(name),
                self.image_width_px,
                self.image_height_px,
                *camera,
                *rotation,
                *translation,
                *noise[:7],
            )
            + name
            + self._AXES.pack(*noise[7:])
        )

    @classmethod
    def unpack(cls, payload: bytes) -> Header:
        need(payload, cls._FIXED.size)
        major, minor, axes, timing, units, name_bytes, width, height, *numbers = (
            cls._FIXED.unpack_from(payload)
        )
        within("version_major", major, 1, 1)
        within("body_axes", axes, 0, max(BodyAxes))
        within("twist_timing", timing, 0, max(TwistTiming))
        within("units", units, 0, 0)
        within("name_bytes", name_bytes, 0, NAME_BYTES_MAX)
        need(payload, cls._FIXED.size + name_bytes)
        end = cls._FIXED.size + name_bytes
        name = payload[cls._FIXED.size : end]
        by_axis: tuple[float, ...] = ()
        if len(payload) > end:
            need(payload, end + cls._AXES.size)
            by_axis = cls._AXES.unpack_from(payload, end)
        return cls(
            camera=Camera(*numbers[:5]),
            R_CB=np.array(numbers[5:14]).reshape(3, 3),
            t_CB_m=np.array(numbers[14:17]),
            body_axes=BodyAxes(axes),
            twist_timing=TwistTiming(timing),
            image_width_px=width,
            image_height_px=height,
            noise=Noise(*numbers[17:24], *by_axis),
            name=name.decode("utf-8", errors="replace"),
            version_major=major,
            version_minor=minor,
            units=units,
        )


@dataclass(frozen=True, eq=False)
class Start(Message):
    """The pose at the beginning; covariance of (rho, theta) packed, bias prior of (b_v, b_w)."""

    t_ns: int
    R_WB: Floats = identity()
    p_WB_m: Floats = zeros(3)
    flags: StartFlag = StartFlag(0)
    covariance: Floats = zeros(21)
    bias_mean: Floats = zeros(6)
    bias_variance: Floats = zeros(6)

    kind: ClassVar[Kind] = Kind.START
    SIZE: ClassVar[int] = 369

    def pack(self) -> bytes:
        return b"".join(
            (
                struct.pack("<Q", self.t_ns),
                bytes_of(self.R_WB, 3, 3),
                bytes_of(self.p_WB_m, 3),
                bytes([self.flags]),
                bytes_of(self.covariance, 21),
                bytes_of(self.bias_mean, 6),
                bytes_of(self.bias_variance, 6),
            )
        )

    @classmethod
    def unpack(cls, payload: bytes) -> Start:
        need(payload, cls.SIZE)
        return cls(
            t_ns=struct.unpack_from("<Q", payload)[0],
            R_WB=f64(payload, 8, 3, 3),
            p_WB_m=f64(payload, 80, 3),
            flags=StartFlag(payload[104] & 3),
            covariance=f64(payload, 105, 21),
            bias_mean=f64(payload, 273, 6),
            bias_variance=f64(payload, 321, 6),
        )


@dataclass(frozen=True, eq=False)
class Twist(Message):
    """One reading of the body's linear and angular velocity, in body axes."""

    t_ns: int
    v_B_mps: Floats = zeros(3)
    w_B_radps: Floats = zeros(3)

    kind: ClassVar[Kind] = Kind.TWIST
    SIZE: ClassVar[int] = 56

    def pack(self) -> bytes:
        return (
            struct.pack("<Q", self.t_ns) + bytes_of(self.v_B_mps, 3) + bytes_of(self.w_B_radps, 3)
        )

    @classmethod
    def unpack(cls, payload: bytes) -> Twist:
        need(payload, cls.SIZE)
        t_ns = struct.unpack_from("<Q", payload)[0]
        return cls(t_ns, f64(payload, 8, 3), f64(payload, 32, 3))


@dataclass(frozen=True, eq=False)
class Stereo(Message):
    """One stereo frame: `ids` (n,) uint32, `pixels` (n, 4) float32 in the order uL vL uR vR."""

    t_ns: int
    ids: NDArray[np.uint32]
    pixels: NDArray[np.float32]
    budget: int = NO_BUDGET

    kind: ClassVar[Kind] = Kind.STEREO
    _FIXED: ClassVar[struct.Struct] = struct.Struct("<QHH")

    def pack(self) -> bytes:
        count = len(self.ids)
        if count > OBSERVATIONS_MAX:
            raise ValueError(f"{count} observations in one frame, at most {OBSERVATIONS_MAX} fit")
        rows = np.empty(count, OBSERVATION)
        rows["id"] = self.ids
        rows["pixels"] = self.pixels
        return self._FIXED.pack(self.t_ns, self.budget, count) + rows.tobytes()

    @classmethod
    def unpack(cls, payload: bytes) -> Stereo:
        need(payload, cls._FIXED.size)
        t_ns, budget, count = cls._FIXED.unpack_from(payload)
        within("n", count, 0, OBSERVATIONS_MAX)
        need(payload, cls._FIXED.size + count * OBSERVATION.itemsize)
        rows = np.frombuffer(payload, OBSERVATION, count, cls._FIXED.size)
        return cls(t_ns, rows["id"].astype(np.uint32), rows["pixels"].astype(np.float32), budget)


@dataclass(frozen=True, eq=False)
class Truth(Message):
    """A reference pose, body to world."""

    t_ns: int
    R_WB: Floats = identity()
    p_WB_m: Floats = zeros(3)

    kind: ClassVar[Kind] = Kind.TRUTH
    SIZE: ClassVar[int] = 104

    def pack(self) -> bytes:
        return struct.pack("<Q", self.t_ns) + bytes_of(self.R_WB, 3, 3) + bytes_of(self.p_WB_m, 3)

    @classmethod
    def unpack(cls, payload: bytes) -> Truth:
        need(payload, cls.SIZE)
        t_ns = struct.unpack_from("<Q", payload)[0]
        return cls(t_ns, f64(payload, 8, 3, 3), f64(payload, 80, 3))


@dataclass(frozen=True, eq=False)
class Text(Message):
    """A remark; severity 0 info, 1 warning, 2 error."""

    text: str
    severity: int = 0

    kind: ClassVar[Kind] = Kind.TEXT

    def pack(self) -> bytes:
        text = self.text.encode("utf-8")
        if len(text) > TEXT_BYTES_MAX:
            raise ValueError(f"text of {len(text)} bytes, at most {TEXT_BYTES_MAX} fit a TEXT")
        return bytes([self.severity]) + text

    @classmethod
    def unpack(cls, payload: bytes) -> Text:
        need(payload, 1)
        within("severity", payload[0], 0, 2)
        return cls(payload[1:].decode("utf-8", errors="replace"), payload[0])


@dataclass(frozen=True, eq=False)
class End(Message):
    """How many frames there were; `frames` counts all before this one."""

    twists: int
    stereos: int
    truths: int
    landmarks: int
    frames: int

    kind: ClassVar[Kind] = Kind.END
    _FIXED: ClassVar[struct.Struct] = struct.Struct("<5I")

    def pack(self) -> bytes:
        return self._FIXED.pack(*vars(self).values())

    @classmethod
    def unpack(cls, payload: bytes) -> End:
        need(payload, cls._FIXED.size)
        return cls(*cls._FIXED.unpack_from(payload))


@dataclass(frozen=True, eq=False)
class State(Message):
    """Keep the filter's state, or bring it back at `t_ns`.

    `moved_variance` is how far the body may have moved meanwhile: variances of (rho, theta).
    """

    t_ns: int
    action: StateAction
    moved_variance: Floats = zeros(6)

    kind: ClassVar[Kind] = Kind.STATE
    SIZE: ClassVar[int] = 57
    _FIXED: ClassVar[struct.Struct] = struct.Struct("<QB")

    def pack(self) -> bytes:
        return self._FIXED.pack(self.t_ns, self.action) + bytes_of(self.moved_variance, 6)

    @classmethod
    def unpack(cls, payload: bytes) -> State:
        need(payload, cls.SIZE)
        t_ns, action = cls._FIXED.unpack_from(payload)
        within("action", action, min(StateAction), max(StateAction))
        return cls(t_ns, StateAction(action), f64(payload, 9, 6))
