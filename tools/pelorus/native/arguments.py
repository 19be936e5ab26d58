# SPDX-License-Identifier: MIT
"""Checks what Python gives to the filter, before the library gets it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pelorus.errors import PelorusError


def kind_of(array: NDArray[Any]) -> str:
    """Returns type and shape in words."""
    return f"{array.dtype} of shape {array.shape}"


def checked(name: str, value: ArrayLike, shape: tuple[int, ...], type: Any = np.float64) -> Any:
    """Returns the value as an array of this shape, without a copy where it is one."""
    try:
        array = np.asarray(value)
    except ValueError as error:  # rows of different length
        raise PelorusError(f"{name}: {error}; numbers of shape {shape} are wanted") from error
    if array.shape != shape or array.dtype.kind not in "fiu":
        raise PelorusError(f"{name}: {kind_of(array)}; numbers of shape {shape} are wanted")
    if array.dtype == type and array.flags.c_contiguous:
        return array
    with np.errstate(over="ignore"):  # becomes infinite, which the filter refuses by name
        return np.ascontiguousarray(array, type)


def are_whole(array: NDArray[Any]) -> bool:
    """Returns whether all are whole numbers, as integers or as floats."""
    if array.dtype.kind == "f":
        return bool(np.all(np.isfinite(array)) and np.all(array == np.floor(array)))
    return array.dtype.kind in "iu"


def real(name: str, value: Any) -> float:
    """Returns the value as a float; raises PelorusError unless it is one number."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise PelorusError(f"{name}: {value!r} is no number") from None


def whole_number(name: str, value: int, most: int) -> int:
    """Returns the value, a whole number from 0 to `most`; raises PelorusError otherwise."""
    number = value if type(value) is int else integer(name, value)
    if not 0 <= number <= most:
        raise PelorusError(f"{name}: {number}; 0 to {most} are possible")
    return number


def integer(name: str, value: Any) -> int:
    """Returns the value as an int; it must be a whole number of Python or numpy."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise PelorusError(f"{name}: {value!r} is no whole number")
    return int(value)


def address(array: NDArray[Any] | None) -> int | None:
    """Returns the address of its first number; NULL for None."""
    return None if array is None else array.ctypes.data
