# SPDX-License-Identifier: MIT
"""The Python form of a struct of the C library."""

from __future__ import annotations

import ctypes as c
from typing import Any, ClassVar, TypeVar

from pelorus.wire import schema
from pelorus.wire.reason import Reason

S = TypeVar("S", bound=c.Structure)


class Struct(c.Structure):
    """A struct of include/pelorus; its `_fields_` are the header's, in their order."""

    c_name: ClassVar[str]

    def __repr__(self) -> str:
        names = (field[0] for field in self._fields_)
        members = (f"{name}={_member_words(name, getattr(self, name))}" for name in names)
        return f"{type(self).__name__}({', '.join(members)})"


def _member_words(name: str, value: Any) -> str:
    """Returns a member as in a struct's repr."""
    if name == "health":
        return schema.HEALTHS.get(value, str(value))
    if isinstance(value, Reason):
        return str(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return repr(list(value)) if isinstance(value, c.Array) else repr(value)


def with_reasons(struct: type[S]) -> type[S]:
    """Returns the class with `reasons` as a Reason; the library's number stays."""
    bits: Any = vars(struct)["reasons"]
    setattr(struct, "reasons", property(lambda own: Reason(bits.__get__(own))))  # noqa: B010
    return struct
