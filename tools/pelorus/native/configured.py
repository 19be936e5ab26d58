# SPDX-License-Identifier: MIT
"""The settings of a `pelorus.Filter`: a plr_config, by names, and that of a recording."""

from __future__ import annotations

import ctypes as c
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from itertools import takewhile

import numpy as np

from pelorus.errors import PelorusError
from pelorus.native import binding
from pelorus.native.arguments import checked
from pelorus.wire import schema
from pelorus.wire.frames import Config, Header, Landmark, Message, Role
from pelorus.wire.framing import encode
from pelorus.wire.message import DATA_KINDS
from pelorus.wire.settings import IDS

Value = float | bool | str
Named = Mapping[str, Value | Iterable[float]]


class Configured:
    """A plr_config: at first every setting at its default."""

    def __init__(self, library: binding.Library) -> None:
        self._c = library
        self.memory = c.create_string_buffer(library.size_of("plr_config"))
        self._c.config_default(self.memory)

    def set(self, name: str, value: Value | Iterable[float]) -> dict[int, float]:
        """Sets a number, a word, a list of words with commas, or three numbers for three axes.

        Returns what was set, by id; raises PelorusError that says what would be right.
        """
        if name not in IDS:
            raise PelorusError(f"config: {unknown(name)}; there are {', '.join(sorted(IDS))}")
        number = _number_of(name, value)
        if isinstance(number, tuple):
            axes = zip(("", "-y", "-z"), number, strict=True)
            return {k: v for axis, one in axes for k, v in self.set(f"{name}{axis}", one).items()}
        row = self._c.setting_by_name(name.encode())
        if self._c.config_set(self.memory, row, number) != 0:
            raise PelorusError(
                f"config: {name} {value}: {row[0].minimum:g} to {row[0].maximum:g} "
                f"{row[0].unit.decode()}".rstrip()
                + " are possible"
            )
        return {IDS[name]: number}

    def get(self, name: str) -> float:
        """Returns the value in force; of a choice its number."""
        if name not in IDS:
            raise PelorusError(unknown(name))
        return float(self._c.config_get(self.memory, self._c.setting_by_name(name.encode())))

    def check(self) -> None:
        """Raises PelorusError where one contradicts another, or the library's build options."""
        culprit = c.POINTER(binding.Setting)()
        why = self._c.config_why(self.memory, c.byref(culprit))
        if why is not None:
            raise PelorusError(f"config: {culprit[0].name.decode()}: {why.decode()}")


def unknown(name: str) -> str:
    """Returns that there is no such setting, with similar names."""
    near = get_close_matches(name.replace("_", "-"), IDS)
    return f"no setting {name}" + (f": is {' or '.join(near)} meant?" if near else "")


def of_recording(
    messages: Iterable[Message], config: Named, precision: binding.Precision
) -> tuple[Header, dict[str, float], dict[int, Landmark]]:
    """Returns HEADER, all settings as a replay has them, and the known landmarks.

    `config` overrides the recording's CONFIG, which overrides its HEADER's suggestions, which
    override the defaults.
    """
    before = list(takewhile(lambda m: m.kind not in DATA_KINDS, messages))
    header = next((m for m in before if isinstance(m, Header)), None)
    if header is None:
        raise PelorusError("messages: no HEADER comes before the data, so no camera is known")
    library = binding.library(precision)
    own = Configured(library)
    wanted: dict[int, float] = {}
    for given in (*_asked_for(before, library), *(own.set(*one) for one in config.items())):
        for id, value in given.items():
            wanted.pop(id, None)  # what is set later comes last: one axis, or all
            wanted[id] = value
    frames = encode(header, 0) + encode(Config(wanted), 1)
    composed, culprit = Configured(library), c.POINTER(binding.Setting)()
    status = library.binding_settings(composed.memory, frames, len(frames), c.byref(culprit))
    composed.check()
    if status != 0:
        raise PelorusError(f"messages: {library.text(status)}")
    known = {m.id: m for m in before if isinstance(m, Landmark) and m.role == Role.KNOWN}
    return header, {name: composed.get(name) for name in IDS}, known


def _asked_for(messages: Iterable[Message], library: binding.Library) -> Iterator[dict[int, float]]:
    """Yields what a recording's CONFIG sets; invalid values are ignored, as by a session."""
    scratch = Configured(library)
    for m in messages:
        if isinstance(m, Config) and not m.build_fingerprint:
            for id, value in m.settings.items():
                row = library.setting_by_id(id)
                if row and library.config_set(scratch.memory, row, value) == 0:
                    yield {id: value}


def _number_of(name: str, value: Value | Iterable[float]) -> float | tuple[float, float, float]:
    """Returns a setting's value as the library takes it: one number, or three for three axes."""
    if isinstance(value, str):
        return _of_text(name, value)
    if isinstance(value, bool | int | float | np.number):
        return float(value)
    numbers = tuple(float(one) for one in checked(f"config: {name}", np.asarray(value), (3,)))
    if f"{name}-y" not in IDS:
        raise PelorusError(f"config: {name} is one number, not three")
    return numbers[0], numbers[1], numbers[2]


def _of_text(name: str, value: str) -> float:
    """Returns a number as a settings file has it, the number of a choice, or the bits of a list."""
    setting = schema.SETTINGS[IDS[name]]
    if not setting.words:
        try:
            return float(value)
        except ValueError:
            raise PelorusError(f"config: {name} {value!r}: a number") from None
    asked = [] if setting.is_list and value == "off" else value.split(",")
    if set(asked) <= set(setting.words) and (setting.is_list or len(asked) == 1):
        numbers = [setting.words.index(word) for word in asked]
        return float(sum(1 << n for n in set(numbers)) if setting.is_list else numbers[0])
    expected = f"one of {', '.join(setting.words)}"
    if setting.is_list:
        expected = f"off, or some of {','.join(setting.words)} between commas"
    raise PelorusError(f"config: {name} {value!r}: {expected}")
