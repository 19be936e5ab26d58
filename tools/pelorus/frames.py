# SPDX-License-Identifier: MIT
"""The frame kinds of docs/REPLAY-FORMAT.md, one dataclass each, with their payload bytes.

The bytes are those of the tables in `pelorus.schema`: a dataclass has the fields of its table,
under the same names. `pack` gives the payload, `unpack` reads one; both say nothing about sequence,
CRC and COBS, which are `pelorus.wire`'s. Two messages are equal when their payloads are the same
bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from enum import IntEnum, IntFlag
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from pelorus import schema
from pelorus.layout import Floats, Layout, need, row_type

NO_BUDGET = schema.LIMITS["no_budget"]
OBSERVATIONS_MAX = schema.LIMITS["observations"]
NAME_BYTES_MAX = schema.LIMITS["name_bytes"]
TEXT_BYTES_MAX = schema.LIMITS["text_bytes"]
UNKNOWN_VARIANCE = float(schema.LIMITS["unknown_variance"])  # of a filter that has diverged
OBSERVATION = row_type(schema.MESSAGES["STEREO"].rows)
SETTING = row_type(schema.MESSAGES["CONFIG"].rows)


class Kind(IntEnum):
    """A frame's first byte."""

    HEADER = schema.kind("HEADER")
    CONFIG = schema.kind("CONFIG")
    START = schema.kind("START")
    TWIST = schema.kind("TWIST")
    STEREO = schema.kind("STEREO")
    TRUTH = schema.kind("TRUTH")
    LANDMARK = schema.kind("LANDMARK")
    POSE = schema.kind("POSE")
    REPORT = schema.kind("REPORT")
    TEXT = schema.kind("TEXT")
    END = schema.kind("END")
    STATE = schema.kind("STATE")
    READING = schema.kind("READING")


class BodyAxes(IntEnum):
    """Which way the body's x, y and z point."""

    FORWARD_LEFT_UP = schema.number("body_axes", "FORWARD_LEFT_UP")
    FORWARD_RIGHT_DOWN = schema.number("body_axes", "FORWARD_RIGHT_DOWN")
    OTHER = schema.number("body_axes", "OTHER")


class TwistTiming(IntEnum):
    """When a reading holds: START on [t_j, t_j+1), END on (t_j-1, t_j], MID the mean of both."""

    START = schema.number("twist_timing", "START")
    END = schema.number("twist_timing", "END")
    MID = schema.number("twist_timing", "MID")


class StartFlag(IntFlag):
    """Which fields of a START are given."""

    COVARIANCE = 1
    BIAS_PRIOR = 2


class StateAction(IntEnum):
    """What a STATE asks for."""

    SAVE = schema.number("action", "SAVE")
    RESTORE = schema.number("action", "RESTORE")


class Notice(IntEnum):
    """What a REPORT tells besides its status."""

    NONE = schema.number("notice", "NONE")
    # the sender has just started: whatever it was told before is lost
    STARTED = schema.number("notice", "STARTED")
    SAVED = schema.number("notice", "SAVED")
    RESTORED = schema.number("notice", "RESTORED")  # the filter goes on from a saved state


