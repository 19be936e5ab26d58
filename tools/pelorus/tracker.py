# SPDX-License-Identifier: MIT
"""Eyes, from Python: the same tracker that the robot runs, the same bits.

    from pelorus import Filter, Tracker

    tracker = Tracker.from_files(["camchain.yaml"], width_px=752, height_px=480)
    filter = Filter(tracker.calibration(R_LB, t_LB_m))
    seen = tracker.track(t_ns, left, right)  # at every stereo pair: uint8 (rows, columns)
    filter.update(seen.t_ns, seen.observations)

Pictures need not be rectified: observations are those of a virtual rectified camera C.
"""

from __future__ import annotations

import copy
import ctypes as c
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pelorus.errors import PelorusError
from pelorus.filter import MOST_ID, OBSERVATION, Calibration, FilterError
from pelorus.math.se3 import Poses
from pelorus.native import vision
from pelorus.native.binding import Calibration as NativeCalibration
from pelorus.native.binding import Frame, Pose, Precision
from pelorus.native.vision import VisionReport
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rig import Rig
from pelorus.wire.frames import Camera

Floats = NDArray[np.float64]
SIGHT = np.dtype(
    [("id", "<u4"), ("age", "<u2"), ("sigma_px", "<f4"), ("likeness", "<f4")], align=True
)
ENDED = np.dtype([("id", "<u4"), ("age", "<u2"), ("why", "u1")], align=True)
PIXELS = ("uL_px", "vL_px", "uR_px", "vR_px")
DEPTH = np.dtype([("id", "<u4"), ("z_m", "<f4")])
MODELS = {LensModel.NONE: 0, LensModel.RADTAN: 1, LensModel.EQUIDISTANT: 2}
COEFFICIENTS_MAX = 8


class TrackEnd(IntEnum):
    """Reasons of a track's end: plr_track_end."""

    LEFT_VIEW = 1
    UNLIKE = 2
    MOVED = 3
    NO_RIGHT = 4
    CROWDED = 5
    UNSEEN = 6


class PictureFault(IntFlag):
    """Faults of a picture: plr_picture_fault."""

    DARK = 1
    BRIGHT = 2
    FLAT = 4
    REPEATED = 8


@dataclass(frozen=True)
class Seen:
    """The result for a pair.

    `observations` are for Filter.update at t_ns, `sights` are about each of them (id, age,
    sigma_px, likeness), `ended` are the tracks that ended (id, age, why); and the report.
    """

    t_ns: int
    observations: NDArray[np.void]
    sights: NDArray[np.void]
    ended: NDArray[np.void]
    report: VisionReport

    @property
    def pixels(self) -> NDArray[np.float32]:
        """Returns (n, 4) uL vL uR vR, px."""
        return np.stack([self.observations[name] for name in PIXELS], axis=-1)


