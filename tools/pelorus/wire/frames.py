# SPDX-License-Identifier: MIT
"""The frame kinds of docs/REPLAY-FORMAT.md, one dataclass each, with their payload bytes.

The bytes are those of the tables in `pelorus.wire.schema`: a dataclass has the fields of its table,
under the same names. `pack` gives the payload, `unpack` reads one; both say nothing about
sequence, CRC and COBS, which are `pelorus.wire.framing`'s. Two messages are equal when their
payloads are the same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import IntFlag
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from pelorus.wire import schema
from pelorus.wire.layout import Floats, need, row_type
from pelorus.wire.message import (
    BodyAxes,
    Kind,
    Message,
    Notice,
    Process,
    Role,
    StateAction,
    TwistTiming,
)

# From pelorus.wire.message, for users of the dataclasses below.
__all__ = [
    "BodyAxes",
    "Kind",
    "Message",
    "Notice",
    "Process",
    "Role",
    "StateAction",
    "TwistTiming",
]

NO_BUDGET = schema.LIMITS["no_budget"]
OBSERVATIONS_MAX = schema.LIMITS["observations"]
IMU_READINGS_MAX = schema.LIMITS["imu_readings"]  # in one frame
NAME_BYTES_MAX = schema.LIMITS["name_bytes"]
TEXT_BYTES_MAX = schema.LIMITS["text_bytes"]
UNKNOWN_VARIANCE = float(schema.LIMITS["unknown_variance"])  # of a filter that has diverged
OBSERVATION = row_type(schema.MESSAGES["STEREO"].rows)
SIGMA = row_type(schema.MESSAGES["STEREO"].columns)
SETTING = row_type(schema.MESSAGES["CONFIG"].rows)
NOT_SEEN_PX = np.float32(schema.LIMITS["not_seen_px"])  # in the right picture


class StartFlag(IntFlag):
    """Which fields of a START are given."""

    COVARIANCE = 1
    BIAS_PRIOR = 2


class TruthKnows(IntFlag):
    """Flags of the fields that a TRUTH has besides the pose."""

    VELOCITY = 1
    BIAS = 2


def header_name(words: str) -> str:
    """Returns the words as a HEADER can hold them: whole characters of UTF-8, and not too many.

    A file's name may hold bytes that are no text; they become question marks.
    """
    stored = words.encode("utf-8", errors="replace")[:NAME_BYTES_MAX]
    return stored.decode("utf-8", errors="ignore")


def zeros(*shape: int) -> Any:
    """Declares a dataclass field of zeros of the given shape."""
    return field(default_factory=lambda: np.zeros(shape))


def unknown(*shape: int) -> Any:
    """Declares a dataclass field of -1, for unknown variances."""
    return field(default_factory=lambda: np.full(shape, -1.0))


def identity() -> Any:
    """Declares a dataclass field with the identity rotation."""
    return field(default_factory=lambda: np.eye(3))


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
    """The noises that a recorder suggests; negative: none."""

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
    gyro_noise: float = -1.0  # of an IMU, as Kalibr gives them: rad/s/sqrt(Hz)
    accel_noise: float = -1.0  # m/s^2/sqrt(Hz)
    gyro_walk: float = -1.0  # rad/s^2/sqrt(Hz)
    accel_walk: float = -1.0  # m/s^3/sqrt(Hz)
    bias_accel_sigma: float = -1.0  # m/s^2
    gravity: float = -1.0  # m/s^2


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
    process: Process = Process.TWIST

    choices: ClassVar = {"body_axes": BodyAxes, "twist_timing": TwistTiming, "process": Process}

    def values(self) -> dict[str, Any]:
        noise = vars(self.noise)
        axes = {name: [noise[part] for part in parts] for name, parts in BY_AXIS.items()}
        arrays = {name: np.array(values) for name, values in axes.items()}
        return super().values() | vars(self.camera) | noise | arrays

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
    """The pose at the beginning; covariance of (rho, theta) packed, bias prior of (b_v, b_w).

    With an IMU the biases are (b_a, b_g), and `velocity` is along the body's axes; it is given
    where each of its variances is above 0.
    """

    t_ns: int
    R_WB: Floats = identity()
    p_WB_m: Floats = zeros(3)
    flags: StartFlag = StartFlag(0)
    covariance: Floats = zeros(21)
    bias_mean: Floats = zeros(6)
    bias_variance: Floats = zeros(6)
    velocity: Floats = unknown(3)
    velocity_variance: Floats = unknown(3)

    choices: ClassVar = {"flags": lambda value: StartFlag(value & 3)}


@dataclass(frozen=True, eq=False)
class Twist(Message, kind=Kind.TWIST):
    """One reading of the body's linear and angular velocity, in body axes."""

    t_ns: int
    v_B_mps: Floats = zeros(3)
    w_B_radps: Floats = zeros(3)


