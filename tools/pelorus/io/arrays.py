# SPDX-License-Identifier: MIT
"""Reads arrays from .npz and .mat files, with errors that say what is expected."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pelorus.io import foreign
from pelorus.io.foreign import ForeignFileError
from pelorus.wire.frames import Camera
from pelorus.wire.layout import Floats

ORTHOGONAL_TOLERANCE = 1e-3
BASELINES_M = (1e-3, 5.0)  # possible baselines on a body
SECONDS_MAX = 9e9  # below 2^63 ns
STAMP_MAX_S = 1e11  # the year 5138; today's times in ns are larger by far
STEP_MAX_S = 1e4  # a larger step is not in s; as ns it would be 100 kHz


def are_ns(stamps: Floats) -> bool:
    """Returns whether times are ns rather than s: by their size, else by their steps."""
    step = float(np.median(np.abs(np.diff(stamps)))) if len(stamps) > 1 else 0.0
    return step > STEP_MAX_S or bool((np.abs(stamps) > STAMP_MAX_S).any())


def never_set(t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Returns which times are 0 because nobody set them, while the others are of another day."""
    zero = np.asarray(t_ns == 0, np.bool_)
    others = t_ns[~zero]
    is_clock = not len(others) or int(np.abs(others).min()) <= STEP_MAX_S * 1e9
    return np.zeros_like(zero) if is_clock else zero


NEVER_SET = "its time is 0: it was never set"


class Arrays:
    """The named arrays of one file."""

    def __init__(self, path: Path, arrays: dict[str, NDArray[np.generic]]) -> None:
        self.path = path
        self._arrays = arrays

    def has(self, key: str) -> bool:
        return key in self._arrays

    def one_of(self, *keys: str) -> str:
        """Returns the first of the keys that the file has."""
        for key in keys:
            if key in self._arrays:
                return key
        there = ", ".join(sorted(self._arrays)) or "none"
        raise ForeignFileError(
            self.path, f"lacks the array {' or '.join(keys)}; there are: {there}"
        )

    def get(self, *keys: str, shape: tuple[int | None, ...] | None = None) -> Floats:
        """Returns the array of the first existing key; `None` in the shape allows any size."""
        key = self.one_of(*keys)
        try:
            array = np.asarray(self._arrays[key], dtype=np.float64)
        except (TypeError, ValueError):
            raise ForeignFileError(self.path, f"{key} holds no numbers") from None
        if shape is not None and not _fits(array.shape, shape):
            expected = " x ".join("n" if size is None else str(size) for size in shape)
            raise ForeignFileError(
                self.path, f"{key} has the shape {array.shape}; {expected} is expected"
            )
        if not np.isfinite(array).all():
            where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
            raise ForeignFileError(self.path, "is not finite", at=f"{key}{list(where)}")
        return array

    def words(self, key: str) -> str:
        """Returns a text that was saved as an array."""
        array = self._arrays[self.one_of(key)]
        if array.size != 1 or array.dtype.kind not in "US":
            raise ForeignFileError(
                self.path, f"{key} is {array.size} of type {array.dtype}; one text is expected"
            )
        item = array.reshape(()).item()
        return item.decode("utf-8", "replace") if isinstance(item, bytes) else str(item)

    def scalar(self, key: str) -> float:
        array = self.get(key)
        if array.size != 1:
            raise ForeignFileError(
                self.path, f"{key} has the shape {array.shape}; one number is expected"
            )
        return float(array.reshape(()))


def _fits(shape: tuple[int, ...], expected: tuple[int | None, ...]) -> bool:
    return len(shape) == len(expected) and all(
        d is None or s == d for s, d in zip(shape, expected, strict=True)
    )


def read_npz(path: Path) -> Arrays:
    """Reads all arrays of a .npz file."""
    return Arrays(path, foreign.npz(path))


def camera_of(path: Path, fx: float, fy: float, cx: float, cy: float, baseline: float) -> Camera:
    """Returns the camera; raises an error if its numbers are impossible."""
    if min(fx, fy, baseline) <= 0:
        raise ForeignFileError(
            path, f"focal lengths {fx}, {fy} px and baseline {baseline} m must be positive"
        )
    require_baseline(path, baseline)
    return Camera(fx, fy, cx, cy, baseline)


def require_baseline(path: Path, length_m: float) -> None:
    """Refuses a baseline that no body can carry."""
    if not BASELINES_M[0] <= length_m <= BASELINES_M[1]:
        raise ForeignFileError(
            path,
            f"the cameras stand {length_m:g} apart; {BASELINES_M[0]:g} to {BASELINES_M[1]:g} m are "
            "expected: are these millimetres, or squares of the board? Divide so that it is in "
            "metres",
        )


def nanoseconds(path: Path, what: str, seconds: Floats) -> NDArray[np.int64]:
    """Returns s as ns, checked to ascend."""
    if len(seconds) == 0:
        raise ForeignFileError(path, f"{what} is empty")
    check_seconds(path, what, seconds)
    t_ns = np.round(seconds * 1e9).astype(np.int64)
    back = np.nonzero(np.diff(t_ns) <= 0)[0]
    if len(back):
        k = int(back[0])
        raise ForeignFileError(
            path,
            f"{what} does not ascend at {k + 1} ({seconds[k]:.9f} s, then {seconds[k + 1]:.9f} s)",
        )
    return t_ns


FINER = {"ms": 1e6, "us": 1e3, "ns": 1.0}  # units of time, in ns


def check_seconds(path: Path, what: str, numbers: Floats, unit_ns: float = 1e9) -> None:
    """Refuses times that are not in this unit: negative ones, or nanoseconds by mistake."""
    most = SECONDS_MAX * 1e9 / unit_ns
    if numbers.min() < 0 or numbers.max() > most:
        name = {1e9: "seconds", 1e6: "milliseconds", 1e3: "microseconds"}[unit_ns]
        finer = [
            unit for unit, size_ns in FINER.items() if numbers.max() <= most * unit_ns / size_ns
        ]
        guess = f"; are they {finer[0]}? (of a CSV: --columns t={what}:{finer[0]})" if finer else ""
        raise ForeignFileError(
            path,
            f"{what} spans {numbers.min():g} to {numbers.max():g}; {name} from 0 to {most:g} are "
            f"expected{guess if numbers.min() >= 0 else ''}",
        )


def rotation(path: Path, name: str, R: Floats) -> Floats:
    """Returns R if it is a rotation; raises an error otherwise."""
    error = float(np.abs(R @ R.T - np.eye(3)).max())
    if error > ORTHOGONAL_TOLERANCE or np.linalg.det(R) < 0:
        raise ForeignFileError(
            path,
            f"{name} is no rotation "
            f"(R R^T - I reaches {error:.2g}, determinant {np.linalg.det(R):.3f})",
        )
    return R
