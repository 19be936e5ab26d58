# SPDX-License-Identifier: MIT
"""Settings of the simulation: fields of a dataclass that describe themselves.

A field's help, unit and limits stand beside its default. The command makes its options from them,
and `check` refuses what is beyond the limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError

UNITS = (  # an option's name has none
    *("_s", "_ns", "_hz", "_mps", "_mps2", "_radps", "_rad", "_px", "_m", "_percent", "_deg"),
)
Numbers = tuple[float, ...]  # an option of several numbers, separated by commas


class Rule(NamedTuple):
    """A limit of a number: as a test, and in words."""

    holds: Callable[[float], bool]
    expected: str


POSITIVE = Rule(lambda x: 0 < x < math.inf, "a positive number")
NOT_NEGATIVE = Rule(lambda x: 0 <= x < math.inf, "a finite number, not negative")
FINITE = Rule(math.isfinite, "a finite number")
SHARE = Rule(lambda x: 0 <= x <= 1, "a fraction from 0 to 1")
BELOW_ONE = Rule(lambda x: 0 <= x < 1, "a fraction from 0 to below 1")
AT_LEAST_ONE = Rule(lambda x: x >= 1, "at least 1")
PERCENT = Rule(lambda x: -50 <= x <= 50, "a number of percent from -50 to 50")
DEGREES = Rule(lambda x: -20 <= x <= 20, "a number of degrees from -20 to 20")
TIME = Rule(lambda x: 0 <= x < math.inf, "a number of seconds, not negative")


class OptionField(NamedTuple):
    """The description of a field."""

    help: str
    unit: str | None
    rule: Rule | None


@dataclass(frozen=True)
class Span:
    """A part of the drive: its beginning and its length; 0: to the end."""

    from_s: float = 0.0
    for_s: float = 0.0

    def holds(self, t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        t_s = np.asarray(t_ns, np.float64) * 1e-9
        end_s = self.from_s + self.for_s if self.for_s else np.inf
        return np.asarray((t_s >= self.from_s) & (t_s < end_s))


def setting(
    default: Any, help: str, unit: str | None = None, rule: Rule | None = NOT_NEGATIVE
) -> Any:
    """Declares a field that can be chosen on the command line.

    A Span becomes two options, -from and -for; without a default of its own its mishap does not
    happen unless its beginning is given.
    """
    return field(default=default, metadata={"setting": OptionField(help, unit, rule)})


def settings_of(given: Any) -> dict[str, OptionField]:
    """Returns the settings of a dataclass or its instance, by the field's name."""
    return {f.name: f.metadata["setting"] for f in fields(given) if "setting" in f.metadata}


def option_name(name: str) -> str:
    """Returns the option of a field: duration_s is --duration, slip_span --slip-from, -for."""
    for unit in (*UNITS, "_span"):
        name = name.removesuffix(unit)
    return "--" + name.replace("_", "-")


def require(name: str, value: object, good: bool, expected: str) -> None:
    """Refuses a value by its option's name, unless it is good."""
    if not good:
        shown = ",".join(f"{x:g}" for x in value) if isinstance(value, tuple) else value
        raise PelorusError(f"{option_name(name)} is {shown}: {expected} is expected")


def check(given: Any, prefix: str = "") -> None:
    """Refuses the first field that is beyond its limits; options' names begin with the prefix."""
    for name, about in settings_of(given).items():
        value = getattr(given, name)
        if isinstance(value, Span):
            for end, time_s in (("from", value.from_s), ("for", value.for_s)):
                stem = name.removesuffix("_span")
                require(f"{stem}_{end}", time_s, TIME.holds(time_s), TIME.expected)
        elif about.rule is not None and value is not None:
            require(prefix + name, value, about.rule.holds(value), about.rule.expected)
