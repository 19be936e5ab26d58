# SPDX-License-Identifier: MIT
"""Logs for the tests of `pelorus compare`, of a robot that is a replay, and what befalls them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pelorus.wire.frames import Kind, Message
from replay_drive import encode, log_of, run, t_ns

SAME, DIFFERENT, NOT_COMPARABLE = 0, 1, 2
AT = 20  # the frame that something happens to, from 0; it is told as AT + 1

Compare = Callable[..., Any]


def robots_log(
    folder: Path, messages: Sequence[Message], *options: str, program: str = "pelorus-replay"
) -> list[Message]:
    """What a filter takes and gives, without END."""
    source, log = folder / "robot.in.plr", folder / "robot.out.plr"
    source.write_bytes(encode(messages))
    run(source, "--quiet", "--out", log, *options, program=program)
    return [message for message in log_of(log) if message.kind != Kind.END]


def index(log: list[Message], kind: type[Message], k: int = AT) -> int:
    """Where the message of that kind and frame is."""
    return next(
        at
        for at, m in enumerate(log)
        if isinstance(m, kind) and m.t_ns == t_ns(k)  # type: ignore[attr-defined]
    )


def without(log: list[Message], *kinds: type[Message], k: int = AT) -> list[Message]:
    """The log without what one frame has of those kinds."""
    gone = {index(log, kind, k) for kind in kinds}
    return [message for at, message in enumerate(log) if at not in gone]


def changed(log: list[Message], kind: type[Message], **changes: object) -> list[Message]:
    """The log with other fields in what one frame has of that kind."""
    at = index(log, kind)
    return [*log[:at], replace(log[at], **changes), *log[at + 1 :]]  # type: ignore[type-var]
