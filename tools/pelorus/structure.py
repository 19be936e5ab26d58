# SPDX-License-Identifier: MIT
"""How a struct of the library in C shows itself in Python."""

from __future__ import annotations

import ctypes as c
from typing import Any, ClassVar, TypeVar

from pelorus import schema
from pelorus.reason import Reason

S = TypeVar("S", bound=c.Structure)


class Struct(c.Structure):
    """One of include/pelorus; its `_fields_` are the header's, in their order."""

    c_name: ClassVar[str]

    def __repr__(self) -> str:
        names = (field[0] for field in self._fields_)
        told = (f"{name}={_told(name, getattr(self, name))}" for name in names)
        return f"{type(self).__name__}({', '.join(told)})"


def _told(name: str, value: Any) -> str:
    """A member, as a struct shows itself."""
    if name == "health":
        return schema.HEALTHS.get(value, str(value))
    if isinstance(value, Reason):
        return str(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return repr(list(value)) if isinstance(value, c.Array) else repr(value)


def with_reasons(struct: type[S]) -> type[S]:
    """The class, with `reasons` a Reason; the library's number stays where it is."""
    bits: Any = vars(struct)["reasons"]
    setattr(struct, "reasons", property(lambda own: Reason(bits.__get__(own))))  # noqa: B010
    return struct