class Tracker:
    """Follows points through stereo pairs. One tracker is not thread-safe; several may be used."""

    def __init__(
        self,
        rig: Rig,
        *,
        tracks: int = 60,
        row_time_s: float = 0.0,
        disparity_max_px: int = 0,
        camera: Camera | None = None,
        precision: Precision = "float32",
    ) -> None:
        """Makes a tracker; `camera` is the virtual camera, by default the library's choice."""
        self._library = vision.library(precision)
        most = vision.limits(precision).tracks
        if not 1 <= tracks <= most:
            raise PelorusError(f"tracks: {tracks}; 1 to {most} are possible")
        for name, value, limit in (
            ("row_time_s", row_time_s, 1e-3), ("disparity_max_px", disparity_max_px, 4096)
        ):  # fmt: skip
            if not 0 <= value <= limit:
                raise PelorusError(f"{name}: {value}; 0 to {limit} are possible")
        given = vision.Rig(
            _lens(rig.left), _lens(rig.right), _pose(rig.T_RL.R, rig.T_RL.p), row_time_s,
            disparity_max_px, tracks,
        )  # fmt: skip
        if camera is not None:
            given.fx_px, given.fy_px = camera.fx_px, camera.fy_px
            given.cx_px, given.cy_px = camera.cx_px, camera.cy_px
        self.rig = rig
        self._memory = c.create_string_buffer(self._library.size_of("plr_vision"))
        self._call("vision_init", self._library.binding_vision_init(self._memory, c.byref(given)))

    @classmethod
    def rectified(
        cls, camera: Calibration | Camera, width_px: int, height_px: int, **how: object
    ) -> Self:
        """Returns a tracker for pictures that are rectified already."""
        four = (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px)
        lens = Lens(LensModel.NONE, four, (), width_px, height_px)
        T_RL = Poses(np.eye(3), np.array([-camera.baseline_m, 0, 0]))
        return cls(Rig(Path(), lens, lens, T_RL), **how)  # type: ignore[arg-type]

    @classmethod
    def from_files(
        cls, paths: Sequence[str | Path], width_px: int, height_px: int, **how: object
    ) -> Self:
        """Returns a tracker for any calibration of `pelorus convert`: Kalibr, OpenCV, Basalt, VINS
        ...

        Raises PelorusError if the files do not have two cameras.
        """
        from pelorus.rig import read  # noqa: PLC0415 - reads files, which most callers do not

        found = read.read(tuple(Path(path) for path in paths), "eyes").rig
        if found is None:
            raise PelorusError(f"{paths[0]}: does not tell the two cameras")
        return cls(found.of_size(width_px, height_px), **how)  # type: ignore[arg-type]

    def calibration(
        self, R_LB: ArrayLike | None = None, t_LB_m: ArrayLike = (0, 0, 0)
    ) -> Calibration:
        """Returns the virtual camera for a Filter.

        A point s_B of the body is R_LB s_B + t_LB_m in the left camera.
        """
        told = NativeCalibration()
        where = _pose(np.eye(3) if R_LB is None else np.asarray(R_LB), np.asarray(t_LB_m))
        self._call(
            "vision_calibration",
            self._library.vision_calibration(self._memory, c.byref(where), c.byref(told)),
        )
        R, p = np.array(told.T_CB.R).reshape(3, 3), np.array(told.T_CB.p)
        five = (told.fx_px, told.fy_px, told.cx_px, told.cy_px, told.baseline_m)
        return Calibration(*five, R, p)

    def copy(self) -> Self:
        """Returns another tracker with the same tracks, to try what a pair shows."""
        other = copy.copy(self)
        other._memory = type(self._memory).from_buffer_copy(self._memory)
        return other

    def forget(self) -> None:
        """Drops all tracks, as after a cut in the recording."""
        self._call("vision_forget", self._library.vision_forget(self._memory))

    def track(
        self,
        t_ns: int,
        left: ArrayLike,
        right: ArrayLike,
        *,
        motion: tuple[ArrayLike, ArrayLike] | None = None,
        velocity: tuple[ArrayLike, ArrayLike] | None = None,
        depths: tuple[ArrayLike, ArrayLike] | None = None,
        t_right_ns: int | None = None,
    ) -> Seen:
        """Tracks the next pair, uint8 (rows, columns).

        `motion` (R, p) is how points are expected to have moved since the last pair, x -> R x + p
        in the virtual camera, and `velocity` (v_mps, w_radps) how that camera moves at the time of
        this pair: a rolling shutter needs it. `depths` (ids, z_m) are known depths of tracks.
        """
        lefts, rights = _grey("left", left), _grey("right", right)
        pair = vision.Pair(
            _picture(lefts, t_ns), _picture(rights, t_ns if t_right_ns is None else t_right_ns)
        )
        known = _depths(depths)
        expected = None
        if motion is not None or velocity is not None:
            R, p = (np.eye(3), np.zeros(3)) if motion is None else motion
            v, w = (np.zeros(3), np.zeros(3)) if velocity is None else velocity
            expected = vision.Expected(
                _pose(np.asarray(R), np.asarray(p)), known.ctypes.data, len(known),
                velocity is not None, _three("velocity", v), _three("velocity", w),
            )  # fmt: skip
        frame = Frame()
        status = self._library.vision_track(
            self._memory, c.byref(pair), None if expected is None else c.byref(expected),
            c.byref(frame),
        )  # fmt: skip
        self._call("vision_track", status)
        return self._seen(frame)

    def _seen(self, frame: Frame) -> Seen:
        sights, ended = c.c_void_p(), c.c_void_p()
        report = VisionReport.from_buffer_copy(
            self._library.binding_vision_report(self._memory, c.byref(sights), c.byref(ended))[0]
        )
        return Seen(
            int(frame.t_ns),
            _copied(frame.observations, frame.count, OBSERVATION),
            _copied(sights.value, frame.count, SIGHT),
            _copied(ended.value, report.ended, ENDED),
            report,
        )

    def _call(self, name: str, status: int) -> None:
        if status != 0:
            raise FilterError(f"plr_{name}", status, self._library.text(status))


