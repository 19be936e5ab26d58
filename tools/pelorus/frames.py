# SPDX-License-Identifier: MIT
"""The frame kinds of docs/REPLAY-FORMAT.md, one dataclass each, with their payload bytes.

A kind's `layout` is the table of its page. `pack` gives the payload, `unpack` reads one; both say
nothing about sequence, CRC and COBS, which are `pelorus.wire`'s. Two messages are equal when their
payloads are the same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum, IntFlag
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from pelorus.layout import Floats, Layout, MalformedPayload, need, within

NO_BUDGET = 65535
OBSERVATIONS_MAX = 4096
SETTINGS_MAX = 64
NAME_BYTES_MAX = 63
TEXT_BYTES_MAX = 240
UNKNOWN_VARIANCE = 2.0**40  # of a filter that has diverged
OBSERVATION = np.dtype([("id", "<u4"), ("pixels", "<f4", (4,))])
SETTING = np.dtype([("id", "u1"), ("value", "<f8")])


class Kind(IntEnum):
    """A frame's first byte."""

    HEADER = 1
    CONFIG = 2
    START = 3
    TWIST = 4
    STEREO = 5
    TRUTH = 6
    LANDMARK = 7
    POSE = 8
    REPORT = 9
    TEXT = 10
    END = 11
    STATE = 12
    READING = 13


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


class Notice(IntEnum):
    """What a REPORT tells besides its status."""

    NONE = 0
    STARTED = 1  # the sender has just started: whatever it was told before is lost
    SAVED = 2
    RESTORED = 3  # the filter goes on from a saved state


class Sensor(IntEnum):
    """What measured a READING."""

    WHEEL = 1  # the velocity of a point of the body, in body axes
    STANDSTILL = 2  # that it does not move
    POSITION = 3  # the position of a point of the body in the world


class Role(IntEnum):
    """Where a landmark comes from."""

    KNOWN = 0
    EVICTED = 1
    FINAL = 2


def header_name(words: str) -> str:
    """The words as a HEADER can hold them: whole characters of UTF-8, and not too many.

    A file's name may hold bytes that are no text; they become question marks.
    """
    stored = words.encode("utf-8", errors="replace")[:NAME_BYTES_MAX]
    return stored.decode("utf-8", errors="ignore")


def zeros(*shape: int) -> Any:
    """A dataclass field: zeros of the given shape by default."""
    return field(default_factory=lambda: np.zeros(shape))


def unknown(*shape: int) -> Any:
    """A dataclass field: -1 everywhere by default, for variances that are not known."""
    return field(default_factory=lambda: np.full(shape, -1.0))


def identity() -> Any:
    """A dataclass field: the rotation that does nothing by default."""
    return field(default_factory=lambda: np.eye(3))


class Message:
    """A frame's content. `kind` is its number on the wire."""

    kind: ClassVar[Kind]
    layout: ClassVar[Layout]
    tail: ClassVar[Layout] = Layout("")  # what format 1.3 added; in an older payload it is absent

    def pack(self) -> bytes:
        return self.layout.pack(vars(self)) + self.tail.pack(vars(self))

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        return cls(**cls.layout.unpack(payload), **cls.added(payload, cls.layout.size))

    @classmethod
    def added(cls, payload: bytes, at: int) -> dict[str, Any]:
        """The fields of the tail; none if the payload ends before it."""
        return cls.tail.unpack(payload, at) if len(payload) > at else {}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self.pack() == other.pack()

    def __hash__(self) -> int:
        return hash((self.kind, self.pack()))


