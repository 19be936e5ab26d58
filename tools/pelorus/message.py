# SPDX-License-Identifier: MIT
"""What all messages have in common: kinds and choices by name, and how a dataclass becomes the
bytes of a payload by its table in `pelorus.schema`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any, ClassVar, Self

from pelorus import schema
from pelorus.layout import Layout


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


# What comes in time, behind what tells how to read it.
DATA_KINDS = (Kind.TWIST, Kind.IMU, Kind.STEREO, Kind.TRUTH, Kind.READING)


class BodyAxes(IntEnum):
    """Which way the body's x, y and z point."""

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
    """What a STATE asks for."""

    SAVE = schema.number("action", "SAVE")
    RESTORE = schema.number("action", "RESTORE")


class Notice(IntEnum):
    """What a REPORT tells besides its status."""

    NONE = schema.number("notice", "NONE")
    # the sender has just started: whatever it was told before is lost
    STARTED = schema.number("notice", "STARTED")
    SAVED = schema.number("notice", "SAVED")
    RESTORED = schema.number("notice", "RESTORED")  # the filter goes on from a saved state


class Role(IntEnum):
    """Where a landmark comes from."""

    KNOWN = schema.number("role", "KNOWN")
    EVICTED = schema.number("role", "EVICTED")
    FINAL = schema.number("role", "FINAL")


class Message:
    """A frame's content. `kind` is its number on the wire."""

    kind: ClassVar[Kind]
    layout: ClassVar[Layout]
    choices: ClassVar[Mapping[str, Callable[[int], Any]]] = {}  # what a number is made into

    def __init_subclass__(cls, kind: Kind | None = None) -> None:
        if kind is not None:
            cls.kind = kind
            cls.layout = Layout(schema.MESSAGES[kind.name])

    def pack(self) -> bytes:
        return self.layout.pack(self.values())

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        values, end = cls.layout.unpack(payload)
        chosen = {
            name: choose(values[name]) for name, choose in cls.choices.items() if name in values
        }
        return cls.of_values(values | chosen, payload, end)

    def values(self) -> dict[str, Any]:
        """By the names of the table."""
        return vars(self)

    @classmethod
    def of_values(cls, values: dict[str, Any], payload: bytes, end: int) -> Self:  # noqa: ARG003
        """The values are those before `end` in the payload; only rows lie behind it."""
        return cls(**values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self.pack() == other.pack()

    def __hash__(self) -> int:
        return hash((self.kind, self.pack()))
