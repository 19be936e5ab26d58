# SPDX-License-Identifier: MIT
"""The filter, from Python: the same library that the robot runs, the same bits.

    from pelorus import Calibration, Filter, observations

    filter = Filter(Calibration(fx_px=450, fy_px=450, cx_px=320, cy_px=240, baseline_m=0.12))
    filter.predict(t_ns, v_B_mps, w_B_radps)          # at every twist
    report = filter.update(t_ns, observations(ids, pixels))  # at every stereo pair
    R_WB, p_WB_m = filter.pose()

Frames: W world, B body, C left camera (x right, y down, z forward). Times are whole nanoseconds,
angles radians, lengths metres. Arrays are float64 of the stated shapes, pixels float32. What the
filter refuses is a FilterError with the status's text, and changes nothing but counts. One filter
is not thread-safe; several filters are independent.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pelorus.errors import PelorusError
from pelorus.native import binding
from pelorus.native.arguments import address, are_whole, checked, kind_of, real, whole_number
from pelorus.native.binding import Health, Precision, ReadingResult, Report, Supervision
from pelorus.native.configured import Configured, Named, of_recording
from pelorus.wire import schema
from pelorus.wire.frames import Message
from pelorus.wire.layout import unpack_symmetric
from pelorus.wire.reason import Reason

__all__ = [
    "NOT_SEEN_PX",
    "OBSERVATION",
    "Calibration",
    "Filter",
    "FilterError",
    "Health",
    "KnownLandmark",
    "Pose",
    "Reason",
    "Report",
    "Supervision",
    "observations",
]

Floats = NDArray[np.float64]

# One landmark in a rectified stereo pair, as the library has it: id, four pixels and their sigma.
PIXELS = ("uL_px", "vL_px", "uR_px", "vR_px")
OBSERVATION = np.dtype([("id", "<u4"), *((name, "<f4") for name in PIXELS), ("sigma_px", "<f4")])
LANDMARK = np.dtype(
    [("id", "<u4"), ("times_seen", "<u4"), ("times_gated", "<u4"), ("last_seen_ns", "<u8"),
     ("known", "?"), ("p_W_m", "<f8", 3), ("P_W_m2", "<f8", (3, 3))], align=True
)  # fmt: skip
OTHER_MODE = schema.number("status", "MODE")
NO_HINT: Mapping[int, str] = {}
NO_BUDGET = schema.LIMITS["no_budget"]
NOT_SEEN_PX = float(schema.LIMITS["not_seen_px"])  # in the right picture
MOST_NS = 2**64 - 1
MOST_ID = 2**32 - 1


class FilterError(PelorusError):
    """The filter refused a call. `status` is its number, negative, `call` the function."""

    def __init__(self, call: str, status: int, text: str) -> None:
        super().__init__(f"{call}: {text}")
        self.call, self.status = call, status


class Pose(NamedTuple):
    """A rigid motion x -> R x + p: R (3, 3), p (3,) in metres."""

    R: Floats
    p: Floats


class KnownLandmark(NamedTuple):
    """A landmark of a map: position in the world (3,), m, and its covariance (3, 3), m^2."""

    p_W_m: ArrayLike
    P_W_m2: ArrayLike


@dataclass(frozen=True)
class Calibration:
    """A rectified stereo camera and its place on the body.

    A point s_B of the body is R_CB s_B + t_CB_m in the left camera; R_CB (3, 3), t_CB_m (3,).
    """

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    baseline_m: float
    R_CB: ArrayLike = field(default_factory=lambda: np.eye(3))
    t_CB_m: ArrayLike = (0.0, 0.0, 0.0)

    @classmethod
    def from_file(cls, path: str | Path) -> Self:
        """Reads a calibration.json, as for `pelorus convert`."""
        from pelorus.rig import calibration  # noqa: PLC0415 - reads files, which most callers do not

        return cls.of_header(calibration.read(Path(path)))

    @classmethod
    def of_header(cls, header: Any) -> Self:
        """Returns the calibration of a recording's HEADER."""
        return cls(**vars(header.camera), R_CB=header.R_CB, t_CB_m=header.t_CB_m)