# --- what a recorder, a robot or a reference writes -----------------------------------------------


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
    version_minor: int = 3
    units: int = 0

    kind: ClassVar[Kind] = Kind.HEADER
    layout: ClassVar[Layout] = Layout(
        "version_major:B version_minor:B body_axes:B twist_timing:B units:B name_bytes:B "
        "image_width_px:H image_height_px:H camera:5d R_CB:3x3d t_CB_m:3d noise:7d",
        version_major=lambda value: within("version_major", value, 1, 1),
        body_axes=BodyAxes,
        twist_timing=TwistTiming,
        units=lambda value: within("units", value, 0, 0),
        name_bytes=lambda value: within("name_bytes", value, 0, NAME_BYTES_MAX),
    )
    BY_AXIS: ClassVar[Layout] = Layout("noise:6d")  # behind the name; since format 1.2

    def pack(self) -> bytes:
        name = self.name.encode("utf-8")
        if len(name) > NAME_BYTES_MAX:
            raise ValueError(f"name of {len(name)} bytes, at most {NAME_BYTES_MAX} fit a HEADER")
        camera, noise = list(vars(self.camera).values()), list(vars(self.noise).values())
        simple = {"name_bytes": len(name), "camera": camera, "noise": noise[:7]}
        fixed = self.layout.pack(vars(self) | simple)
        return fixed + name + self.BY_AXIS.pack({"noise": noise[7:]})

    @classmethod
    def unpack(cls, payload: bytes) -> Header:
        found = cls.layout.unpack(payload)
        end = cls.layout.size + found.pop("name_bytes")
        need(payload, end)
        noise = found["noise"].tolist()
        if len(payload) > end:
            noise += cls.BY_AXIS.unpack(payload, end)["noise"].tolist()
        name = payload[cls.layout.size : end].decode("utf-8", errors="replace")
        camera = Camera(*found["camera"].tolist())
        return cls(**found | {"camera": camera, "noise": Noise(*noise), "name": name})


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
    layout: ClassVar[Layout] = Layout(
        "t_ns:Q R_WB:3x3d p_WB_m:3d flags:B covariance:21d bias_mean:6d bias_variance:6d",
        flags=lambda value: StartFlag(value & 3),
    )


@dataclass(frozen=True, eq=False)
class Twist(Message):
    """One reading of the body's linear and angular velocity, in body axes."""

    t_ns: int
    v_B_mps: Floats = zeros(3)
    w_B_radps: Floats = zeros(3)

    kind: ClassVar[Kind] = Kind.TWIST
    layout: ClassVar[Layout] = Layout("t_ns:Q v_B_mps:3d w_B_radps:3d")


@dataclass(frozen=True, eq=False)
class Stereo(Message):
    """One stereo frame: `ids` (n,) uint32, `pixels` (n, 4) float32 in the order uL vL uR vR."""

    t_ns: int
    ids: NDArray[np.uint32]
    pixels: NDArray[np.float32]
    budget: int = NO_BUDGET

    kind: ClassVar[Kind] = Kind.STEREO
    layout: ClassVar[Layout] = Layout(
        "t_ns:Q budget:H count:H",
        count=lambda value: within("n", value, 0, OBSERVATIONS_MAX),
    )

    def pack(self) -> bytes:
        count = len(self.ids)
        if count > OBSERVATIONS_MAX:
            raise ValueError(f"{count} observations in one frame, at most {OBSERVATIONS_MAX} fit")
        rows = np.empty(count, OBSERVATION)
        rows["id"] = self.ids
        rows["pixels"] = self.pixels
        return self.layout.pack(vars(self) | {"count": count}) + rows.tobytes()

    @classmethod
    def unpack(cls, payload: bytes) -> Stereo:
        found = cls.layout.unpack(payload)
        rows = _rows(payload, cls.layout.size, OBSERVATION, found["count"])
        ids, pixels = rows["id"].astype(np.uint32), rows["pixels"].astype(np.float32)
        return cls(found["t_ns"], ids, pixels, found["budget"])


def _rows(payload: bytes, at: int, row: np.dtype[Any], count: int) -> NDArray[Any]:
    need(payload, at + count * row.itemsize)
    return np.frombuffer(payload, row, count, at)


