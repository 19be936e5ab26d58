# SPDX-License-Identifier: MIT
"""The library in C: its place, its functions, and its structs as in include/pelorus.

Users take `pelorus.Filter`, which is built on this.
"""

from __future__ import annotations

import ctypes as c
import os
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pelorus import __version__
from pelorus.errors import PelorusError
from pelorus.native.structure import Struct, with_reasons
from pelorus.program import distribution
from pelorus.wire.reason import Reason

Precision = Literal["float32", "float64"]

PACKAGED = Path(__file__).resolve().parent  # of a wheel
BUILT = Path("build/bin")  # of a checkout
SOURCE_ROOT = Path(__file__).resolve().parents[3]
NAMES: dict[Precision, str] = {"float32": "pelorus-filter", "float64": "pelorus-filter-f64"}
SUFFIXES = {"win32": ".dll", "darwin": ".dylib"}
EXE = ".exe" if sys.platform == "win32" else ""  # how a program's name ends
REJECTED = 24  # PLR_SUPERVISION_REJECTED


def folders(chosen: Path | None) -> list[Path]:
    """Returns the folders of programs and libraries: the one given, else $PELORUS_BIN, else the
    package, and build/bin here or in the package's checkout.
    """
    named = chosen or (Path(value) if (value := os.environ.get("PELORUS_BIN")) else None)
    return [named] if named else [PACKAGED, BUILT, SOURCE_ROOT / BUILT]


def _doubles(n: int) -> type[c.Array[c.c_double]]:
    return c.c_double * n


def _floats(n: int) -> type[c.Array[c.c_float]]:
    return c.c_float * n


class Pose(Struct):
    """A rigid motion x -> R x + p."""

    c_name = "plr_pose"
    _fields_ = (("R", _doubles(9)), ("p", _doubles(3)))


class Twist(Struct):
    """A velocity in the body's axes; for an IMU specific force and rate."""

    c_name = "plr_twist"
    _fields_ = (("linear", _doubles(3)), ("angular", _doubles(3)))


class Calibration(Struct):
    """A rectified stereo camera."""

    c_name = "plr_calibration"
    _fields_ = (
        ("fx_px", c.c_double),
        ("fy_px", c.c_double),
        ("cx_px", c.c_double),
        ("cy_px", c.c_double),
        ("baseline_m", c.c_double),
        ("T_CB", Pose),
    )


class Frame(Struct):
    """The observations of one stereo pair."""

    c_name = "plr_frame"
    t_ns: int
    budget: int
    count: int
    observations: int | None
    _fields_ = (
        ("t_ns", c.c_uint64),
        ("budget", c.c_uint16),
        ("count", c.c_uint16),
        ("observations", c.c_void_p),
    )


class Landmark(Struct):
    """A landmark in the world."""

    c_name = "plr_landmark"
    id: int
    times_seen: int
    times_gated: int
    last_seen_ns: int
    known: bool
    p_W_m: c.Array[c.c_double]
    P_W_m2: c.Array[c.c_double]
    _fields_ = (
        ("id", c.c_uint32),
        ("times_seen", c.c_uint32),
        ("times_gated", c.c_uint32),
        ("last_seen_ns", c.c_uint64),
        ("known", c.c_bool),
        ("p_W_m", _doubles(3)),
        ("P_W_m2", _doubles(9)),
    )


class Reading(Struct):
    """A reading of a small sensor."""

    c_name = "plr_reading"
    _fields_ = (
        ("t_ns", c.c_uint64),
        ("sensor", c.c_uint8),
        ("axes", c.c_uint8),
        ("value", _doubles(3)),
        ("sigma", _doubles(3)),
        ("at_B_m", _doubles(3)),
    )


class ReadingResult(Struct):
    """The result of a reading: `used`, and `d2`, its squared distance from the prediction."""

    c_name = "plr_reading_result"
    status: int
    used: bool
    d2: float
    _fields_ = (("status", c.c_int), ("used", c.c_bool), ("d2", c.c_double))


