# SPDX-License-Identifier: MIT
"""Byte stuffing."""

from __future__ import annotations

import numpy as np
import pytest
from pelorus.wire import cobs

VECTORS = [  # those of the encoding's description: zeros, runs, and the edges of a full block
    (b"", b"\x01"),
    (b"\0", b"\x01\x01"),
    (b"\0\0", b"\x01\x01\x01"),
    (b"\x11\x22\0\x33", b"\x03\x11\x22\x02\x33"),
    (b"\x11\x22\x33\x44", b"\x05\x11\x22\x33\x44"),
    (b"\x11\0\0\0", b"\x02\x11\x01\x01\x01"),
    (bytes(range(1, 255)), b"\xff" + bytes(range(1, 255))),
    (b"\0" + bytes(range(1, 255)), b"\x01\xff" + bytes(range(1, 255))),
    (bytes(range(1, 256)), b"\xff" + bytes(range(1, 255)) + b"\x02\xff"),
    (bytes(range(2, 256)) + b"\0", b"\xff" + bytes(range(2, 256)) + b"\x01\x01"),
    (bytes(range(3, 256)) + b"\0\x01", b"\xfe" + bytes(range(3, 256)) + b"\x02\x01"),
]


@pytest.mark.parametrize(("body", "stuffed"), VECTORS)
def test_known_vectors_both_ways(body: bytes, stuffed: bytes) -> None:
    assert cobs.encode(body) == stuffed
    assert cobs.decode(stuffed) == body


def test_an_empty_block_behind_a_full_one_is_taken_too() -> None:
    body = bytes(range(1, 255))
    assert cobs.decode(b"\xff" + body + b"\x01") == body


@pytest.mark.parametrize("length", [1, 2, 253, 254, 255, 256, 507, 508, 509, 762, 2000])
@pytest.mark.parametrize("zeros", [0.0, 0.003, 0.5, 1.0])
def test_any_body_survives_and_its_stuffing_has_no_zero(length: int, zeros: float) -> None:
    chance = np.random.default_rng(length)
    values = np.where(chance.random(length) < zeros, 0, chance.integers(1, 256, length))
    body = values.astype(np.uint8).tobytes()
    stuffed = cobs.encode(body)
    assert 0 not in stuffed
    assert len(stuffed) <= length + length // 254 + 1
    assert cobs.decode(stuffed) == body


@pytest.mark.parametrize("wrong", [b"", b"\x05\x11", b"\x02", b"\x03\x11\0", b"\xff\x01"])
def test_what_is_no_stuffing_is_refused(wrong: bytes) -> None:
    assert cobs.decode(wrong) is None
