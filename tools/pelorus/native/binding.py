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
from typing import Annotated, Any, Literal

from pelorus import __version__
from pelorus.errors import PelorusError
from pelorus.native.structure import (
    F32,
    F64,
    U8,
    U16,
    U32,
    U64,
    Address,
    Bool,
    Doubles3,
    Doubles9,
    Floats6,
    Int,
    Reasons,
    Struct,
    Text,
    of_header,
)
from pelorus.program import distribution

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


@of_header("plr_pose")
class Pose(Struct):
    """A rigid motion x -> R x + p."""

    R: Doubles9
    p: Doubles3


@of_header("plr_twist")
class Twist(Struct):
    """A velocity in the body's axes; for an IMU specific force and rate."""

    linear: Doubles3
    angular: Doubles3


@of_header("plr_calibration")
class Calibration(Struct):
    """A rectified stereo camera."""

    fx_px: F64
    fy_px: F64
    cx_px: F64
    cy_px: F64
    baseline_m: F64
    T_CB: Pose


@of_header("plr_frame")
class Frame(Struct):
    """The observations of one stereo pair."""

    t_ns: U64
    budget: U16
    count: U16
    observations: Address


@of_header("plr_landmark")
class Landmark(Struct):
    """A landmark in the world."""

    id: U32
    times_seen: U32
    times_gated: U32
    last_seen_ns: U64
    known: Bool
    p_W_m: Doubles3
    P_W_m2: Doubles9


@of_header("plr_reading")
class Reading(Struct):
    """A reading of a small sensor."""

    t_ns: U64
    sensor: U8
    axes: U8
    value: Doubles3
    sigma: Doubles3
    at_B_m: Doubles3


@of_header("plr_reading_result")
class ReadingResult(Struct):
    """The result of a reading: `used`, and `d2`, its squared distance from the prediction."""

    status: Int
    used: Bool
    d2: F64


@of_header("plr_report")
class Report(Struct):
    """The result of one stereo frame: plr_report of include/pelorus/types.h.

    Its reasons are flags: `Reason.FROZEN_IMAGE in report.reasons`.
    """

    t_ns: U64
    status: Int
    health: Int
    reasons: Reasons
    budget: U16
    observations: U16
    matched: U16
    used: U16
    gated: U16
    created: U16
    evicted: U16
    refused: U16
    duplicates: U16
    no_room: U16
    poor: U16
    left_out: U16
    blocks_failed: U16
    active: U16
    nis_dof: U16
    nis: F32
    innovation_rows: U16
    innovation_d2: F32
    innovation_log_det: F32


@of_header("plr_rejected_landmark")
class RejectedLandmark(Struct):
    """A landmark that was seen and not used."""

    id: U32
    why: U8
    in_succession: U16
    mean2: F32


@of_header("plr_supervision")
class Supervision(Struct):
    """What the supervisor saw in one frame and decided: plr_supervision of include/pelorus/types.h.

    Differences are (rho, theta): m and rad in the body's axes.
    """

    t_ns: U64
    nu: Floats6
    moved: Floats6
    statistic: F32
    usual: Floats6
    agreement: F32
    weight: F32
    difference: Floats6
    doubt: U8
    applied: Bool
    outright: Bool
    waits: Bool
    holds_biases: Bool
    locked: Bool
    frozen: Bool
    misfits: Bool
    settled: Bool
    matched: U16
    same: U16
    known: U16
    adopted: U16
    count: U8
    rejected: Annotated[c.Array[RejectedLandmark], RejectedLandmark * REJECTED]


@of_header("plr_health_state")
class Health(Struct):
    """How far the estimate may be trusted; seconds since what never happened are infinite."""

    health: Int
    reasons: Reasons
    seconds_without_frame: F64
    seconds_without_use: F64
    seconds_without_twist: F64
    resets: U32


COUNTS_32 = (
    *("twists", "frames", "late", "refused", "resets", "locks", "range_limited", "blocks_failed"),
    *("widened", "recoveries", "contradictions", "twists_refused", "frames_refused"),
    *("damaged", "readings", "readings_gated", "readings_refused"),
)
COUNTS_64 = ("observations", "matched", "used", "gated", "created", "evicted", "diverged_ns")


@of_header("plr_totals")
class Totals(Struct):
    """Counts since the filter was made: plr_totals of include/pelorus/state.h."""

    _fields_ = (
        *((name, c.c_uint32) for name in COUNTS_32),
        *((name, c.c_uint64) for name in COUNTS_64),
    )


@of_header("plr_setting")
class Setting(Struct):
    """A row of the table of settings."""

    id: U8
    name: Text
    unit: Text
    kind: Int
    choices: Address
    minimum: F64
    maximum: F64
    standard: F64


@of_header("plr_sizes")
class Sizes(Struct):
    """The options that determine the memory layout of a filter."""

    bytes: U32
    real: U32
    landmarks: U32
    observations: U32
    block: U32
    calibration: U32


Sink = c.CFUNCTYPE(c.c_int, c.c_void_p, c.POINTER(Landmark))
Source = c.CFUNCTYPE(c.c_bool, c.c_void_p, c.c_uint32, c.POINTER(Landmark))
StateSink = c.CFUNCTYPE(c.c_int, c.c_void_p, c.c_void_p, c.c_uint32)
StateSource = c.CFUNCTYPE(c.c_int, c.c_void_p, c.c_uint32, c.c_void_p, c.c_uint32)


@of_header("plr_map")
class Map(Struct):
    """The caller's store of landmarks."""

    context: Address
    sink: Annotated[Any, Sink]
    source: Annotated[Any, Source]


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