@dataclass(frozen=True, eq=False)
class Truth(Message):
    """A reference pose, body to world."""

    t_ns: int
    R_WB: Floats = identity()
    p_WB_m: Floats = zeros(3)

    kind: ClassVar[Kind] = Kind.TRUTH
    layout: ClassVar[Layout] = Layout("t_ns:Q R_WB:3x3d p_WB_m:3d")


@dataclass(frozen=True, eq=False)
class Reading(Message):
    """One to three numbers of a sensor at `at_B_m` on the body; bits of `axes` say which."""

    t_ns: int
    sensor: int  # Sensor, or one of a later version
    axes: int = 7
    value: Floats = zeros(3)
    sigma: Floats = zeros(3)
    at_B_m: Floats = zeros(3)

    kind: ClassVar[Kind] = Kind.READING
    layout: ClassVar[Layout] = Layout("t_ns:Q sensor:B axes:B value:3d sigma:3f at_B_m:3f")


@dataclass(frozen=True, eq=False)
class Text(Message):
    """A remark; severity 0 info, 1 warning, 2 error."""

    text: str
    severity: int = 0

    kind: ClassVar[Kind] = Kind.TEXT
    layout: ClassVar[Layout] = Layout(
        "severity:B", severity=lambda value: within("severity", value, 0, 2)
    )

    def pack(self) -> bytes:
        text = self.text.encode("utf-8")
        if len(text) > TEXT_BYTES_MAX:
            raise ValueError(f"text of {len(text)} bytes, at most {TEXT_BYTES_MAX} fit a TEXT")
        return super().pack() + text

    @classmethod
    def unpack(cls, payload: bytes) -> Text:
        text = payload[1:].decode("utf-8", errors="replace")
        return cls(text, **cls.layout.unpack(payload))


@dataclass(frozen=True, eq=False)
class End(Message):
    """How many frames there were; `frames` counts all before this one.

    Bits of `differs` say of which kinds another number arrived than the END says that this one
    answers, and `arrived_*`, in the same order, how many; the others are 0.
    """

    twists: int
    stereos: int
    truths: int
    landmarks: int
    frames: int
    readings: int = 0
    differs: int = 0
    arrived_twists: int = 0
    arrived_stereos: int = 0
    arrived_truths: int = 0
    arrived_landmarks: int = 0
    arrived_readings: int = 0

    kind: ClassVar[Kind] = Kind.END
    layout: ClassVar[Layout] = Layout("twists:I stereos:I truths:I landmarks:I frames:I")
    tail: ClassVar[Layout] = Layout(
        "readings:I differs:B arrived_twists:I arrived_stereos:I arrived_truths:I "
        "arrived_landmarks:I arrived_readings:I"
    )

    @property
    def incomplete(self) -> dict[Kind, int]:
        """How many arrived, of the kinds of which that is another number than was sent."""
        counts = (
            (Kind.TWIST, self.arrived_twists),
            (Kind.STEREO, self.arrived_stereos),
            (Kind.TRUTH, self.arrived_truths),
            (Kind.LANDMARK, self.arrived_landmarks),
            (Kind.READING, self.arrived_readings),
        )
        return {kind: count for at, (kind, count) in enumerate(counts) if self.differs >> at & 1}


@dataclass(frozen=True, eq=False)
class State(Message):
    """Keep the filter's state, or bring it back at `t_ns`.

    `moved_variance` is how far the body may have moved meanwhile: variances of (rho, theta).
    """

    t_ns: int
    action: StateAction
    moved_variance: Floats = zeros(6)

    kind: ClassVar[Kind] = Kind.STATE
    layout: ClassVar[Layout] = Layout("t_ns:Q action:B moved_variance:6d", action=StateAction)