@with_reasons
class Report(Struct):
    """The result of one stereo frame: plr_report of include/pelorus/types.h.

    Its reasons are flags: `Reason.FROZEN_IMAGE in report.reasons`.
    """

    c_name = "plr_report"
    t_ns: int
    status: int
    health: int
    reasons: Reason
    budget: int
    observations: int
    matched: int
    used: int
    gated: int
    created: int
    evicted: int
    refused: int
    duplicates: int
    no_room: int
    poor: int
    left_out: int
    blocks_failed: int
    active: int
    nis_dof: int
    nis: float
    innovation_rows: int
    innovation_d2: float
    innovation_log_det: float
    _fields_ = (
        ("t_ns", c.c_uint64),
        ("status", c.c_int),
        ("health", c.c_int),
        ("reasons", c.c_uint32),
        ("budget", c.c_uint16),
        ("observations", c.c_uint16),
        ("matched", c.c_uint16),
        ("used", c.c_uint16),
        ("gated", c.c_uint16),
        ("created", c.c_uint16),
        ("evicted", c.c_uint16),
        ("refused", c.c_uint16),
        ("duplicates", c.c_uint16),
        ("no_room", c.c_uint16),
        ("poor", c.c_uint16),
        ("left_out", c.c_uint16),
        ("blocks_failed", c.c_uint16),
        ("active", c.c_uint16),
        ("nis_dof", c.c_uint16),
        ("nis", c.c_float),
        ("innovation_rows", c.c_uint16),
        ("innovation_d2", c.c_float),
        ("innovation_log_det", c.c_float),
    )


class RejectedLandmark(Struct):
    """A landmark that was seen and not used."""

    c_name = "plr_rejected_landmark"
    id: int
    why: int
    in_succession: int
    mean2: float
    _fields_ = (
        ("id", c.c_uint32),
        ("why", c.c_uint8),
        ("in_succession", c.c_uint16),
        ("mean2", c.c_float),
    )


class Supervision(Struct):
    """What the supervisor saw in one frame and decided: plr_supervision of include/pelorus/types.h.

    Differences are (rho, theta): m and rad in the body's axes.
    """

    c_name = "plr_supervision"
    t_ns: int
    nu: c.Array[c.c_float]
    moved: c.Array[c.c_float]
    statistic: float
    usual: c.Array[c.c_float]
    agreement: float
    weight: float
    difference: c.Array[c.c_float]
    doubt: int
    applied: bool
    outright: bool
    waits: bool
    holds_biases: bool
    locked: bool
    frozen: bool
    misfits: bool
    settled: bool
    matched: int
    same: int
    known: int
    adopted: int
    count: int
    rejected: c.Array[RejectedLandmark]
    _fields_ = (
        ("t_ns", c.c_uint64),
        ("nu", _floats(6)),
        ("moved", _floats(6)),
        ("statistic", c.c_float),
        ("usual", _floats(6)),
        ("agreement", c.c_float),
        ("weight", c.c_float),
        ("difference", _floats(6)),
        ("doubt", c.c_uint8),
        ("applied", c.c_bool),
        ("outright", c.c_bool),
        ("waits", c.c_bool),
        ("holds_biases", c.c_bool),
        ("locked", c.c_bool),
        ("frozen", c.c_bool),
        ("misfits", c.c_bool),
        ("settled", c.c_bool),
        ("matched", c.c_uint16),
        ("same", c.c_uint16),
        ("known", c.c_uint16),
        ("adopted", c.c_uint16),
        ("count", c.c_uint8),
        ("rejected", RejectedLandmark * REJECTED),
    )


@with_reasons
class Health(Struct):
    """How far the estimate may be trusted; seconds since what never happened are infinite."""

    c_name = "plr_health_state"
    health: int
    reasons: Reason
    seconds_without_frame: float
    seconds_without_use: float
    seconds_without_twist: float
    resets: int
    _fields_ = (
        ("health", c.c_int),
        ("reasons", c.c_uint32),
        ("seconds_without_frame", c.c_double),
        ("seconds_without_use", c.c_double),
        ("seconds_without_twist", c.c_double),
        ("resets", c.c_uint32),
    )


COUNTS_32 = (
    *("twists", "frames", "late", "refused", "resets", "locks", "range_limited", "blocks_failed"),
    *("widened", "recoveries", "contradictions", "twists_refused", "frames_refused"),
    *("damaged", "readings", "readings_gated", "readings_refused"),
)
COUNTS_64 = ("observations", "matched", "used", "gated", "created", "evicted", "diverged_ns")