def observations(
    ids: ArrayLike, pixels: ArrayLike, sigmas: ArrayLike | None = None
) -> NDArray[np.void]:
    """Returns the observations of a frame for Filter.update.

    ids (n,), 0 to 2^32 - 1, may be floats with whole values (a column of a table); pixels are (n,
    4) of (uL, vL, uR, vR), the last two NOT_SEEN_PX where the left picture alone shows the point;
    sigmas (n,) of these pixels, px, where 0 or None is the setting pixel_sigma.
    """
    numbers, places = np.asarray(ids), np.asarray(pixels)
    if numbers.ndim != 1 or (numbers.size and not are_whole(numbers)):
        raise PelorusError(f"ids: {kind_of(numbers)}; whole numbers of shape (n,) are wanted")
    if numbers.size and not (numbers.min() >= 0 and numbers.max() <= MOST_ID):
        raise PelorusError(f"ids: {numbers.min()} to {numbers.max()}; 0 to {MOST_ID} are possible")
    frame = np.empty(len(numbers), OBSERVATION)
    frame["id"] = numbers
    pixel = checked("pixels", places, (len(numbers), 4), np.float32)
    for column, name in enumerate(PIXELS):
        frame[name] = pixel[:, column]
    frame["sigma_px"] = (
        0 if sigmas is None else checked("sigmas", np.asarray(sigmas), (len(numbers),), np.float32)
    )
    return frame


def _pose(name: str, R: ArrayLike, p: ArrayLike) -> binding.Pose:
    pose = binding.Pose()
    pose.R[:] = checked(f"{name}: R", R, (3, 3)).ravel()
    pose.p[:] = checked(f"{name}: p", p, (3,))
    return pose


