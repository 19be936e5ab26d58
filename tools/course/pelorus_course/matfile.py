# SPDX-License-Identifier: MIT
"""The numeric arrays of a MATLAB file of version 5 to 7, out of its bytes.

After MathWorks, "MAT-File Format" (level 5). A file is a header of 128 bytes, then elements: a type
and a length of 4 bytes each, the data, and padding to 8 bytes. An array is an element of elements:
flags with its class, dimensions, name, and the numbers in whatever type takes least room. All
lengths come from the file, so each is held against what is there: scipy's reader does not, and
ends the program on some damaged files.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

HEADER_BYTES = 128
HDF5_MAGIC = b"\x89HDF"
LEVEL_5, LEVEL_7_3 = 0x0100, 0x0200

MATRIX, COMPRESSED, INT32, UINT32 = 14, 15, 5, 6
NUMBERS = {
    **{1: "i1", 2: "u1", 3: "i2", 4: "u2", INT32: "i4", UINT32: "u4"},
    **{7: "f4", 9: "f8", 12: "i8", 13: "u8"},
}
NUMERIC_CLASSES = range(6, 16)  # double, single, and the integers
COMPLEX = 0x0800
OTHER_CLASSES = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse"}


class BrokenMatFile(ValueError):
    """Says what is wrong in the bytes."""


class Element(NamedTuple):
    """A piece of a file: its type and its data."""

    type: int
    data: bytes


def is_hdf5(content: bytes) -> bool:
    """Returns whether these are the bytes of version 7.3, which is another format."""
    if HDF5_MAGIC in content[:1024]:
        return True
    return len(content) >= HEADER_BYTES and content[124:126] == struct.pack("<H", LEVEL_7_3)


def arrays(content: bytes, most: int) -> dict[str, NDArray[np.generic]]:
    """Returns arrays by name, column-major as MATLAB has them, `most` unpacked bytes at most.

    An array without numbers becomes its class's name.
    """
    order = _byte_order(content)
    found: dict[str, NDArray[np.generic]] = {}
    for element in _elements(content[HEADER_BYTES:], order):
        if element.type == COMPRESSED:
            whole = _unpacked(element.data, most)
            most -= len(whole)
            inner = list(_elements(whole, order))
        else:
            inner = [element]
        for matrix in inner:
            if matrix.type == MATRIX:
                name, array = _array(matrix.data, order)
                found[name] = array
    return found


def _byte_order(content: bytes) -> str:
    if len(content) < HEADER_BYTES:
        raise BrokenMatFile(f"{len(content)} bytes, the header alone has {HEADER_BYTES}")
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None or struct.unpack(order + "H", content[124:126])[0] != LEVEL_5:
        raise BrokenMatFile("the header is not that of a MATLAB file of version 5 to 7")
    return order


def _elements(data: bytes, order: str) -> Iterator[Element]:
    at = 0
    while at < len(data):
        if at + 8 > len(data):
            raise BrokenMatFile("an element is cut off")
        kind, size = struct.unpack_from(order + "II", data, at)
        if kind >> 16:  # a small one: type, length and data in 8 bytes
            kind, size, begin, behind = kind & 0xFFFF, kind >> 16, at + 4, at + 8
        else:
            begin = at + 8
            behind = begin + size + (0 if kind == COMPRESSED else -size % 8)
        end = begin + size
        if end > len(data) or end > behind:
            raise BrokenMatFile(f"an element of {size} bytes goes beyond what is there")
        yield Element(kind, data[begin:end])
        at = behind


def _unpacked(packed: bytes, most: int) -> bytes:
    stream = zlib.decompressobj()
    try:
        whole = stream.decompress(packed, max(most, 1))
    except zlib.error as error:
        raise BrokenMatFile(f"a packed array is damaged: {error}") from None
    if not stream.eof:
        raise BrokenMatFile(
            f"a packed array is cut off, or has more than {most} bytes, which are expected at most"
        )
    return whole


def _array(data: bytes, order: str) -> tuple[str, NDArray[np.generic]]:
    parts = list(_elements(data, order))
    if len(parts) < 3 or parts[0].type != UINT32 or parts[1].type != INT32:
        raise BrokenMatFile("an array lacks its flags, dimensions or name")
    flags, shape = parts[0].data, tuple(_numbers(parts[1], order).tolist())
    if len(flags) != 8 or min(shape, default=-1) < 0:
        raise BrokenMatFile("an array has flags or dimensions that cannot be")
    name = parts[2].data.decode("ascii", errors="replace")
    word = struct.unpack_from(order + "I", flags)[0]
    if word & 0xFF not in NUMERIC_CLASSES or word & COMPLEX:
        return name, np.array(OTHER_CLASSES.get(word & 0xFF, "complex"))
    numbers = _numbers(parts[3], order) if len(parts) > 3 else np.empty(0)
    if len(numbers) != math.prod(shape):
        raise BrokenMatFile(f"{name} has {len(numbers)} numbers for the shape {shape}")
    return name, numbers.reshape(shape, order="F")


def _numbers(element: Element, order: str) -> NDArray[np.generic]:
    if element.type not in NUMBERS:
        raise BrokenMatFile(f"numbers of the unknown type {element.type}")
    dtype = np.dtype(order + NUMBERS[element.type])
    if len(element.data) % dtype.itemsize:
        raise BrokenMatFile("a number is cut off")
    return np.frombuffer(element.data, dtype)
