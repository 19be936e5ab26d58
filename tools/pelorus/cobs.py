# SPDX-License-Identifier: MIT
"""Consistent Overhead Byte Stuffing (Cheshire and Baker, 1999): no zero inside a frame."""

BLOCK_MAX = 254  # data bytes behind a code byte; the code 0xFF stands for a full block


def encode(body: bytes) -> bytes:
    """Stuff `body`; the result holds no zero byte. The delimiter is not appended.

    A full block at the very end gets no empty block behind it; `decode` takes both forms.
    """
    out = bytearray()
    runs = body.split(b"\0")
    last = len(runs) - 1
    for number, run in enumerate(runs):
        start = 0
        while len(run) - start >= BLOCK_MAX:
            out.append(0xFF)
            out += run[start : start + BLOCK_MAX]
            start += BLOCK_MAX
        ends_with_full_block = number == last and start > 0 and start == len(run)
        if not ends_with_full_block:
            out.append(len(run) - start + 1)
            out += run[start:]
    return bytes(out)


def decode(stuffed: bytes) -> bytes | None:
    """Undo `encode`; None if `stuffed` is not valid COBS (a zero, or a block past the end)."""
    if not stuffed or 0 in stuffed:
        return None
    out = bytearray()
    at, end = 0, len(stuffed)
    while at < end:
        code = stuffed[at]
        behind = at + code
        if behind > end:
            return None
        out += stuffed[at + 1 : behind]
        at = behind
        if code != 0xFF and at < end:
            out.append(0)
    return bytes(out)
