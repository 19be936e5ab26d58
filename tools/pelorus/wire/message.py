# SPDX-License-Identifier: MIT
"""The base of all messages: kinds, choices, and the bytes of a payload by its table.

The tables are those of `pelorus.wire.schema`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from enum import IntEnum
from functools import cache, lru_cache
from typing import Any, ClassVar, Self

import numpy as np

from pelorus.wire import schema
from pelorus.wire.layout import Layout, Place, places


class Kind(IntEnum):
    """A frame's first byte."""

    HEADER = schema.kind("HEADER")
    CONFIG = schema.kind("CONFIG")
    START = schema.kind("START")
    TWIST = schema.kind("TWIST")
    STEREO = schema.kind("STEREO")
    TRUTH = schema.kind("TRUTH")
    LANDMARK = schema.kind("LANDMARK")
    POSE = schema.kind("POSE")
    REPORT = schema.kind("REPORT")
    TEXT = schema.kind("TEXT")
    END = schema.kind("END")
    STATE = schema.kind("STATE")
    READING = schema.kind("READING")
    IMU = schema.kind("IMU")
    EVIDENCE = schema.kind("EVIDENCE")
    CALIBRATION = schema.kind("CALIBRATION")
    IMAGE = schema.kind("IMAGE")
    RIG = schema.kind("RIG")


# Data with a time, after the messages that say how to read them.
DATA_KINDS = (Kind.TWIST, Kind.IMU, Kind.STEREO, Kind.TRUTH, Kind.READING, Kind.IMAGE)
# Kinds of which a log has many: DATA_KINDS and their answers.
MANY = (*DATA_KINDS, Kind.LANDMARK, Kind.POSE, Kind.REPORT, Kind.EVIDENCE)


class BodyAxes(IntEnum):
    """The directions of the body's x, y and z."""

    FORWARD_LEFT_UP = schema.number("body_axes", "FORWARD_LEFT_UP")
    FORWARD_RIGHT_DOWN = schema.number("body_axes", "FORWARD_RIGHT_DOWN")
    OTHER = schema.number("body_axes", "OTHER")


class TwistTiming(IntEnum):
    """When a reading holds: START on [t_j, t_j+1), END on (t_j-1, t_j], MID the mean of both."""

    START = schema.number("twist_timing", "START")
    END = schema.number("twist_timing", "END")
    MID = schema.number("twist_timing", "MID")


class Process(IntEnum):
    """What moves the body between frames."""

    TWIST = schema.number("process", "TWIST")
    IMU = schema.number("process", "IMU")


class StateAction(IntEnum):
    """The action that a STATE asks for."""

    SAVE = schema.number("action", "SAVE")
    RESTORE = schema.number("action", "RESTORE")


class Notice(IntEnum):
    """What a REPORT says besides its status."""

    NONE = schema.number("notice", "NONE")
    # the sender has just started, and lost what it was given before
    STARTED = schema.number("notice", "STARTED")
    SAVED = schema.number("notice", "SAVED")
    RESTORED = schema.number("notice", "RESTORED")  # the filter continues from a saved state


class Role(IntEnum):
    """A landmark's origin."""

    KNOWN = schema.number("role", "KNOWN")
    EVICTED = schema.number("role", "EVICTED")
    FINAL = schema.number("role", "FINAL")


class Message:
    """A frame's content. `kind` is its number on the wire."""

    kind: ClassVar[Kind]
    layout: ClassVar[Layout]
    choices: ClassVar[Mapping[str, Callable[[int], Any]]] = {}  # functions that convert numbers
    composed: ClassVar[Sequence[str]] = ()  # fields that are not of the table by their name

    def __init_subclass__(cls, kind: Kind | None = None) -> None:
        if kind is not None:
            cls.kind = kind
            cls.layout = Layout(schema.MESSAGES[kind.name])
            _OF_KIND[kind] = cls

    def pack(self) -> bytes:
        return self.layout.pack(self.values())

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        values, end = cls.layout.unpack(payload)
        chosen = {
            name: choose(values[name]) for name, choose in cls.choices.items() if name in values
        }
        return cls.of_values(values | chosen, payload, end)

    @classmethod
    def read(cls, payload: bytes) -> Message:
        """Reads it; kinds of which a log has many are kept as bytes, in a quarter of the memory."""
        message = cls.unpack(payload)
        return _kept_as(cls.kind)(payload) if cls.kind in MANY else message

    def values(self) -> dict[str, Any]:
        """Returns the values by the names of the table."""
        return {name: getattr(self, name) for name in _names(self.kind)}

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:  # noqa: ARG003
        """Makes a message of values, which end in the payload at `end`; only rows follow."""
        return cls(**values)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Message) and self.kind == other.kind and self.pack() == other.pack()
        )

    def __hash__(self) -> int:
        return hash((self.kind, self.pack()))


_OF_KIND: dict[Kind, type[Message]] = {}


@cache
def _names(kind: Kind) -> list[str]:
    return [f.name for f in fields(_OF_KIND[kind])]  # type: ignore[arg-type]


class _Asked:
    """A field of a message that is kept as bytes: it is read at each access."""

    def __init__(self, kind: Kind, name: str, place: Place | None) -> None:
        self._kind, self._name, self._place = kind, name, place
        self._choose = _OF_KIND[kind].choices.get(name)

    def __get__(self, message: Any, owner: type[Message]) -> Any:
        value = None if self._place is None else self._place.read(message.payload)
        if value is None:
            value = getattr(_whole(self._kind, message.payload), self._name)
        elif self._choose is not None:
            value = self._choose(value)
        if isinstance(value, np.ndarray):
            value.flags.writeable = False  # a change would not reach the bytes
        return value


@lru_cache(maxsize=4)  # readers of one field soon read its neighbour
def _whole(kind: Kind, payload: bytes) -> Message:
    return _OF_KIND[kind].unpack(payload)


@cache
def _kept_as(kind: Kind) -> Callable[[bytes], Message]:
    """Returns a function that makes an instance of a subclass with nothing but a payload."""

    def begin(self: Any, payload: bytes) -> None:
        object.__setattr__(self, "payload", payload)

    cls = _OF_KIND[kind]
    known = places(schema.MESSAGES[kind.name])
    asked = {
        name: _Asked(kind, name, None if name in cls.composed else known.get(name))
        for name in _names(kind)
    }
    more = {
        "__slots__": ("payload",),
        "__init__": begin,
        "__reduce__": lambda self: (cls.read, (self.payload,)),
        "__class__": property(lambda _: cls),  # dataclasses.replace makes a whole one
        "__doc__": cls.__doc__,
    }
    return type(cls.__name__, (cls,), more | asked)