# --- what a filter writes (CONFIG and LANDMARK may come from a recorder too) ----------------------


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
    layout: ClassVar[Layout] = Layout(
        "build_fingerprint:I max_landmarks:H max_observations:H block_observations:B "
        "real_bytes:B count:B",
        count=lambda value: within("n", value, 0, SETTINGS_MAX),
    )

    def pack(self) -> bytes:
        fixed = self.layout.pack(vars(self) | {"count": len(self.settings)})
        return fixed + np.array(list(self.settings.items()), SETTING).tobytes()

    @classmethod
    def unpack(cls, payload: bytes) -> Config:
        found = cls.layout.unpack(payload)
        rows = _rows(payload, cls.layout.size, SETTING, found.pop("count"))
        return cls({int(row["id"]): float(row["value"]) for row in rows}, **found)


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
    layout: ClassVar[Layout] = Layout(
        "t_ns:Q role:B _:B id:I times_seen:I p_W_m:3d covariance:6d", role=Role
    )


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
    trace: float = -1.0  # of the whole covariance; negative: not known
    bias_variance: Floats = unknown(6)  # negative: not known

    kind: ClassVar[Kind] = Kind.POSE
    layout: ClassVar[Layout] = Layout(
        "t_ns:Q real_bytes:B after_stereo:B reset_count:H p_WB_m:3d",
        after_stereo=lambda flags: bool(flags & 1),
    )
    tail: ClassVar[Layout] = Layout("trace:d bias_variance:6f")
    REALS: ClassVar[dict[int, Layout]] = {
        size: Layout(
            f"R_WB:3x3{code} covariance:21{code} v_B_mps:3{code} w_B_radps:3{code} bias:6{code} "
            f"velocity_covariance:21{code}"
        )
        for size, code in ((4, "f"), (8, "d"))
    }

    @property
    def knows_covariance(self) -> bool:
        """False once the filter has diverged."""
        return bool(self.covariance[0] < UNKNOWN_VARIANCE)

    def pack(self) -> bytes:
        values = vars(self)
        reals = self.REALS[self.real_bytes].pack(values)
        return self.layout.pack(values) + reals + self.tail.pack(values)

    @classmethod
    def unpack(cls, payload: bytes) -> Pose:
        found = cls.layout.unpack(payload)
        if found["real_bytes"] not in cls.REALS:
            raise MalformedPayload(f"reals of {found['real_bytes']} bytes, 4 or 8 are defined")
        layout = cls.REALS[found["real_bytes"]]
        reals = layout.unpack(payload, cls.layout.size)
        return cls(**found, **reals, **cls.added(payload, cls.layout.size + layout.size))


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
    notice: int = Notice.NONE  # Notice, or one of a later version

    kind: ClassVar[Kind] = Kind.REPORT
    layout: ClassVar[Layout] = Layout(
        "t_ns:Q subject:B status:b health:B _:B reasons:H budget:H observations:H matched:H used:H "
        "gated:H created:H evicted:H refused:H duplicates:H no_room:H poor:H left_out:H "
        "blocks_failed:H active:H nis_dof:H nis:f update_us:I",
        status=lambda value: within("status", value, -128, 0),
        health=lambda value: within("health", value, 0, 3),
    )
    UPPER: ClassVar[Layout] = Layout("reasons:H")  # the upper half of them; since format 1.2
    tail: ClassVar[Layout] = Layout("notice:B _:B")

    def pack(self) -> bytes:
        upper, lower = divmod(self.reasons, 1 << 16)
        fixed = self.layout.pack(vars(self) | {"reasons": lower})
        return fixed + self.UPPER.pack({"reasons": upper}) + self.tail.pack(vars(self))

    @classmethod
    def unpack(cls, payload: bytes) -> Report:
        report = cls(**cls.layout.unpack(payload))
        if len(payload) == cls.layout.size:
            return report
        upper = cls.UPPER.unpack(payload, cls.layout.size)["reasons"]
        added = cls.added(payload, cls.layout.size + cls.UPPER.size)
        return replace(report, reasons=upper << 16 | report.reasons, **added)


KINDS: dict[int, type[Message]] = {cls.kind: cls for cls in Message.__subclasses__()}
