# SPDX-License-Identifier: MIT
"""Reads a calibration from JSON: the named values of a HEADER."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pelorus.io import arrays, foreign
from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math import se3
from pelorus.math.axes import body_axes
from pelorus.math.se3 import Poses
from pelorus.wire.frames import BodyAxes, Header, Noise, TwistTiming, header_name

CAMERA = ("fx_px", "fy_px", "cx_px", "cy_px", "baseline_m")
OPTIONAL = ("image_width_px", "image_height_px", "body_axes", "twist_timing", "noise", "name")
AXES = {
    "forward-left-up": BodyAxes.FORWARD_LEFT_UP,
    "forward-right-down": BodyAxes.FORWARD_RIGHT_DOWN,
    "other": BodyAxes.OTHER,
}
IMAGE_SIZE_MAX = 65535


def read(path: Path) -> Header:
    """Returns the HEADER that the file describes; refuses unknown names, perhaps typing errors."""
    return _Calibration(path, foreign.json_object(path)).header()


def read_extrinsic(path: Path) -> Poses:
    """Returns T_CB from a file that has nothing else, or from a whole calibration."""
    return _Calibration(path, foreign.json_object(path)).extrinsic()


class _Calibration(Named):
    def header(self) -> Header:
        known = {*CAMERA, "R_CB", "t_CB_m", "R_BC", "t_BC_m", *OPTIONAL}
        self._only(self.content, known, "the calibration")
        T_CB = self.extrinsic()
        numbers = [self.number(name) for name in CAMERA]
        axes = self._choice("body_axes", AXES, body_axes(T_CB.R))
        timings = {timing.name.lower(): timing for timing in TwistTiming}
        return Header(
            arrays.camera_of(self.path, *numbers),
            T_CB.R,
            T_CB.p,
            body_axes=axes,
            twist_timing=self._choice("twist_timing", timings, TwistTiming.START),
            image_width_px=self._size("image_width_px"),
            image_height_px=self._size("image_height_px"),
            noise=self._noise(),
            name=self._name(),
        )

    def _name(self) -> str:
        name = self.content.get("name", self.path.stem)
        if not isinstance(name, str):
            raise self.error("name", name, "words are expected")
        return header_name(name)

    def extrinsic(self) -> Poses:
        given = [pair for pair in ("CB", "BC") if f"R_{pair}" in self.content]
        if len(given) != 1:
            raise ForeignFileError(
                self.path,
                f"has {' and '.join(f'R_{pair}' for pair in given) or 'neither R_CB nor R_BC'}; "
                "either R_CB and t_CB_m (body to left camera) or R_BC and t_BC_m (the camera's "
                "pose in the body) are expected",
            )
        pair = given[0]
        R = arrays.rotation(self.path, f"R_{pair}", self.array(f"R_{pair}", 3, 3))
        T = Poses(R, self.array(f"t_{pair}_m", 3))
        return T if pair == "CB" else se3.inverse(T)

    def _choice(self, name: str, choices: dict[str, Any], standard: Any) -> Any:
        if name not in self.content:
            return standard
        word = self.content[name]
        if not isinstance(word, str) or word not in choices:
            raise self.error(name, word, f"{' or '.join(choices)} is expected")
        return choices[word]

    def _size(self, name: str) -> int:
        size = self.content.get(name, 0)
        if not isinstance(size, int) or not 0 <= size <= IMAGE_SIZE_MAX:
            raise self.error(name, size, f"0 to {IMAGE_SIZE_MAX} is expected")
        return size

    def _noise(self) -> Noise:
        given = self.content.get("noise", {})
        if not isinstance(given, dict) or not all(
            isinstance(value, (int, float)) and np.isfinite(float(value))
            for value in given.values()
        ):
            raise self.error("noise", given, "names with numbers are expected")
        self._only(given, set(vars(Noise())), "noise")
        return Noise(**{name: float(value) for name, value in given.items()})

    def _only(self, given: dict[str, Any], known: set[str], where: str) -> None:
        unknown = sorted(set(given) - known)
        if unknown:
            raise ForeignFileError(
                self.path,
                f"{where} has the unknown name {', '.join(unknown)}; known are: "
                f"{', '.join(sorted(known))}",
            )
