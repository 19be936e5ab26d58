# SPDX-License-Identifier: MIT
"""The Python form of a struct of the C library: its members are annotated, once for mypy and C."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, TypeVar, get_args, get_type_hints

from pelorus.wire import schema
from pelorus.wire.reason import Reason

S = TypeVar("S", bound="Struct")

# A member's type in Python, and in C.
U8 = Annotated[int, c.c_uint8]
U16 = Annotated[int, c.c_uint16]
U32 = Annotated[int, c.c_uint32]
U64 = Annotated[int, c.c_uint64]
Int = Annotated[int, c.c_int]
Bool = Annotated[bool, c.c_bool]
F32 = Annotated[float, c.c_float]
F64 = Annotated[float, c.c_double]
Text = Annotated[bytes, c.c_char_p]
Address = Annotated[int | None, c.c_void_p]
Reasons = Annotated[Reason, c.c_uint32]
Floats6 = Annotated[c.Array[c.c_float], c.c_float * 6]
Doubles3 = Annotated[c.Array[c.c_double], c.c_double * 3]
Doubles8 = Annotated[c.Array[c.c_double], c.c_double * 8]
Doubles9 = Annotated[c.Array[c.c_double], c.c_double * 9]


class Struct(c.Structure):
    """A struct of include/pelorus; its members are the header's, in their order."""

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


def of_header(c_name: str) -> Callable[[type[S]], type[S]]:
    """Returns a decorator for a struct of this name in C, which lays out its annotated members."""

    def laid_out(struct: type[S]) -> type[S]:
        struct.c_name = c_name
        hints = get_type_hints(struct, include_extras=True)
        members = {name: hint for name, hint in hints.items() if name != "c_name"}
        if members:
            struct._fields_ = [
                (name, (hint, *get_args(hint))[-1]) for name, hint in members.items()
            ]
        if "reasons" in members:
            bits: Any = vars(struct)["reasons"]  # the library's number stays
            setattr(struct, "reasons", property(lambda own: Reason(bits.__get__(own))))  # noqa: B010
        return struct

    return laid_out
