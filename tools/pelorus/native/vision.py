# SPDX-License-Identifier: MIT
"""The structs and functions of include/pelorus/vision.h, for `pelorus.Tracker`."""

from __future__ import annotations

import ctypes as c
from functools import cache
from typing import Any, ClassVar, Protocol, cast

from pelorus.errors import PelorusError
from pelorus.native import binding
from pelorus.native.binding import Frame, Pose, Precision


class _Struct(c.Structure):
    """One of include/pelorus/vision.h; its `_fields_` are the header's, in their order."""

    c_name: ClassVar[str]


class Lens(_Struct):
    """A pinhole with its lens."""

    c_name = "plr_lens"
    _fields_ = (
        ("model", c.c_uint8),
        ("width_px", c.c_uint16),
        ("height_px", c.c_uint16),
        ("fx_px", c.c_double),
        ("fy_px", c.c_double),
        ("cx_px", c.c_double),
        ("cy_px", c.c_double),
        ("k", c.c_double * 8),
    )


class Rig(_Struct):
    """Two cameras, and how they are read."""

    c_name = "plr_rig"
    _fields_ = (
        ("left", Lens),
        ("right", Lens),
        ("T_RL", Pose),
        ("row_time_s", c.c_double),
        ("disparity_max_px", c.c_uint16),
        ("tracks", c.c_uint16),
        ("fx_px", c.c_double),
        ("fy_px", c.c_double),
        ("cx_px", c.c_double),
        ("cy_px", c.c_double),
    )


class Picture(_Struct):
    """An 8-bit grey picture in the caller's memory."""

    c_name = "plr_picture"
    _fields_ = (
        ("pixels", c.c_void_p),
        ("stride", c.c_uint32),
        ("width_px", c.c_uint16),
        ("height_px", c.c_uint16),
        ("t_ns", c.c_uint64),
    )


class Pair(_Struct):
    """Left and right picture."""

    c_name = "plr_picture_pair"
    _fields_ = (("left", Picture), ("right", Picture))


class Depth(_Struct):
    """The known depth of a point."""

    c_name = "plr_depth"
    _fields_ = (("id", c.c_uint32), ("z_m", c.c_float))


class Expected(_Struct):
    """The expected motion of the camera."""

    c_name = "plr_expected"
    _fields_ = (("motion", Pose), ("depths", c.c_void_p), ("depth_count", c.c_uint16))


class Sight(_Struct):
    """Data about an observation."""

    c_name = "plr_sight"
    _fields_ = (
        ("id", c.c_uint32),
        ("age", c.c_uint16),
        ("sigma_px", c.c_float),
        ("likeness", c.c_float),
    )


class EndedTrack(_Struct):
    """A track that ended, with the reason."""

    c_name = "plr_ended_track"
    _fields_ = (("id", c.c_uint32), ("age", c.c_uint16), ("why", c.c_uint8))


class VisionReport(_Struct):
    """The result of one pair: plr_vision_report of include/pelorus/vision.h."""

    c_name = "plr_vision_report"
    t_ns: int
    left: int
    right: int
    swapped: bool
    followed: int
    observed: int
    born: int
    corners: int
    cut_anew: int
    ended: int
    steps: int
    halves_apart_s: float
    halves_sigma_s: float
    _fields_ = (
        ("t_ns", c.c_uint64),
        ("left", c.c_uint8),
        ("right", c.c_uint8),
        ("swapped", c.c_bool),
        ("followed", c.c_uint16),
        ("observed", c.c_uint16),
        ("born", c.c_uint16),
        ("corners", c.c_uint16),
        ("cut_anew", c.c_uint16),
        ("ended", c.c_uint16),
        ("steps", c.c_uint16),
        ("halves_apart_s", c.c_float),
        ("halves_sigma_s", c.c_float),
    )


STRUCTS: tuple[type[_Struct], ...] = (
    *(Lens, Rig, Picture, Pair, Depth, Expected, Sight, EndedTrack, VisionReport),
)
_VOID = c.c_void_p
SIGNATURES: tuple[tuple[str, Any, tuple[Any, ...]], ...] = (
    ("binding_vision_init", c.c_int, (_VOID, _VOID)),
    ("vision_calibration", c.c_int, (_VOID, _VOID, _VOID)),
    ("vision_forget", c.c_int, (_VOID,)),
    ("vision_track", c.c_int, (_VOID, _VOID, _VOID, c.POINTER(Frame))),
    ("binding_vision_report", c.POINTER(VisionReport), (_VOID, _VOID, _VOID)),
    ("binding_vision_limits", c.c_uint32, (_VOID,)),
)


class VisionLibrary(Protocol):
    """The functions of the table above, as attributes of the library."""

    def size_of(self, name: str) -> int: ...
    def text(self, status: int) -> str: ...
    def binding_vision_init(self, vision: Any, rig: Any) -> int: ...
    def vision_calibration(self, vision: Any, T_LB: Any, calibration: Any) -> int: ...
    def vision_forget(self, vision: Any) -> int: ...
    def vision_track(self, vision: Any, pair: Any, expected: Any, frame: Any) -> int: ...
    def binding_vision_report(self, vision: Any, sights: Any, ended: Any) -> Any: ...
    def binding_vision_limits(self, tracks: Any) -> int: ...


@cache
def library(precision: Precision = "float32") -> VisionLibrary:
    """Returns the library with these functions; raises PelorusError if it has none."""
    found = binding.library(precision)
    differ = [s.c_name for s in STRUCTS if found.size_of(s.c_name) != c.sizeof(s)]
    try:
        for name, result, arguments in SIGNATURES:
            function = getattr(found, name)
            function.argtypes, function.restype = arguments, result
    except AttributeError as error:
        raise PelorusError(f"the library was built without src/vision: {error}") from error
    if differ:
        raise PelorusError(
            f"the library has another {', '.join(differ)}: build it anew, or install both together"
        )
    return cast(VisionLibrary, found)