class Filter:
    """A stereo visual-inertial SLAM filter: twists or readings of an IMU, and stereo observations
    in; pose and landmarks with covariance out.

    `config` names settings as the command line does, {"pixel-sigma": 1.5, "process": "imu"}: a
    number, the word of a choice, or those of a list between commas; the sigmas of twists, imu-turn
    and imu-arm also take three numbers. All of them: include/pelorus/settings.h. `known` is a map
    for known-map and localization. Landmarks that leave the filter are collected in `evicted`, by
    id.
    """

    def __init__(
        self,
        calibration: Calibration,
        config: Named | None = None,
        *,
        precision: Precision = "float32",
        known: Mapping[int, KnownLandmark] | None = None,
    ) -> None:
        self._c = binding.library(precision)
        self.precision: Precision = precision
        self.known = dict(known or {})
        self.evicted: dict[int, KnownLandmark] = {}
        sizes = self._c.sizes
        self._memory = c.create_string_buffer(sizes.bytes + 63)
        self._f = (c.addressof(self._memory) + 63) // 64 * 64
        self._config = Configured(self._c)
        for name, value in (config or {}).items():
            self._config.set(name, value)
        self._config.check()
        self._callbacks = binding.Map(None, binding.Sink(self._take), binding.Source(self._find))
        given = binding.Calibration(
            *(
                real(f"calibration: {field[0]}", getattr(calibration, field[0]))
                for field in binding.Calibration._fields_[:5]
            ),
            _pose("calibration", calibration.R_CB, calibration.t_CB_m),
        )
        pointers = (c.byref(part) for part in (given, self._config.memory, self._callbacks, sizes))
        self._checked("init", self._c.filter_init_sized(self._f, *pointers))
        # Made once: a frame creates no object but its report.
        self._twist, self._frame, self._report = binding.Twist(), binding.Frame(), binding.Report()
        self._twist_at, self._frame_at = c.addressof(self._twist), c.addressof(self._frame)
        self._linear = np.ctypeslib.as_array(self._twist.linear)
        self._angular = np.ctypeslib.as_array(self._twist.angular)
        self._report_at = c.addressof(self._report)
        self._predict, self._inertial = self._c.filter_predict, self._c.filter_inertial
        self._update = self._c.filter_update

    @classmethod
    def of_recording(
        cls,
        messages: Iterable[Message],
        config: Named | None = None,
        *,
        precision: Precision = "float32",
    ) -> Self:
        """Returns the filter that `pelorus-replay` makes for these messages of a recording.

        It has the recording's calibration and known landmarks; `config` overrides its CONFIG, which
        overrides the noises of its HEADER. The caller sets the initial pose, from its START or
        TRUTH.
        """
        header, settings, known = of_recording(messages, config or {}, precision)
        given = {
            id: KnownLandmark(m.p_W_m, unpack_symmetric(m.covariance[None], 3)[0])
            for id, m in known.items()
        }
        camera = Calibration.of_header(header)
        return cls(camera, settings, precision=precision, known=given)

    def __repr__(self) -> str:
        slots, mode = int(self.setting("slots")), schema.word_of("mode", self.setting("mode"))
        health = schema.HEALTHS[self.health().health]
        return (
            f"<pelorus.Filter {self.precision}, {mode}, {len(self.landmarks())} landmarks in "
            f"{slots} slots, at {self.time_ns} ns, {health}>"
        )

    def setting(self, name: str) -> float:
        """Returns the value in force; of a choice its number."""
        return self._config.get(name)

    # --- the map, called by the library

    def _take(self, _context: object, landmark: Any) -> int:
        found = landmark[0]
        covariance = np.array(found.P_W_m2).reshape(3, 3)
        self.evicted[found.id] = KnownLandmark(np.array(found.p_W_m), covariance)
        return 0

    def _find(self, _context: object, id: int, landmark: Any) -> bool:
        known = self.known.get(id)
        if known is not None:
            landmark[0] = _landmark(id, known)
        return known is not None

    # --- calls

    def _checked(self, call: str, status: int, hint: Mapping[int, str] = NO_HINT) -> None:
        if status != 0:
            raise FilterError(call, status, self._c.text(status) + hint.get(status, ""))

    def _other_process(self, call: str) -> str:
        """Returns a hint if a reading belongs to the other process than `call` does."""
        process = schema.word_of("process", self.setting("process"))
        return f'; this filter was made with {{"process": "{process}"}}: give readings to {call}'

    def reset(self) -> None:
        """Resets to the initial state, with all counts zero."""
        self._checked("reset", self._c.filter_reset(self._f))

    def set_pose(
        self, t_ns: int, R_WB: ArrayLike, p_WB_m: ArrayLike, covariance: ArrayLike | None = None
    ) -> None:
        """Sets pose and time, at the start or later; landmarks are dropped.

        `covariance` (6, 6) is of (rho, theta), m and rad in the body's axes; None: start-sigma.
        """
        P = None if covariance is None else checked("covariance", covariance, (6, 6))
        pose = _pose("pose", R_WB, p_WB_m)
        time = whole_number("t_ns", t_ns, MOST_NS)
        self._checked("set_pose", self._c.filter_set_pose(self._f, time, c.byref(pose), address(P)))

    def set_bias(self, mean: ArrayLike, variance: ArrayLike) -> None:
        """Sets the biases' prior, each (6,): of twists (v, w), m/s and rad/s; of an IMU (a, w)."""
        b, V = checked("mean", mean, (6,)), checked("variance", variance, (6,))
        self._checked("set_bias", self._c.filter_set_bias(self._f, address(b), address(V)))

    def set_velocity(self, v_B_mps: ArrayLike, variance: ArrayLike) -> None:
        """Sets the velocity in the body's axes and its variances, each (3,); with an IMU only."""
        v, V = checked("v_B_mps", v_B_mps, (3,)), checked("variance", variance, (3,))
        status = self._c.filter_set_velocity(self._f, address(v), address(V))
        self._checked("set_velocity", status)

    def move_to(self, t_ns: int, R_WB: ArrayLike, p_WB_m: ArrayLike) -> None:
        """Sets the body's pose at t_ns, which is taken as exact; in the mode mapping only."""
        pose = _pose("pose", R_WB, p_WB_m)
        time = whole_number("t_ns", t_ns, MOST_NS)
        self._checked("move_to", self._c.filter_move_to(self._f, time, c.byref(pose)))

    def predict(self, t_ns: int, v_B_mps: ArrayLike, w_B_radps: ArrayLike) -> None:
        """Takes a twist at t_ns: velocity (3,), m/s, and rate (3,), rad/s, in the body's axes."""
        self._linear[:] = checked("v_B_mps", v_B_mps, (3,))
        self._angular[:] = checked("w_B_radps", w_B_radps, (3,))
        status = self._predict(self._f, whole_number("t_ns", t_ns, MOST_NS), self._twist_at)
        if status != 0:
            self._checked("predict", status, hint={OTHER_MODE: self._other_process("inertial")})

    def inertial(self, t_ns: int, a_B_mps2: ArrayLike, w_B_radps: ArrayLike) -> None:
        """Takes an IMU's reading: specific force (3,), m/s^2, at rest upwards; rate (3,), rad/s."""
        self._linear[:] = checked("a_B_mps2", a_B_mps2, (3,))
        self._angular[:] = checked("w_B_radps", w_B_radps, (3,))
        status = self._inertial(self._f, whole_number("t_ns", t_ns, MOST_NS), self._twist_at)
        if status != 0:
            self._checked("inertial", status, hint={OTHER_MODE: self._other_process("predict")})

    def update(self, t_ns: int, observations: NDArray[np.void], budget: int = NO_BUDGET) -> Report:
        """Takes a stereo frame: (n,) of OBSERVATION (`observations`), read without a copy.

        At most `budget` of them are used.
        """
        if not isinstance(observations, np.ndarray) or observations.dtype != OBSERVATION:
            raise PelorusError("observations: an array as pelorus.observations makes it is wanted")
        seen = np.ascontiguousarray(observations)
        if seen.ndim != 1 or len(seen) > self.most_observations:
            raise PelorusError(
                f"observations: shape {seen.shape}; (n,) with n up to {self.most_observations}"
            )
        frame = self._frame
        frame.t_ns, frame.budget = (
            whole_number("t_ns", t_ns, MOST_NS),
            whole_number("budget", budget, NO_BUDGET),
        )
        frame.count, frame.observations = len(seen), seen.ctypes.data
        status = self._update(self._f, self._frame_at, self._report_at)
        if status != 0:
            self._checked("update", status)
        return Report.from_buffer_copy(self._report)

    def measure(
        self,
        t_ns: int,
        sensor: str,
        value: ArrayLike,
        sigma: ArrayLike,
        at_B_m: ArrayLike = (0, 0, 0),
    ) -> ReadingResult:
        """Takes a reading of a small sensor, each (3,).

        The sensors are `wheel` (velocity of a point of the body, m/s), `standstill` (value zeros;
        sigma[0] m/s, sigma[1] rad/s) and `position` (in the world, m). An axis whose sigma is 0 was
        not measured. at_B_m is the place on the body.
        """
        kinds = schema.SENSORS
        if sensor not in kinds:
            raise PelorusError(f"sensor {sensor!r}: one of {', '.join(kinds)}")
        sigmas = checked("sigma", sigma, (3,))
        reading = binding.Reading(whole_number("t_ns", t_ns, MOST_NS), kinds[sensor])
        still = sensor == "standstill"
        reading.axes = sum(1 << i for i in range(2 if still else 3) if sigmas[i] != 0)
        reading.value[:], reading.sigma[:] = checked("value", value, (3,)), sigmas
        reading.at_B_m[:] = checked("at_B_m", at_B_m, (3,))
        result = ReadingResult()
        self._checked("measure", self._c.filter_measure(self._f, c.byref(reading), c.byref(result)))
        return result

    # --- the estimate

    @property
    def time_ns(self) -> int:
        """Returns the time of the estimate, ns."""
        return int(self._c.filter_time(self._f))

    def _doubles(self, function: str, shape: tuple[int, ...]) -> Floats:
        """Returns what a function writes as an array of doubles."""
        result = np.empty(shape)
        self._checked(function, getattr(self._c, f"filter_{function}")(self._f, address(result)))
        return result

    def pose(self) -> Pose:
        """Returns the pose of the body in the world, T_WB: R (3, 3), p (3,), m."""
        numbers = self._doubles("pose", (12,))
        return Pose(numbers[:9].reshape(3, 3), numbers[9:])

    def pose_covariance(self) -> Floats:
        """Returns (6, 6) of (rho, theta), m, rad, body axes; truth is T_WB Exp(rho, theta)."""
        return self._doubles("pose_covariance", (6, 6))

    def velocity(self) -> Floats:
        """Returns (6,): velocity, m/s, and rate, rad/s, of the body in its own axes."""
        return self._doubles("velocity", (6,))

    def velocity_covariance(self) -> Floats:
        """Returns the covariance (6, 6), in the same order."""
        return self._doubles("velocity_covariance", (6, 6))

    def trace(self) -> float:
        """Returns the trace of the whole covariance; only its trend means anything."""
        return float(self._c.filter_trace(self._f))

    def bias(self) -> tuple[Floats, Floats]:
        """Returns (6,) and its covariance (6, 6): (b_v, b_w) of twists, (b_a, b_g) of an IMU."""
        b, P = np.empty(6), np.empty((6, 6))
        self._checked("bias", self._c.filter_bias(self._f, address(b), address(P)))
        return b, P

    def landmarks(self) -> NDArray[np.void]:
        """Returns all landmarks in the state, (n,) of LANDMARK: id, p_W_m (3,), P_W_m2 ..."""
        count = int(self._c.filter_landmark_count(self._f))
        found = np.zeros(count, LANDMARK)
        for slot in range(count):
            address = found.ctypes.data + slot * LANDMARK.itemsize
            self._checked("landmark", self._c.filter_landmark(self._f, slot, address))
        return found

    def insert_known(self, id: int, p_W_m: ArrayLike, P_W_m2: ArrayLike) -> None:
        """Puts a landmark of known position (3,), m, and covariance (3, 3), m^2, into the state."""
        landmark = _landmark(whole_number("id", id, MOST_ID), KnownLandmark(p_W_m, P_W_m2))
        self._checked("insert_known", self._c.filter_insert_known(self._f, c.byref(landmark)))

    def flush_map(self) -> None:
        """Moves every landmark to `evicted`."""
        self._checked("flush_map", self._c.filter_flush_map(self._f))

    # --- what happened

    def health(self, t_ns: int | None = None) -> Health:
        """Returns the filter's health at t_ns; None: at the time of the estimate."""
        time = self.time_ns if t_ns is None else whole_number("t_ns", t_ns, MOST_NS)
        health = Health()
        self._checked("health", self._c.filter_health(self._f, time, c.byref(health)))
        return health

    def supervision(self) -> Supervision:
        """Returns what the supervisor saw in the last frame, and decided."""
        seen = Supervision()
        self._checked("supervision", self._c.filter_supervision(self._f, c.byref(seen)))
        return seen

    def totals(self) -> dict[str, int]:
        """Returns counts since the beginning, by name."""
        counts = binding.Totals()
        self._checked("totals", self._c.filter_totals(self._f, c.byref(counts)))
        return {
            name: int(getattr(counts, name)) for name in (*binding.COUNTS_32, *binding.COUNTS_64)
        }

    # --- saved state

    def save(self) -> bytes:
        """Returns the whole state; a filter that restores it continues with the same bits."""
        saved = bytearray()

        def take(_context: object, data: int, n: int) -> int:
            saved.extend(c.string_at(data, n))
            return 0

        self._checked("save", self._c.filter_save(self._f, binding.StateSink(take), None))
        return bytes(saved)

    def restore(self, saved: bytes) -> None:
        """Continues from a saved state of the same calibration, settings and build."""
        if not isinstance(saved, bytes | bytearray):
            raise PelorusError(
                f"saved: {type(saved).__name__}; the bytes that save gave are expected"
            )

        def give(_context: object, offset: int, data: int, n: int) -> int:
            c.memmove(data, saved[offset : offset + n], n)
            return 0

        source = binding.StateSource(give)
        self._checked("restore", self._c.filter_restore(self._f, len(saved), source, None))

    def resume(self, t_ns: int, moved: ArrayLike | None = None) -> None:
        """Continues at t_ns, of any clock, after a pause.

        `moved` (6, 6) is the covariance of how far the body may have moved meanwhile, as of a pose;
        None: not at all.
        """
        P = None if moved is None else checked("moved", moved, (6, 6))
        time = whole_number("t_ns", t_ns, MOST_NS)
        self._checked("resume", self._c.filter_resume(self._f, time, address(P)))

    @property
    def last_report(self) -> Report:
        """Returns the last frame's report, even if it was refused."""
        return Report.from_buffer_copy(self._report)

    @property
    def most_landmarks(self) -> int:
        """Returns the library's capacity of landmarks; the setting `slots` may use fewer."""
        return int(self._c.sizes.landmarks)

    @property
    def most_observations(self) -> int:
        """Returns the largest number of observations in one frame."""
        return int(self._c.sizes.observations)


def _landmark(id: int, known: KnownLandmark) -> binding.Landmark:
    landmark = binding.Landmark(id=id, known=True)
    landmark.p_W_m[:] = checked(f"landmark {id}: p_W_m", known.p_W_m, (3,))
    landmark.P_W_m2[:] = checked(f"landmark {id}: P_W_m2", known.P_W_m2, (3, 3)).ravel()
    return landmark