@dataclass(frozen=True, eq=False)
class Imu(Message, kind=Kind.IMU):
    """One to IMU_READINGS_MAX readings of an IMU, (n, 3) each, in its axes; kept as float32.

    Reading k is of `t_ns` + k `period_ns`. `a_B_mps2` is specific force: at rest 9.81 upwards.
    """

    t_ns: int
    a_B_mps2: Floats
    w_B_radps: Floats
    period_ns: int = 0  # of a single reading

    @property
    def times_ns(self) -> list[int]:
        """Returns the time of each reading."""
        return [self.t_ns + k * self.period_ns for k in range(len(self.a_B_mps2))]

    def values(self) -> dict[str, Any]:
        return super().values() | {"count": len(self.a_B_mps2)}

    def pack(self) -> bytes:
        count = len(self.a_B_mps2)
        if not 1 <= count <= IMU_READINGS_MAX:
            raise ValueError(f"{count} readings in one IMU frame, 1 to {IMU_READINGS_MAX} fit")
        if np.shape(self.a_B_mps2) != (count, 3) or np.shape(self.w_B_radps) != (count, 3):
            raise ValueError(
                f"readings of shapes {np.shape(self.a_B_mps2)} and {np.shape(self.w_B_radps)} "
                f"where ({count}, 3) is expected"
            )
        with np.errstate(over="ignore", invalid="ignore"):  # beyond float32: infinite
            rows = np.hstack([self.a_B_mps2, self.w_B_radps]).astype("<f4")
        return super().pack() + rows.tobytes()

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:
        rows = rows_of(payload, end, _IMU_ROW, values["count"])["numbers"].astype(np.float64)
        return cls(values["t_ns"], rows[:, :3], rows[:, 3:], values["period_ns"])


@dataclass(frozen=True, eq=False)
class Stereo(Message, kind=Kind.STEREO):
    """One stereo frame: `ids` (n,) uint32, `pixels` (n, 4) float32 in the order uL vL uR vR, the
    last two NOT_SEEN_PX where the left picture alone shows the point. `sigmas` (n,) float32, px: 0
    is the setting pixel-sigma, and None that of all.
    """

    t_ns: int
    ids: NDArray[np.uint32]
    pixels: NDArray[np.float32]
    budget: int = NO_BUDGET
    sigmas: NDArray[np.float32] | None = None

    def values(self) -> dict[str, Any]:
        return super().values() | {"count": len(self.ids)}

    def pack(self) -> bytes:
        count = len(self.ids)
        if count > OBSERVATIONS_MAX:
            raise ValueError(f"{count} observations in one frame, at most {OBSERVATIONS_MAX} fit")
        rows = np.empty(count, _STEREO_ROW)
        rows["id"] = self.ids
        rows["pixels"] = self.pixels
        own = np.zeros(count, SIGMA["sigma_px"])
        if self.sigmas is not None:
            own[:] = self.sigmas
        return super().pack() + rows.tobytes() + (own.tobytes() if own.any() else b"")

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:
        rows = rows_of(payload, end, _STEREO_ROW, values["count"])
        ids, pixels = rows["id"].astype(np.uint32), rows["pixels"].astype(np.float32)
        behind = end + rows.nbytes
        if len(payload) <= behind:  # none has one of its own, or the writer is of before 1.7
            return cls(values["t_ns"], ids, pixels, values["budget"])
        own = rows_of(payload, behind, SIGMA, len(ids))["sigma_px"].astype(np.float32)
        return cls(values["t_ns"], ids, pixels, values["budget"], own)


