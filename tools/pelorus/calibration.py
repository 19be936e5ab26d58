# SPDX-License-Identifier: MIT
"""A calibration as JSON: what a HEADER needs, by name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from pelorus import arrays, se3
from pelorus.errors import PelorusError
from pelorus.faults.axes import body_axes
from pelorus.frames import BodyAxes, Header, Noise, TwistTiming
from pelorus.se3 import Floats, Poses

CAMERA = ("fx_px", "fy_px", "cx_px", "cy_px", "baseline_m")
OPTIONAL = ("image_width_px", "image_height_px", "body_axes", "twist_timing", "noise", "name")
AXES = {
    "forward-left-up": BodyAxes.FORWARD_LEFT_UP,
    "forward-right-down": BodyAxes.FORWARD_RIGHT_DOWN,
    "other": BodyAxes.OTHER,
}
IMAGE_SIZE_MAX = 65535


def read(path: Path) -> Header:
    """The HEADER that the file describes; unknown names are refused, they may be typing errors."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise PelorusError(f"{path}: cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise PelorusError(f"{path}: is no JSON: {error}") from error
    if not isinstance(content, dict):
        raise PelorusError(f"{path}: a JSON object with names is due")
    return _Calibration(path, content).header()


class _Calibration:
    def __init__(self, path: Path, content: dict[str, Any]) -> None:
        self.path = path
        self.content = content

    def header(self) -> Header:
        known = {*CAMERA, "R_CB", "t_CB_m", "R_BC", "t_BC_m", *OPTIONAL}
        self._only(self.content, known, "the calibration")
        T_CB = self._extrinsic()
        numbers = [float(self._array(name)) for name in CAMERA]
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
            name=str(self.content.get("name", self.path.stem))[:60],
        )

    def _extrinsic(self) -> Poses:
        given = [pair for pair in ("CB", "BC") if f"R_{pair}" in self.content]
        if len(given) != 1:
            raise PelorusError(
                f"{self.path}: either R_CB and t_CB_m (body to left camera) or R_BC and t_BC_m "
                "(the camera's pose in the body) are due"
            )
        pair = given[0]
        R = arrays.rotation(self.path, f"R_{pair}", self._array(f"R_{pair}", 3, 3))
        T = Poses(R, self._array(f"t_{pair}_m", 3))
        return T if pair == "CB" else se3.inverse(T)

    def _array(self, name: str, *shape: int) -> Floats:
        if name not in self.content:
            raise PelorusError(
                f"{self.path}: lacks {name}; there are: {', '.join(self.content) or 'none'}"
            )
        try:
            array = np.array(self.content[name], dtype=np.float64)
        except (TypeError, ValueError):
            array = np.array([np.nan])
        if array.shape != shape or not np.isfinite(array).all():
            due = f"an array of shape {shape} of finite numbers" if shape else "a finite number"
            raise PelorusError(f"{self.path}: {name} is {self.content[name]!r}, due is {due}")
        return array

    def _choice(self, name: str, choices: dict[str, Any], standard: Any) -> Any:
        if name not in self.content:
            return standard
        word = self.content[name]
        if word not in choices:
            raise PelorusError(f"{self.path}: {name} is {word!r}, due is {' or '.join(choices)}")
        return choices[word]

    def _size(self, name: str) -> int:
        size = self.content.get(name, 0)
        if not isinstance(size, int) or not 0 <= size <= IMAGE_SIZE_MAX:
            raise PelorusError(f"{self.path}: {name} is {size!r}, due is 0 to {IMAGE_SIZE_MAX}")
        return size

    def _noise(self) -> Noise:
        given = self.content.get("noise", {})
        if not isinstance(given, dict) or not all(
            isinstance(value, (int, float)) and np.isfinite(value) for value in given.values()
        ):
            raise PelorusError(f"{self.path}: noise is {given!r}, due are names with numbers")
        self._only(given, set(vars(Noise())), "noise")
        return Noise(**{name: float(value) for name, value in given.items()})

    def _only(self, given: dict[str, Any], known: set[str], where: str) -> None:
        foreign = sorted(set(given) - known)
        if foreign:
            raise PelorusError(
                f"{self.path}: {where} has the unknown name {', '.join(foreign)}; "
                f"known are: {', '.join(sorted(known))}"
            )
