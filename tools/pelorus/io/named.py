# SPDX-License-Identifier: MIT
"""Reads named values of a JSON or YAML file, with errors that say which one is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pelorus.io.foreign import ForeignFileError
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
        return ForeignFileError(self.path, f"{name} is {shown}", at=self.at, expected=expected)

    def get(self, name: str) -> Any:
        if name not in self.content:
            there = ", ".join(map(str, self.content)) or "none"
            raise ForeignFileError(self.path, f"lacks {name}; there are: {there}", at=self.at)
        return self.content[name]

    def array(self, name: str, *shape: int) -> Floats:
        """Returns finite numbers of this shape; one number without a shape."""
        value = self.get(name)
        array = as_numbers(value)
        if array is None or array.shape != shape or not sane(array):
            size = " x ".join(map(str, shape))
            expected = (
                f"{size} finite numbers are expected" if shape else "a finite number is expected"
            )
            raise self.error(name, value, expected)
        return array

    def number(self, name: str) -> float:
        return float(self.array(name))

    def word(self, name: str, choices: tuple[str, ...]) -> str:
        """Returns one of the choices."""
        value = self.get(name)
        if not isinstance(value, str) or value not in choices:
            raise self.error(name, value, f"{' or '.join(choices)} is expected")
        return value

    def object(self, name: str) -> Named:
        """Returns the object of this name."""
        value = self.get(name)
        if not isinstance(value, dict):
            raise self.error(name, value, "names with values are expected")
        return Named(self.path, value, f"{self.at}.{name}" if self.at else name)

    def size(self, name: str) -> tuple[int, int]:
        """Returns width and height, px."""
        value = self.get(name)
        sizes = as_numbers(value)
        if sizes is None or sizes.shape != (2,) or not sane(sizes):
            raise self.error(name, value, "[width, height] in px is expected")
        if not ((sizes % 1 == 0) & (sizes > 0)).all():
            raise self.error(name, value, "[width, height] in px is expected")
        return int(sizes[0]), int(sizes[1])


def sane(array: Floats) -> bool:
    """Returns whether these can be numbers of a calibration."""
    return bool((np.abs(array) <= NUMBER_MAX).all())  # NaN is not


def as_numbers(value: Any) -> Floats | None:
    """Returns numbers, or lists of them; None for anything else. True and words are no numbers."""
    found = np.array(value, dtype=object) if not _ragged(value) else None
    if found is None or not all(
        isinstance(n, (int, float)) and not isinstance(n, bool) for n in found.ravel()
    ):
        return None
    try:
        return found.astype(np.float64)
    except OverflowError:
        return None


def _ragged(value: Any) -> bool:
    try:
        np.array(value)
    except (TypeError, ValueError):
        return True
    return False
