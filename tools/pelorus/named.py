# SPDX-License-Identifier: MIT
"""Named values of a JSON or YAML file, one by one, with errors that say which one is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pelorus.foreign import ForeignFileError
from pelorus.layout import Floats

SHOWN_MAX = 60  # characters of a bad value
NUMBER_MAX = 1e9  # beyond, no calibration's number


class Named:
    """An object of the file; `at` is the name under which it stands in it."""

    def __init__(self, path: Path, content: dict[str, Any], at: str = "") -> None:
        self.path, self.content, self.at = path, content, at

    def __contains__(self, name: str) -> bool:
        return name in self.content

    def error(self, name: str, value: Any, due: str) -> ForeignFileError:
        shown = repr(value)
        shown = shown if len(shown) <= SHOWN_MAX else f"{shown[:SHOWN_MAX]}..."
        return ForeignFileError(self.path, f"{name} is {shown}", at=self.at, due=due)

    def get(self, name: str) -> Any:
        if name not in self.content:
            there = ", ".join(map(str, self.content)) or "none"
            raise ForeignFileError(
                self.path, f"lacks {name}", at=self.at, due=f"there are: {there}"
            )
        return self.content[name]

    def array(self, name: str, *shape: int) -> Floats:
        """Finite numbers of this shape; a lone one without a shape."""
        value = self.get(name)
        array = as_numbers(value)
        if array is None or array.shape != shape or not sane(array):
            size = " x ".join(map(str, shape))
            due = f"{size} finite numbers are expected" if shape else "a finite number is expected"
            raise self.error(name, value, due)
        return array

    def number(self, name: str) -> float:
        return float(self.array(name))

    def word(self, name: str, choices: tuple[str, ...]) -> str:
        """One of the choices."""
        value = self.get(name)
        if not isinstance(value, str) or value not in choices:
            raise self.error(name, value, f"{' or '.join(choices)} is expected")
        return value

    def object(self, name: str) -> Named:
        """What stands under a name, which has names itself."""
        value = self.get(name)
        if not isinstance(value, dict):
            raise self.error(name, value, "names with values are expected")
        return Named(self.path, value, f"{self.at}.{name}" if self.at else name)

    def size(self, name: str) -> tuple[int, int]:
        """Width and height, px."""
        value = self.get(name)
        sizes = as_numbers(value)
        if sizes is None or sizes.shape != (2,) or not sane(sizes):
            raise self.error(name, value, "[width, height] in px is expected")
        if not ((sizes % 1 == 0) & (sizes > 0)).all():
            raise self.error(name, value, "[width, height] in px is expected")
        return int(sizes[0]), int(sizes[1])


def sane(array: Floats) -> bool:
    """Whether these can be numbers of a calibration."""
    return bool((np.abs(array) <= NUMBER_MAX).all())  # NaN is not


def as_numbers(value: Any) -> Floats | None:
    """Numbers, or lists of them; None for anything else. True is no number, nor is a word."""
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
