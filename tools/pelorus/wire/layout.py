# SPDX-License-Identifier: MIT
"""The bytes of a payload, from a table of fields (`pelorus.wire.schema`)."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import accumulate, groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pelorus.wire.schema import Field, MessageTable

Floats = NDArray[np.float64]
CODES = {
    **{"u8": "<B", "u16": "<H", "u32": "<I", "u64": "<Q", "i8": "<b"},
    **{"f32": "<f", "f64": "<d"},
}
FLOATS = ("f32", "f64", "real")


class MalformedPayload(ValueError):
    """A payload that is shorter than its kind needs, or whose counts do not fit it."""


def need(payload: bytes, size: int) -> None:
    """Refuses a payload shorter than `size` bytes."""
    if len(payload) < size:
        raise MalformedPayload(f"payload of {len(payload)} bytes, at least {size} are expected")


def within(name: str, value: int, least: int, most: int) -> int:
    """Returns the value; raises MalformedPayload if the format does not allow it."""
    if not least <= value <= most:
        raise MalformedPayload(f"{name} is {value}, {least} to {most} are defined")
    return value


class _Run:
    """Successive fields of one version, without a text among them."""

    def __init__(self, fields: list[Field]) -> None:
        self.fields = fields
        self.since = fields[0].since
        self.is_text = fields[0].type == "text"
        self._sizes = (4, 8) if fields[0].type == "real" else (0,)  # of a real
        self._structs = {} if self.is_text else {n: _struct(fields, n) for n in self._sizes}
        self._shapes = [_shape(field) for field in fields]
        ends = accumulate(field.count for field in fields)
        self._places = [
            (f, shape, end - f.count, end)
            for f, shape, end in zip(fields, self._shapes, ends, strict=True)
        ]
        self._names = [field.name for field in fields]
        self._numbers = all(not shape for shape in self._shapes)
        self._limited = [f for f in fields if _shape(f) == () and (f.values or f.least is not None)]

    def pack(self, values: Mapping[str, Any]) -> bytes:
        return self._struct_for(values).pack(*self._flat(values))

    def _struct_for(self, values: Mapping[str, Any]) -> struct.Struct:
        return self._structs[values["real_bytes"] if len(self._sizes) > 1 else 0]

    def _flat(self, values: Mapping[str, Any]) -> Iterator[Any]:
        for field, shape in zip(self.fields, self._shapes, strict=True):
            value: Any = 0 if field.name == "_" else values[field.name]
            if not shape:
                yield value
            elif field.type in FLOATS:
                array = np.asarray(value, np.float64)
                if array.shape != shape:
                    raise ValueError(
                        f"{field.name} is an array of shape {array.shape} where {shape} is expected"
                    )
                yield from array.ravel().tolist()
            else:
                yield from value

    def unpack(self, payload: bytes, at: int, values: dict[str, Any]) -> int:
        """Adds the fields to the values; returns where they end."""
        numbers = self._struct_for(values)
        need(payload, at + numbers.size)
        found = numbers.unpack_from(payload, at)
        if self._numbers:
            values.update(zip(self._names, found, strict=True))
        else:
            for field, shape, begin, end in self._places:
                if not shape:
                    values[field.name] = found[begin]
                elif field.type in FLOATS:
                    values[field.name] = np.array(found[begin:end]).reshape(shape)
                else:
                    values[field.name] = found[begin:end]
        for field in self._limited:
            _check(field, values[field.name])
        return at + numbers.size


class Layout:
    """The bytes of a payload, by its table in `pelorus.wire.schema`.

    Arrays become float64, and nine numbers a 3x3 matrix.
    """

    def __init__(self, table: MessageTable) -> None:
        self._name = table.name
        self._runs = [_Run(list(run)) for _, run in groupby(table.fields, _run_of)]

    def pack(self, values: Mapping[str, Any]) -> bytes:
        """Returns the bytes; raises ValueError where a value does not fit its field."""
        if len(self._runs) == 1 and not self._runs[0].is_text:  # of most messages
            return self._runs[0].pack(values)
        texts = {
            run.fields[0].name: self._text(run.fields[0], values)
            for run in self._runs
            if run.is_text
        }
        told = dict(values) | {f"{name}_bytes": len(text) for name, text in texts.items()}
        return b"".join(
            texts[run.fields[0].name] if run.is_text else run.pack(told) for run in self._runs
        )

    def _text(self, field: Field, values: Mapping[str, Any]) -> bytes:
        stored = str(values[field.name]).encode("utf-8")
        if field.most is not None and len(stored) > field.most:
            raise ValueError(
                f"{field.name} of {len(stored)} bytes, at most {field.most} fit a {self._name}"
            )
        return stored

    def unpack(self, payload: bytes) -> tuple[dict[str, Any], int]:
        """Returns values by name, and where they end.

        Raises MalformedPayload if there are too few bytes, or a value is not allowed. Fields that a
        later version added may be missing, in both.
        """
        values: dict[str, Any] = {}
        at, since = 0, 0
        for run in self._runs:
            if run.since > since and at == len(payload):
                break
            since = run.since
            if run.is_text:
                name = run.fields[0].name
                end = at + values.pop(f"{name}_bytes", len(payload) - at)
                need(payload, end)
                values[name] = payload[at:end].decode("utf-8", errors="replace")
                at = end
            else:
                at = run.unpack(payload, at, values)
        values.pop("_", None)
        return values, at


class Place:
    """The place of a field in a payload, to read it alone."""

    def __init__(self, field: Field, before: Sequence[Field]) -> None:
        self._structs = {n: _struct([field], n) for n in (4, 8)}
        self._at = {n: _struct(before, n).size for n in (4, 8)}
        self._field, self._shape = field, _shape(field)
        sizes = [f.name for f in before].index("real_bytes") if _has_real([*before, field]) else 0
        self._real_at = _struct(before[:sizes], 8).size if _has_real([*before, field]) else None

    def read(self, payload: bytes) -> Any:
        """Returns its value; None where the sender is older than the field."""
        real = 8 if self._real_at is None else payload[self._real_at]
        numbers, at = self._structs[real], self._at[real]
        if at + numbers.size > len(payload):
            return None
        found = numbers.unpack_from(payload, at)
        if not self._shape:
            return found[0]
        return np.array(found).reshape(self._shape) if self._field.type in FLOATS else found


def places(table: MessageTable) -> dict[str, Place]:
    """Returns the places of all fields of a payload without texts, by name."""
    fields = table.fields
    return {f.name: Place(f, fields[:k]) for k, f in enumerate(fields) if f.name != "_"}


def _has_real(fields: Sequence[Field]) -> bool:
    return any(field.type == "real" for field in fields)


def row_type(fields: Sequence[Field]) -> np.dtype[Any]:
    """Returns numpy's type of a row of a message, or of a message of single numbers."""
    names = (f"_{k}" if field.name == "_" else field.name for k, field in enumerate(fields))
    return np.dtype([(name, CODES[f.type]) for name, f in zip(names, fields, strict=True)])


