# SPDX-License-Identifier: MIT
"""Messages that are kept as their bytes: what they answer is what a whole one has."""

from __future__ import annotations

import pickle
import tracemalloc
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from pelorus.wire import schema
from pelorus.wire.frames import Kind, Message
from pelorus.wire.framing import KINDS
from pelorus.wire.layout import MalformedPayload
from pelorus.wire.message import MANY
from wire_messages import messages_of

SAMPLES = [m for m in messages_of(5, 6) if m.kind in MANY]
KEPT_BYTES = 300  # of a message beside its payload: far less than its numbers as objects


def same(first: Any, second: Any) -> bool:
    if isinstance(first, np.ndarray):
        alike = (first.shape, first.dtype) == (second.shape, second.dtype)
        return alike and first.tobytes() == second.tobytes()
    return type(first) is type(second) and repr(first) == repr(second)


def assert_answers_like(payload: bytes, whole: Message) -> None:
    kept = type(whole).read(payload)
    assert isinstance(kept, type(whole))
    for name in (f.name for f in fields(whole)):  # type: ignore[arg-type]
        assert same(getattr(kept, name), getattr(whole, name)), name


@pytest.mark.parametrize("whole", SAMPLES, ids=lambda m: m.kind.name)
def test_every_field_is_that_of_the_whole_message(whole: Message) -> None:
    payload = whole.pack()
    assert_answers_like(payload, type(whole).unpack(payload))


@pytest.mark.parametrize("whole", SAMPLES, ids=lambda m: m.kind.name)
def test_a_payload_of_an_older_sender_has_the_defaults(whole: Message) -> None:
    payload, shorter = whole.pack(), 0
    for size in range(len(payload)):
        try:
            known = type(whole).unpack(payload[:size])
        except MalformedPayload:
            continue
        assert_answers_like(payload[:size], known)
        shorter += 1
    table = schema.MESSAGES[whole.kind.name]
    assert bool(shorter) == any(f.since for f in table.fields)


@pytest.mark.parametrize("whole", SAMPLES, ids=lambda m: m.kind.name)
def test_it_is_equal_replaced_and_pickled_like_the_whole(whole: Message) -> None:
    kept = type(whole).read(whole.pack())
    assert kept == whole
    assert whole == kept
    assert hash(kept) == hash(whole)
    back = pickle.loads(pickle.dumps(kept))
    assert back == whole
    other: Any = {"t_ns": 17} if hasattr(whole, "t_ns") else {"id": 17}
    changed = replace(kept, **other)  # type: ignore[type-var]
    assert changed == replace(whole, **other)  # type: ignore[type-var]
    assert changed != whole


def test_what_is_malformed_is_refused_when_it_is_read() -> None:
    for whole in SAMPLES:
        with pytest.raises(MalformedPayload):
            type(whole).read(whole.pack()[:5])


def test_it_takes_little_more_than_its_bytes() -> None:
    pose = next(m for m in SAMPLES if m.kind == Kind.POSE)
    payload = pose.pack()
    KINDS[Kind.POSE].read(payload)  # makes the class
    count = 500
    tracemalloc.start()
    kept = [KINDS[Kind.POSE].read(bytes(bytearray(payload))) for _ in range(count)]
    taken = tracemalloc.get_traced_memory()[0] / count
    tracemalloc.stop()
    assert len(kept) == count
    assert taken < len(payload) + KEPT_BYTES
