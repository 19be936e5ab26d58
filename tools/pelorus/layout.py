# SPDX-License-Identifier: MIT
"""The bytes of a payload, told as a table of fields: name, shape and type, in their order."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Iterator, Mapping
from enum import EnumType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FIELD = re.compile(r"(\w+):([\dx]*)([bBHIQfd])")


class MalformedPayload(ValueError):
    """A payload that is shorter than its kind says, or whose counts do not fit it."""


def need(payload: bytes, size: int) -> None:
    """Refuse a payload shorter than `size` bytes."""
    if len(payload) < size:
        raise MalformedPayload(f"payload of {len(payload)} bytes, at least {size} are due")


def within(name: str, value: int, least: int, most: int) -> int:
    """The value itself, unless the format does not list it."""
    if not least <= value <= most:
        raise MalformedPayload(f"{name} is {value}, {least} to {most} are defined")
    return value


class Layout:
    """`fields` are parted by blanks: `t_ns:Q`, `v_B_mps:3d`, `R_WB:3x3d`; the types are those of
    Python's struct, little-endian without padding, and `_:B` is a byte without a meaning. An array
    becomes float64. `choices` makes a field's value of the number: an enum, which refuses numbers
    that it does not list, or a function.
    """

    def __init__(self, fields: str, **choices: Callable[[int], Any]) -> None:
        self._fields: list[tuple[str, tuple[int, ...]]] = []
        codes = "<"
        for field in fields.split():
            name, shape, code = FIELD.fullmatch(field).groups()  # type: ignore[union-attr]
            self._fields.append((name, tuple(int(n) for n in shape.split("x") if n)))
            codes += f"{math.prod(self._fields[-1][1])}{code}"
        self._struct = struct.Struct(codes)
        self._choices = choices
        self.size = self._struct.size

    def pack(self, values: Mapping[str, Any]) -> bytes:
        """Raises ValueError if an array has another shape than is due."""
        return self._struct.pack(*self._flat(values))

    def _flat(self, values: Mapping[str, Any]) -> Iterator[Any]:
        for name, shape in self._fields:
            value = values.get(name, 0)
            if not shape:
                yield value
                continue
            array = np.asarray(value, np.float64)
            if array.shape != shape:
                raise ValueError(f"{name} is an array of shape {array.shape} where {shape} is due")
            yield from array.ravel().tolist()

    def unpack(self, payload: bytes, offset: int = 0) -> dict[str, Any]:
        """By name; MalformedPayload if there are not so many bytes, or one is not listed."""
        need(payload, offset + self.size)
        numbers = self._struct.unpack_from(payload, offset)
        out: dict[str, Any] = {}
        at = 0
        for name, shape in self._fields:
            end = at + math.prod(shape)
            out[name] = np.array(numbers[at:end]).reshape(shape) if shape else numbers[at]
            at = end
        out.pop("_", None)
        return out | {name: _chosen(name, out[name], by) for name, by in self._choices.items()}


def _chosen(name: str, value: int, by: Callable[[int], Any]) -> Any:
    if isinstance(by, EnumType):
        listed = [int(choice) for choice in by]  # type: ignore[var-annotated]
        within(name, value, min(listed), max(listed))
    return by(value)


# --- symmetric matrices: lower triangles, row by row ----------------------------------------------


def unpack_symmetric(packed: Floats, size: int) -> Floats:
    """(n, size (size + 1) / 2) -> (n, size, size)."""
    out = np.zeros((len(packed), size, size))
    rows, columns = np.tril_indices(size)
    out[:, rows, columns] = packed
    out[:, columns, rows] = packed
    return out


def pack_symmetric(whole: Floats) -> Floats:
    """(..., size, size) -> (..., size (size + 1) / 2)."""
    rows, columns = np.tril_indices(whole.shape[-1])
    return np.asarray(whole[..., rows, columns])
