# SPDX-License-Identifier: MIT
"""Adds to a drive the requests that a board keep its state, or continue from a kept one."""

from __future__ import annotations

import numpy as np

from pelorus.errors import PelorusError
from pelorus.wire.frames import (
    Imu,
    Kind,
    Message,
    Reading,
    State,
    StateAction,
    Stereo,
    Truth,
    Twist,
)
from pelorus.wire.layout import Floats

Data = Twist | Imu | Reading | Truth | Stereo


def restored(messages: list[Message], moved: tuple[float, float] = (0.0, 0.0)) -> list[Message]:
    """Returns the drive with a restore right before its data, instead of its START.

    `moved` is how far the robot may have moved since it was saved: sigmas in m and rad.
    """
    first = _data_indices(messages)[0]
    setup = [message for message in messages[:first] if message.kind != Kind.START]
    state = State(_time(messages[first]), StateAction.RESTORE, _variances(moved))
    return [*setup, state, *messages[first:]]


def saved(messages: list[Message]) -> list[Message]:
    """Returns the drive with a save after its data."""
    last = _data_indices(messages)[-1]
    state = State(_time(messages[last]), StateAction.SAVE)
    return [*messages[: last + 1], state, *messages[last + 1 :]]


def _data_indices(messages: list[Message]) -> list[int]:
    indices = [at for at, message in enumerate(messages) if isinstance(message, Data)]
    if not indices:
        raise PelorusError("the recording holds no data, so there is no state to save or restore")
    return indices


def _time(message: Message) -> int:
    assert isinstance(message, Data)
    return message.t_ns


def _variances(moved: tuple[float, float]) -> Floats:
    return np.repeat(np.square(moved), 3)
