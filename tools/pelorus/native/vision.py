# SPDX-License-Identifier: MIT
"""The structs and functions of include/pelorus/vision.h, for `pelorus.Tracker`."""

from __future__ import annotations

import ctypes as c
from functools import cache
from typing import Any, NamedTuple

from pelorus.errors import PelorusError
from pelorus.native import binding
from pelorus.native.binding import Frame, Pose, Precision
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
    Doubles8,
    Struct,
    of_header,
)


@of_header("plr_lens")
class Lens(Struct):
    """A pinhole with its lens."""

    model: U8
    width_px: U16
    height_px: U16
    fx_px: F64
    fy_px: F64
    cx_px: F64
    cy_px: F64
    k: Doubles8


@of_header("plr_rig")
class Rig(Struct):
    """Two cameras, and how they are read."""

    left: Lens
    right: Lens
    T_RL: Pose
    row_time_s: F64
    disparity_max_px: U16
    tracks: U16
    fx_px: F64
    fy_px: F64
    cx_px: F64
    cy_px: F64


@of_header("plr_picture")
class Picture(Struct):
    """An 8-bit grey picture in the caller's memory."""

    pixels: Address
    stride: U32
    width_px: U16
    height_px: U16
    t_ns: U64


@of_header("plr_picture_pair")
class Pair(Struct):
    """Left and right picture."""

    left: Picture
    right: Picture


@of_header("plr_depth")
class Depth(Struct):
    """The known depth of a point."""

    id: U32
    z_m: F32


@of_header("plr_expected")
class Expected(Struct):
    """The expected motion of the camera."""

    motion: Pose
    depths: Address
    depth_count: U16
    velocity_known: Bool
    v_C_mps: Doubles3
    w_C_radps: Doubles3


@of_header("plr_sight")
class Sight(Struct):
    """Data about an observation."""

    id: U32
    age: U16
    sigma_px: F32
    likeness: F32


@of_header("plr_ended_track")
class EndedTrack(Struct):
    """A track that ended, with the reason."""

    id: U32
    age: U16
    why: U8


@of_header("plr_vision_report")
class VisionReport(Struct):
    """The result of one pair: plr_vision_report of include/pelorus/vision.h."""

    t_ns: U64
    left: U8
    right: U8
    swapped: Bool
    followed: U16
    observed: U16
    born: U16
    corners: U16
    cut_anew: U16
    ended: U16
    steps: U16
    halves_apart_s: F32
    halves_sigma_s: F32


STRUCTS: tuple[type[Struct], ...] = (
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


@cache
def library(precision: Precision = "float32") -> binding.Library:
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
    return found


class Limits(NamedTuple):
    """Most pixels of a picture, and most points that are followed."""

    pixels: int
    tracks: int


def limits(precision: Precision = "float32") -> Limits:
    """Returns those with which the library was built."""
    tracks = c.c_uint32()
    return Limits(library(precision).binding_vision_limits(c.byref(tracks)), tracks.value)