def _copied(address: int | None, count: int, kind: np.dtype[np.void]) -> NDArray[np.void]:
    if not address or not count:
        return np.empty(0, kind)
    return np.frombuffer(c.string_at(address, count * kind.itemsize), kind).copy()


def is_followed(*lenses: Lens) -> bool:
    """Returns whether pictures of these lenses are followed as they are."""
    return all(one.model in MODELS and len(one.coefficients) <= COEFFICIENTS_MAX for one in lenses)


def _lens(lens: Lens) -> vision.Lens:
    if not is_followed(lens):
        known = "none, radtan (4, 5 or 8 numbers) and equidistant"
        raise PelorusError(
            f"a lens {lens.model} with {len(lens.coefficients)} numbers: {known} are followed as "
            "they are; rectify the pictures first"
        )
    k = (c.c_double * COEFFICIENTS_MAX)(*lens.coefficients)
    return vision.Lens(MODELS[lens.model], lens.width_px, lens.height_px, *lens.intrinsics, k)


def _three(name: str, numbers: ArrayLike) -> c.Array[c.c_double]:
    three = np.asarray(numbers, float)
    if three.shape != (3,):
        raise PelorusError(f"{name}: numbers of shape {three.shape}; twice (3,) is wanted")
    return (c.c_double * 3)(*three.tolist())


def _pose(R: Floats, p: Floats) -> Pose:
    if R.shape != (3, 3) or p.shape != (3,):
        raise PelorusError(
            f"a motion of shapes {R.shape} and {p.shape}; (3, 3) and (3,) are wanted"
        )
    return Pose((c.c_double * 9)(*R.ravel().tolist()), (c.c_double * 3)(*p.tolist()))


def _grey(side: str, picture: ArrayLike) -> NDArray[np.uint8]:
    pixels = np.asarray(picture)
    if pixels.dtype != np.uint8 or pixels.ndim != 2:
        remedy = (
            "colour: convert it to grey" if pixels.ndim == 3 else "16 bits: keep the upper eight"
        )
        raise PelorusError(
            f"{side}: {pixels.dtype} of shape {pixels.shape}; uint8 of (rows, columns) is wanted "
            f"({remedy})"
        )
    return (
        pixels if pixels.strides[1] == 1 and pixels.strides[0] > 0 else np.ascontiguousarray(pixels)
    )


def _picture(pixels: NDArray[np.uint8], t_ns: int) -> vision.Picture:
    rows, columns = pixels.shape
    if max(rows, columns) > 2**16 - 1:
        raise PelorusError(f"a picture of {columns} x {rows} pixels: 4096 a side are possible")
    return vision.Picture(pixels.ctypes.data, pixels.strides[0], columns, rows, t_ns)


def _depths(given: tuple[ArrayLike, ArrayLike] | None) -> NDArray[np.void]:
    ids, z_m = (np.asarray(part) for part in (((), ()) if given is None else given))
    if len(ids) != len(z_m) or (len(ids) and not 0 <= ids.min() <= ids.max() <= MOST_ID):
        raise PelorusError(
            f"depths: {len(ids)} ids and {len(z_m)} distances; equal numbers are wanted"
        )
    known = np.empty(len(ids), DEPTH)
    known["id"], known["z_m"] = ids, z_m
    return known