class Role(IntEnum):
    """Where a landmark comes from."""

    KNOWN = schema.number("role", "KNOWN")
    EVICTED = schema.number("role", "EVICTED")
    FINAL = schema.number("role", "FINAL")


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
    choices: ClassVar[Mapping[str, Callable[[int], Any]]] = {}  # what a number is made into

    def __init_subclass__(cls, kind: Kind | None = None) -> None:
        if kind is not None:
            cls.kind = kind
            cls.layout = Layout(schema.MESSAGES[kind.name])

    def pack(self) -> bytes:
        return self.layout.pack(self.values())

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        values, end = cls.layout.unpack(payload)
        chosen = {name: choose(values[name]) for name, choose in cls.choices.items()}
        return cls.of_values(values | chosen, payload, end)

    def values(self) -> dict[str, Any]:
        """By the names of the table."""
        return vars(self)

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:  # noqa: ARG003
        """The values are those before `end` in the payload; only rows lie behind it."""
        return cls(**values)

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
class Header(Message, kind=Kind.HEADER):
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
    version_major: int = schema.LIMITS["version_major"]
    version_minor: int = schema.LIMITS["version_minor"]
    units: int = 0

    choices: ClassVar = {"body_axes": BodyAxes, "twist_timing": TwistTiming}

    def values(self) -> dict[str, Any]:
        noise = vars(self.noise)
        axes = {name: [noise[part] for part in parts] for name, parts in BY_AXIS.items()}
        arrays = {name: np.array(values) for name, values in axes.items()}
        return vars(self) | vars(self.camera) | noise | arrays

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:  # noqa: ARG003
        camera = Camera(**{part.name: values.pop(part.name) for part in fields(Camera)})
        noise = {f.name: values.pop(f.name) for f in fields(Noise) if f.name in values}
        for name, parts in BY_AXIS.items():
            if name in values:
                noise |= zip(parts, values.pop(name).tolist(), strict=True)
        return cls(camera=camera, noise=Noise(**noise), **values)


# The fields of Noise that are one array in a HEADER.
BY_AXIS = {
    f"{what}_sigma_axes_{unit}": [f"{what}_sigma_{axis}_{unit}" for axis in "xyz"]
    for what, unit in (("velocity", "mps"), ("gyro", "radps"))
}


@dataclass(frozen=True, eq=False)
class Start(Message, kind=Kind.START):
    """The pose at the beginning; covariance of (rho, theta) packed, bias prior of (b_v, b_w)."""

    t_ns: int
    R_WB: Floats = identity()
    p_WB_m: Floats = zeros(3)
    flags: StartFlag = StartFlag(0)
    covariance: Floats = zeros(21)
    bias_mean: Floats = zeros(6)
    bias_variance: Floats = zeros(6)

    choices: ClassVar = {"flags": lambda value: StartFlag(value & 3)}


@dataclass(frozen=True, eq=False)
class Twist(Message, kind=Kind.TWIST):
    """One reading of the body's linear and angular velocity, in body axes."""

    t_ns: int
    v_B_mps: Floats = zeros(3)
    w_B_radps: Floats = zeros(3)


@dataclass(frozen=True, eq=False)
class Stereo(Message, kind=Kind.STEREO):
    """One stereo frame: `ids` (n,) uint32, `pixels` (n, 4) float32 in the order uL vL uR vR."""

    t_ns: int
    ids: NDArray[np.uint32]
    pixels: NDArray[np.float32]
    budget: int = NO_BUDGET

    def values(self) -> dict[str, Any]:
        return vars(self) | {"count": len(self.ids)}

    def pack(self) -> bytes:
        count = len(self.ids)
        if count > OBSERVATIONS_MAX:
            raise ValueError(f"{count} observations in one frame, at most {OBSERVATIONS_MAX} fit")
        rows = np.empty(count, _STEREO_ROW)
        rows["id"] = self.ids
        rows["pixels"] = self.pixels
        return super().pack() + rows.tobytes()

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:
        rows = _rows(payload, end, _STEREO_ROW, values["count"])
        ids, pixels = rows["id"].astype(np.uint32), rows["pixels"].astype(np.float32)
        return cls(values["t_ns"], ids, pixels, values["budget"])


# The row's numbers behind the id as one array.
_STEREO_ROW = np.dtype(
    [("id", OBSERVATION["id"]), ("pixels", "<f4", (len(OBSERVATION.names or ()) - 1,))]
)
assert _STEREO_ROW.itemsize == OBSERVATION.itemsize


def _rows(payload: bytes, at: int, row: np.dtype[Any], count: int) -> NDArray[Any]:
    need(payload, at + count * row.itemsize)
    return np.frombuffer(payload, row, count, at)


@dataclass(frozen=True, eq=False)
class Truth(Message, kind=Kind.TRUTH):
    """A reference pose, body to world."""

    t_ns: int
    R_WB: Floats = identity()
    p_WB_m: Floats = zeros(3)


