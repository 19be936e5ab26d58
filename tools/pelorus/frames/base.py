# SPDX-License-Identifier: MIT
"""What all frame kinds share: their numbers, their base class, little-endian arrays."""

from __future__ import annotations

from dataclasses import field
from enum import IntEnum
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Kind(IntEnum):
    """A frame's first byte."""

    HEADER = 1
    CONFIG = 2
    START = 3
    TWIST = 4
    STEREO = 5
    TRUTH = 6
    LANDMARK = 7
    POSE = 8
    REPORT = 9
    TEXT = 10
    END = 11
    STATE = 12


class MalformedPayload(ValueError):
    """A payload that is shorter than its kind says, or whose counts do not fit it."""


def zeros(*shape: int) -> Any:
    """A dataclass field: zeros of the given shape by default."""
    return field(default_factory=lambda: np.zeros(shape))


def identity() -> Any:
    """A dataclass field: the rotation that does nothing by default."""
    return field(default_factory=lambda: np.eye(3))


def need(payload: bytes, size: int) -> None:
    """Refuse a payload shorter than `size` bytes."""
    if len(payload) < size:
        raise MalformedPayload(f"payload of {len(payload)} bytes, at least {size} are due")


def within(name: str, value: int, least: int, most: int) -> None:
    """Refuse a count or a choice that the format does not list."""
    if not least <= value <= most:
        raise MalformedPayload(f"{name} is {value}, {least} to {most} are defined")


def f64(payload: bytes, at: int, *shape: int) -> Floats:
    """The little-endian doubles at a byte offset."""
    count = int(np.prod(shape))
    return np.frombuffer(payload, "<f8", count, at).reshape(shape).astype(np.float64)


def bytes_of(values: Any, *shape: int) -> bytes:
    """Doubles as little-endian bytes, refused if they have another shape."""
    array = np.asarray(values, dtype="<f8")
    if array.shape != shape:
        raise ValueError(f"array of shape {array.shape} where {shape} is due")
    return array.tobytes()


class Message:
    """A frame's content. `kind` is its number on the wire."""

    kind: ClassVar[Kind]

    def pack(self) -> bytes:
        raise NotImplementedError

    @classmethod
    def unpack(cls, payload: bytes) -> Message:
        raise NotImplementedError

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self.pack() == other.pack()

    def __hash__(self) -> int:
        return hash((self.kind, self.pack()))