def _run_of(field: Field) -> tuple[str, int]:
    """Returns the fields' run: earlier fields give the size of a real."""
    return (field.type if field.type in ("text", "real") else "", field.since)


def _struct(fields: Sequence[Field], real_bytes: int) -> struct.Struct:
    codes = CODES | {"real": CODES["f32" if real_bytes == 4 else "f64"]}
    return struct.Struct("<" + "".join(f"{f.count}{codes[f.type][-1]}" for f in fields))


def _shape(field: Field) -> tuple[int, ...]:
    return {1: (), 9: (3, 3)}.get(field.count, (field.count,))


def _check(field: Field, value: int) -> None:
    if field.least is not None and field.most is not None:
        within(field.name, value, field.least, field.most)
    if field.values and value not in field.values:
        allowed = " or ".join(map(str, field.values))
        raise MalformedPayload(f"{field.name} is {value}, {allowed} are defined")


# --- symmetric matrices: lower triangles, row by row ----------------------------------------------


def stacked(rows: Iterable[Floats], *shape: int) -> Floats:
    """Returns (n, *shape) from successive arrays, without keeping them."""
    return np.fromiter(rows, np.dtype((np.float64, shape)))


def unpack_symmetric(packed: Floats, size: int) -> Floats:
    """Unpacks (n, size (size + 1) / 2) to (n, size, size)."""
    out = np.zeros((len(packed), size, size))
    rows, columns = np.tril_indices(size)
    out[:, rows, columns] = packed
    out[:, columns, rows] = packed
    return out


def pack_symmetric(whole: Floats) -> Floats:
    """Packs (..., size, size) to (..., size (size + 1) / 2)."""
    rows, columns = np.tril_indices(whole.shape[-1])
    return np.asarray(whole[..., rows, columns])