@dataclass(frozen=True, eq=False)
class Reading(Message, kind=Kind.READING):
    """One to three numbers of a sensor at `at_B_m` on the body; bits of `axes` say which."""

    t_ns: int
    sensor: int  # of schema.SENSORS, or one of a later version
    axes: int = 7
    value: Floats = zeros(3)
    sigma: Floats = zeros(3)
    at_B_m: Floats = zeros(3)


@dataclass(frozen=True, eq=False)
class Text(Message, kind=Kind.TEXT):
    """A remark; severity 0 info, 1 warning, 2 error."""

    text: str
    severity: int = 0


@dataclass(frozen=True, eq=False)
class End(Message, kind=Kind.END):
    """How many frames there were; `frames` counts all before this one.

    Bits of `differs` say of which kinds (COUNTED) another number arrived than the END says that
    this one answers, and `arrived` how many; the others are 0.
    """

    twists: int
    stereos: int
    truths: int
    landmarks: int
    frames: int
    readings: int = 0
    differs: int = 0
    arrived: tuple[int, ...] = (0, 0, 0, 0, 0)

    COUNTED: ClassVar = (Kind.TWIST, Kind.STEREO, Kind.TRUTH, Kind.LANDMARK, Kind.READING)

    @property
    def incomplete(self) -> dict[Kind, int]:
        """How many arrived, of the kinds of which that is another number than was sent."""
        counts = zip(self.COUNTED, self.arrived, strict=True)
        return {kind: count for at, (kind, count) in enumerate(counts) if self.differs >> at & 1}


@dataclass(frozen=True, eq=False)
class State(Message, kind=Kind.STATE):
    """Keep the filter's state, or bring it back at `t_ns`.

    `moved_variance` is how far the body may have moved meanwhile: variances of (rho, theta).
    """

    t_ns: int
    action: StateAction
    moved_variance: Floats = zeros(6)

    choices: ClassVar = {"action": StateAction}


# --- what a filter writes (CONFIG and LANDMARK may come from a recorder too) ----------------------


@dataclass(frozen=True, eq=False)
class Config(Message, kind=Kind.CONFIG):
    """Settings by id (see `pelorus.settings`), and of which build they are in force."""

    settings: dict[int, float] = field(default_factory=dict)
    build_fingerprint: int = 0
    max_landmarks: int = 0
    max_observations: int = 0
    block_observations: int = 0
    real_bytes: int = 0

    def values(self) -> dict[str, Any]:
        return vars(self) | {"count": len(self.settings)}

    def pack(self) -> bytes:
        return super().pack() + np.array(list(self.settings.items()), SETTING).tobytes()

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:
        rows = _rows(payload, end, SETTING, values.pop("count"))
        return cls({int(row["id"]): float(row["value"]) for row in rows}, **values)


@dataclass(frozen=True, eq=False)
class Landmark(Message, kind=Kind.LANDMARK):
    """A landmark in the world with its covariance, packed, m^2."""

    id: int
    p_W_m: Floats = zeros(3)
    covariance: Floats = zeros(6)
    role: Role = Role.KNOWN
    t_ns: int = 0
    times_seen: int = 0

    choices: ClassVar = {"role": Role}


@dataclass(frozen=True, eq=False)
class Pose(Message, kind=Kind.POSE):
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

    choices: ClassVar = {"after_stereo": lambda flags: bool(flags & 1)}

    @property
    def knows_covariance(self) -> bool:
        """False once the filter has diverged."""
        return bool(self.covariance[0] < UNKNOWN_VARIANCE)


@dataclass(frozen=True, eq=False)
class Report(Message, kind=Kind.REPORT):
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

    def values(self) -> dict[str, Any]:
        upper, lower = divmod(self.reasons, 1 << 16)
        return vars(self) | {"reasons": lower, "reasons_upper": upper}

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:  # noqa: ARG003
        values["reasons"] |= values.pop("reasons_upper", 0) << 16
        return cls(**values)


KINDS: dict[int, type[Message]] = {cls.kind: cls for cls in Message.__subclasses__()}
