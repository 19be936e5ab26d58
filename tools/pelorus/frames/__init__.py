# SPDX-License-Identifier: MIT
"""The frame kinds of docs/REPLAY-FORMAT.md, one dataclass each, with their payload bytes.

`pack` gives the payload, `unpack` reads one; both say nothing about sequence, CRC and COBS, which
are `pelorus.wire`'s. Two messages are equal when their payloads are the same bytes.
"""

from pelorus.frames.base import Floats, Kind, MalformedPayload, Message
from pelorus.frames.filter import Config, Landmark, Pose, Report, Role
from pelorus.frames.recorder import (
    NAME_BYTES_MAX,
    NO_BUDGET,
    OBSERVATIONS_MAX,
    TEXT_BYTES_MAX,
    BodyAxes,
    Camera,
    End,
    Header,
    Noise,
    Start,
    StartFlag,
    State,
    StateAction,
    Stereo,
    Text,
    Truth,
    Twist,
    TwistTiming,
    header_name,
)

KINDS: dict[int, type[Message]] = {
    cls.kind: cls
    for cls in (
        Header,
        Config,
        Start,
        Twist,
        Stereo,
        Truth,
        Landmark,
        Pose,
        Report,
        Text,
        End,
        State,
    )
}

__all__ = [
    "KINDS",
    "NAME_BYTES_MAX",
    "NO_BUDGET",
    "OBSERVATIONS_MAX",
    "TEXT_BYTES_MAX",
    "BodyAxes",
    "Camera",
    "Config",
    "End",
    "Floats",
    "Header",
    "Kind",
    "Landmark",
    "MalformedPayload",
    "Message",
    "Noise",
    "Pose",
    "Report",
    "Role",
    "Start",
    "StartFlag",
    "State",
    "StateAction",
    "Stereo",
    "Text",
    "Truth",
    "Twist",
    "TwistTiming",
    "header_name",
]
