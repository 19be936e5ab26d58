# SPDX-License-Identifier: MIT
"""What the tests of the converters share: how to run one and look at what it wrote."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from pelorus.faults.finding import Finding
from pelorus.io.recording import Recording
from pelorus.wire import framing
from pelorus.wire.frames import Message

Run = Callable[..., Any]  # the fixture `pelorus`
Once = Callable[[str, Callable[[Path], object]], Path]  # the fixture `once`
SHORT = {"duration_s": 6.0}
COUNT = 61  # frames of such a drive


class Converted(NamedTuple):
    """What a converter gives."""

    recording: Recording
    findings: list[Finding]


def messages_of(path: Path, kind: type[Message]) -> list[Any]:
    """The messages of one kind in a whole, undamaged recording."""
    received, counts = framing.read_file(path)
    assert counts.clean
    assert counts.ended
    return [frame.message for frame in received if isinstance(frame.message, kind)]