class Totals(Struct):
    """Counts since the filter was made: plr_totals of include/pelorus/state.h."""

    c_name = "plr_totals"
    _fields_ = (
        *((name, c.c_uint32) for name in COUNTS_32),
        *((name, c.c_uint64) for name in COUNTS_64),
    )


class Setting(Struct):
    """A row of the table of settings."""

    c_name = "plr_setting"
    id: int
    name: bytes
    unit: bytes
    minimum: float
    maximum: float
    _fields_ = (
        ("id", c.c_uint8),
        ("name", c.c_char_p),
        ("unit", c.c_char_p),
        ("kind", c.c_int),
        ("choices", c.c_void_p),
        ("minimum", c.c_double),
        ("maximum", c.c_double),
        ("standard", c.c_double),
    )


class Sizes(Struct):
    """The options that determine the memory layout of a filter."""

    c_name = "plr_sizes"
    bytes: int
    real: int
    landmarks: int
    observations: int
    block: int
    calibration: int
    _fields_ = (
        ("bytes", c.c_uint32),
        ("real", c.c_uint32),
        ("landmarks", c.c_uint32),
        ("observations", c.c_uint32),
        ("block", c.c_uint32),
        ("calibration", c.c_uint32),
    )


Sink = c.CFUNCTYPE(c.c_int, c.c_void_p, c.POINTER(Landmark))
Source = c.CFUNCTYPE(c.c_bool, c.c_void_p, c.c_uint32, c.POINTER(Landmark))
StateSink = c.CFUNCTYPE(c.c_int, c.c_void_p, c.c_void_p, c.c_uint32)
StateSource = c.CFUNCTYPE(c.c_int, c.c_void_p, c.c_uint32, c.c_void_p, c.c_uint32)


class Map(Struct):
    """The caller's store of landmarks."""

    c_name = "plr_map"
    _fields_ = (("context", c.c_void_p), ("sink", Sink), ("source", Source))


STRUCTS: tuple[type[Struct], ...] = (
    *(Pose, Twist, Calibration, Frame, Landmark, Reading, ReadingResult, Report, Supervision),
    *(Health, Totals, Setting, Sizes, Map),
)

_VOID = c.c_void_p
SIGNATURES: dict[str, tuple[object, ...]] = {
    "init_sized": (_VOID, _VOID, _VOID, _VOID, _VOID),
    "reset": (_VOID,),
    "set_pose": (_VOID, c.c_uint64, _VOID, _VOID),
    "set_bias": (_VOID, _VOID, _VOID),
    "set_velocity": (_VOID, _VOID, _VOID),
    "move_to": (_VOID, c.c_uint64, _VOID),
    "predict": (_VOID, c.c_uint64, _VOID),
    "inertial": (_VOID, c.c_uint64, _VOID),
    "update": (_VOID, _VOID, _VOID),
    "measure": (_VOID, _VOID, _VOID),
    "pose": (_VOID, _VOID),
    "pose_covariance": (_VOID, _VOID),
    "velocity": (_VOID, _VOID),
    "velocity_covariance": (_VOID, _VOID),
    "bias": (_VOID, _VOID, _VOID),
    "landmark": (_VOID, c.c_uint, _VOID),
    "insert_known": (_VOID, _VOID),
    "flush_map": (_VOID,),
    "save": (_VOID, StateSink, _VOID),
    "restore": (_VOID, c.c_uint32, StateSource, _VOID),
    "resume": (_VOID, c.c_uint64, _VOID),
    "health": (_VOID, c.c_uint64, _VOID),
    "supervision": (_VOID, _VOID),
    "totals": (_VOID, _VOID),
}
# The other functions: name, result, arguments.
OTHER_SIGNATURES: tuple[tuple[str, Any, tuple[Any, ...]], ...] = (
    ("plr_filter_time", c.c_uint64, (_VOID,)),
    ("plr_filter_trace", c.c_double, (_VOID,)),
    ("plr_filter_landmark_count", c.c_uint, (_VOID,)),
    ("plr_setting_by_name", c.POINTER(Setting), (c.c_char_p,)),
    ("plr_config_default", None, (_VOID,)),
    ("plr_config_set", c.c_int, (_VOID, _VOID, c.c_double)),
    ("plr_config_get", c.c_double, (_VOID, _VOID)),
    ("plr_config_why", c.c_char_p, (_VOID, c.POINTER(c.POINTER(Setting)))),
    ("plr_version", c.c_char_p, ()),
    ("plr_status_text", c.c_char_p, (c.c_int,)),
    ("plr_build_fingerprint", c.c_uint32, ()),
    ("plr_binding_size_of", c.c_uint32, (c.c_char_p,)),
    ("plr_setting_by_id", c.POINTER(Setting), (c.c_uint8,)),
    ("plr_binding_settings", c.c_int, (_VOID, c.c_char_p, c.c_size_t, _VOID)),
    ("plr_binding_processor_lacks", c.c_char_p, ()),
    ("plr_binding_sizes", None, (_VOID,)),
)


