# SPDX-License-Identifier: MIT
"""Reads named values of a JSON or YAML file, with errors that say which one is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pelorus.io import arrays
from pelorus.io.foreign import ForeignFileError
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.wire.layout import Floats

SHOWN_MAX = 60  # characters of a bad value
NUMBER_MAX = 1e9  # no calibration has a larger one


class Named:
    """An object of the file; `at` is its name in it."""

    def __init__(self, path: Path, content: dict[str, Any], at: str = "") -> None:
        self.path, self.content, self.at = path, content, at

    def __contains__(self, name: str) -> bool:
        return name in self.content

    def error(self, name: str, value: Any, expected: str) -> ForeignFileError:
        shown = repr(value)
        shown = shown if len(shown) <= SHOWN_MAX else f"{shown[:SHOWN_MAX]}..."
        return ForeignFileError(self.path, f"{name} is {shown}; {expected}", at=self.at)

    def get(self, name: str) -> Any:
        if name not in self.content:
            there = ", ".join(map(str, self.content)) or "none"
            raise ForeignFileError(self.path, f"lacks {name}; there are: {there}", at=self.at)
        return self.content[name]

    def first_of(self, names: Sequence[str]) -> str:
        """Returns the first of the names that it has; empty if it has none."""
        return next((name for name in names if name in self.content), "")

    # --- one value --------------------------------------------------------------------------------

    def number(self, name: str, otherwise: float | None = None) -> float:
        """Returns a number; `otherwise` where there is none."""
        if otherwise is not None and name not in self.content:
            return otherwise
        return float(self.array(name))

    def word(self, name: str, choices: tuple[str, ...]) -> str:
        """Returns one of the choices."""
        value = self.get(name)
        if not isinstance(value, str) or value not in choices:
            raise self.error(name, value, f"{' or '.join(choices)} is expected")
        return value

    def size(self, name: str) -> tuple[int, int]:
        """Returns width and height, px."""
        value = self.get(name)
        sizes = _as_numbers(value)
        if sizes is None or sizes.shape != (2,) or not _sane(sizes):
            raise self.error(name, value, "[width, height] in px is expected")
        if not ((sizes % 1 == 0) & (sizes > 0)).all():
            raise self.error(name, value, "[width, height] in px is expected")
        return int(sizes[0]), int(sizes[1])

    def object(self, name: str) -> Named:
        """Returns the object of this name."""
        value = self.get(name)
        if not isinstance(value, dict):
            raise self.error(name, value, "names with values are expected")
        return Named(self.path, value, f"{self.at}.{name}" if self.at else name)

    # --- several numbers --------------------------------------------------------------------------

    def array(self, name: str, *shape: int) -> Floats:
        """Returns finite numbers of this shape; one number without a shape."""
        value = self.get(name)
        array = _as_numbers(value)
        if array is None or array.shape != shape or not _sane(array):
            size = " x ".join(map(str, shape))
            expected = f"{size} finite numbers are" if shape else "a finite number is"
            raise self.error(name, value, f"{expected} expected")
        return array

    def row(self, name: str) -> Floats:
        """Returns all numbers in a list, or in the object with rows, cols and data of OpenCV."""
        if isinstance(self.get(name), dict):
            inner = self.object(name)
            return inner.array("data", int(inner.number("rows") * inner.number("cols")))
        flat = np.ravel(np.array(self.get(name), dtype=object)).tolist()
        return Named(self.path, {name: flat}, self.at).array(name, len(flat))

    def matrix(self, name: str, rows: int, columns: int) -> Floats:
        """Returns a matrix.

        It may be rows of numbers, one list of all (msckf_vio), or the object with rows, cols and
        data of OpenCV and EuRoC.
        """
        value = self.get(name)
        found = _as_numbers(self.object(name).get("data") if isinstance(value, dict) else value)
        if found is not None and found.shape == (rows * columns,):
            found = found.reshape(rows, columns)
        if found is None or found.shape != (rows, columns) or not _sane(found):
            raise self.error(name, value, f"{rows} x {columns} finite numbers are expected")
        return found

    def rotation(self, name: str) -> Floats:
        """Returns a rotation of 3 x 3 numbers, which files round, made exact."""
        R = arrays.rotation(self.path, name, self.matrix(name, 3, 3))
        return np.asarray(se3.nearest_rotation(R))

    def pose(self, name: str) -> Poses:
        """Returns a transform of 4 x 4 or 3 x 4 numbers; its rotation is made exact."""
        value = self.get(name)
        rows = (
            value.get("rows") if isinstance(value, dict) else np.size(np.array(value, object)) // 4
        )
        if rows == 3 or (isinstance(value, list) and len(value) == 3):
            M = np.vstack((self.matrix(name, 3, 4), [0, 0, 0, 1]))
        else:
            M = self.matrix(name, 4, 4)
        if np.abs(M[3] - [0, 0, 0, 1]).max() > 1e-9:
            raise ForeignFileError(
                self.path, f"the last row of {name} is {M[3]}; 0 0 0 1 is expected"
            )
        R = arrays.rotation(self.path, name, M[:3, :3])
        return Poses(se3.nearest_rotation(R), M[:3, 3].copy())


def _sane(array: Floats) -> bool:
    """Returns whether these can be numbers of a calibration."""
    return bool((np.abs(array) <= NUMBER_MAX).all())  # NaN is not


def _as_numbers(value: Any) -> Floats | None:
    """Returns numbers, or lists of them; None for anything else. True and words are no numbers."""
    try:
        np.array(value)  # refuses ragged lists, which an array of objects would take
        found = np.array(value, dtype=object)
        if all(isinstance(n, (int, float)) and not isinstance(n, bool) for n in found.ravel()):
            return found.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    return None
