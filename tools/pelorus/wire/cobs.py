# SPDX-License-Identifier: MIT
"""Consistent Overhead Byte Stuffing (Cheshire and Baker, 1999): no zero inside a frame."""

from itertools import chain

BLOCK_MAX = 254  # data bytes after a code byte; the code 0xFF stands for a full block


_CODE = [bytes((length,)) for length in range(256)]
_CODE_OF_RUN = _CODE[1:]


def encode(body: bytes) -> bytes:
    """Stuffs `body`; the result has no zero byte. The delimiter is not appended.

    A full block at the very end gets no empty block after it; `decode` accepts both forms.
    """
    runs = body.split(b"\0")
    lengths = list(map(len, runs))
    if max(lengths) < BLOCK_MAX:  # as in most frames: without a loop in Python
        codes = map(_CODE_OF_RUN.__getitem__, lengths)
        return b"".join(chain.from_iterable(zip(codes, runs, strict=True)))
    out: list[bytes] = []
    last = len(runs) - 1
    for number, run in enumerate(runs):
        if len(run) < BLOCK_MAX:
            out += _CODE[len(run) + 1], run
            continue
        for start in range(0, len(run), BLOCK_MAX):
            block = run[start : start + BLOCK_MAX]
            out += _CODE[len(block) + 1], block
        if len(block) == BLOCK_MAX and number < last:
            out.append(_CODE[1])
    return b"".join(out)


def decode(stuffed: bytes) -> bytes | None:
    """Undoes `encode`; None if `stuffed` is not valid COBS (a zero, or a block past the end)."""
    if not stuffed or 0 in stuffed:
        return None
    out = bytearray(stuffed)  # each block's code becomes the zero before the block
    behind_full = []
    at, end = 0, len(stuffed)
    while at < end:
        code = out[at]
        out[at] = 0
        at += code
        if code == 0xFF and at < end:
            behind_full.append(at)
    if at > end:
        return None
    for no_zero in reversed(behind_full):
        del out[no_zero]
    return bytes(out[1:])