class Library:
    """The library in one precision: its attribute `filter_update` is plr_filter_update."""

    def __init__(self, path: Path) -> None:
        try:
            self._library = c.CDLL(str(path))
        except OSError as error:
            raise PelorusError(f"{path}: cannot be loaded: {error}") from error
        self._declare(path)
        if lacks := self._library.plr_binding_processor_lacks():
            raise PelorusError(
                f"{path}: this processor lacks {lacks.decode()}, which the library was built for; "
                f"pip install --no-binary {distribution.NAME} -C cmake.define.PLR_PORTABLE=ON "
                f"{distribution.NAME} builds one for any processor: slower, the same bits"
            )
        self._check(path)
        self.sizes = Sizes()
        self._library.plr_binding_sizes(c.byref(self.sizes))

    def _declare(self, path: Path) -> None:
        """Declares the functions' types to ctypes."""
        try:
            for name, arguments in SIGNATURES.items():
                function = getattr(self._library, f"plr_filter_{name}")
                function.argtypes, function.restype = arguments, c.c_int
            for name, result, arguments in OTHER_SIGNATURES:
                function = getattr(self._library, name)
                function.argtypes, function.restype = arguments, result
        except AttributeError as error:
            raise PelorusError(
                f"{path}: is no library of Pelorus {__version__}: {error}"
            ) from error

    def _check(self, path: Path) -> None:
        """Checks that the structs above are those of the library."""
        version = self._library.plr_version().decode()
        differ = [
            struct.c_name for struct in STRUCTS if self.size_of(struct.c_name) != c.sizeof(struct)
        ]
        if version != __version__ or differ:
            what = f", with another {', '.join(differ)}" if differ else ""
            raise PelorusError(
                f"{path}: is of Pelorus {version}{what}, and these tools are {__version__}: "
                f"build it anew, or install both together. {distribution.mixed_up()}".rstrip()
            )

    def size_of(self, name: str) -> int:
        """Returns the bytes of a struct."""
        return int(self._library.plr_binding_size_of(name.encode()))

    def __getattr__(self, name: str) -> c._CFuncPtr:  # type: ignore[name-defined]
        return getattr(self._library, f"plr_{name}")

    def text(self, status: int) -> str:
        """Returns a sentence about a status: what is wrong and how to correct it."""
        return str(self._library.plr_status_text(status).decode())


def _candidates(precision: Precision) -> Iterator[Path]:
    suffix = SUFFIXES.get(sys.platform, ".so")
    yield from (folder / f"{NAMES[precision]}{suffix}" for folder in folders(None))


@cache
def library(precision: Precision = "float32") -> Library:
    """Returns the library in this precision, loaded once; PelorusError where there is none."""
    if precision not in NAMES:
        raise PelorusError(f"precision {precision!r}: one of {', '.join(NAMES)}")
    for path in _candidates(precision):
        if path.is_file():
            return Library(path.resolve())
    where = ", ".join(str(path.parent) for path in _candidates(precision))
    raise PelorusError(
        f"the library {next(_candidates(precision)).name} is in none of {where}: this package was "
        "installed without it, or for another system; pip install --force-reinstall "
        f"{distribution.NAME}, or build it and name its folder in PELORUS_BIN"
    )