# The numbers of a row after the id, as one array.
_STEREO_ROW = np.dtype(
    [("id", OBSERVATION["id"]), ("pixels", "<f4", (len(OBSERVATION.names or ()) - 1,))]
)
assert _STEREO_ROW.itemsize == OBSERVATION.itemsize


_IMU_ROW = np.dtype([("numbers", "<f4", (6,))])
assert _IMU_ROW.itemsize == row_type(schema.MESSAGES["IMU"].rows).itemsize


def rows_of(payload: bytes, at: int, row: np.dtype[Any], count: int) -> NDArray[Any]:
    need(payload, at + count * row.itemsize)
    return np.frombuffer(payload, row, count, at)


@dataclass(frozen=True, eq=False)
class Truth(Message, kind=Kind.TRUTH):
    """A reference pose, body to world, and what else is known by the flags in `knows`.

    That may be the velocity along the body's axes, and the biases of the readings, in START's
    order.
    """

    t_ns: int
    R_WB: Floats = identity()
    p_WB_m: Floats = zeros(3)
    knows: TruthKnows = TruthKnows(0)
    velocity: Floats = zeros(3)
    bias: Floats = zeros(6)

    choices: ClassVar = {"knows": lambda value: TruthKnows(value & 3)}


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

    Bits of `differs` are the kinds (COUNTED) of which another number arrived than the answered END
    says, and `arrived` has these numbers; the others are 0.
    """

    twists: int
    stereos: int
    truths: int
    landmarks: int
    frames: int
    readings: int = 0
    differs: int = 0
    arrived: tuple[int, ...] = (0,) * 5
    imus: int = 0
    imus_arrived: int = 0

    COUNTED: ClassVar = (
        *(Kind.TWIST, Kind.STEREO, Kind.TRUTH, Kind.LANDMARK, Kind.READING),
        Kind.IMU,
    )

    @property
    def incomplete(self) -> dict[Kind, int]:
        """Returns the numbers that arrived, of the kinds where these differ from those sent."""
        counts = zip(self.COUNTED, (*self.arrived, self.imus_arrived), strict=True)
        return {kind: count for at, (kind, count) in enumerate(counts) if self.differs >> at & 1}


@dataclass(frozen=True, eq=False)
class State(Message, kind=Kind.STATE):
    """A request to save the filter's state, or to restore it at `t_ns`.

    `moved_variance` is how far the body may have moved meanwhile: variances of (rho, theta).
    """

    t_ns: int
    action: StateAction
    moved_variance: Floats = zeros(6)

    choices: ClassVar = {"action": StateAction}


# --- what a filter writes (CONFIG and LANDMARK may come from a recorder too) ----------------------


@dataclass(frozen=True, eq=False)
class Config(Message, kind=Kind.CONFIG):
    """Settings by id (see `pelorus.wire.settings`), and the build in which they are in force."""

    settings: dict[int, float] = field(default_factory=dict)
    build_fingerprint: int = 0
    max_landmarks: int = 0
    max_observations: int = 0
    block_observations: int = 0
    real_bytes: int = 0

    def values(self) -> dict[str, Any]:
        return super().values() | {"count": len(self.settings)}

    def pack(self) -> bytes:
        return super().pack() + np.array(list(self.settings.items()), SETTING).tobytes()

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:
        rows = rows_of(payload, end, SETTING, values.pop("count"))
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
    """The filter's estimate after a message; reals have `real_bytes` bytes, the position eight."""

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
        """Returns False once the filter has diverged."""
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
    innovation_rows: int = 0
    innovation_d2: float = -1.0  # unknown if there are no rows
    innovation_log_det: float = -1.0

    composed: ClassVar = ("reasons",)

    def values(self) -> dict[str, Any]:
        upper, lower = divmod(self.reasons, 1 << 16)
        return super().values() | {"reasons": lower, "reasons_upper": upper}

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:  # noqa: ARG003
        values["reasons"] |= values.pop("reasons_upper", 0) << 16
        return cls(**values)
