# SPDX-License-Identifier: MIT
"""The tables from which the library in C is built, as `pelorus-schema` prints them (tools/schema).

They are layouts of messages, settings, statuses, reasons and limits, none of which is repeated
here.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

_TABLES: dict[str, Any] = json.loads(files("pelorus").joinpath("schema.json").read_text("utf-8"))


@dataclass(frozen=True)
class Field:
    """Numbers of a payload, or a text; in the order of the bytes."""

    name: str
    type: str  # u8 to u64, i8, f32, f64; real: of 4 or 8 bytes; text
    count: int = 1
    since: int = 0  # minor version
    least: int | None = None
    most: int | None = None  # of a text its bytes
    values: Sequence[int] = ()  # only these are allowed, if any
    unit: str = ""
    about: str = ""


@dataclass(frozen=True)
class MessageTable:
    """A kind of frame; `rows` follow as often as the last number before them says, and behind all
    of them `columns` of them that a later version added, or none.
    """

    kind: int
    name: str
    fields: tuple[Field, ...]
    rows: tuple[Field, ...]
    columns: tuple[Field, ...]


@dataclass(frozen=True)
class Setting:
    """A row of the table of settings; `words` name the values of a choice."""

    name: str
    unit: str = ""
    words: tuple[str, ...] = ()
    is_list: bool = False  # some of the words, as bits
    of_axis: int = 0  # id of the setting for all axes that sets this one, too


def _message(row: dict[str, Any]) -> MessageTable:
    fields, rows, columns = (
        tuple(Field(**f) for f in row.get(key, ())) for key in ("fields", "rows", "columns")
    )
    return MessageTable(row["kind"], row["name"], fields, rows, columns)


def _setting(row: dict[str, Any]) -> Setting:
    words = tuple(row.get("words", ()))
    return Setting(row["name"], row["unit"], words, row.get("list", False), row.get("of_axis", 0))


def _words(of: str) -> dict[int, str]:
    return {row["number"]: row["words"] for row in _TABLES["words"] if row["of"] == of}


SENSORS: dict[str, int] = {  # the small ones, by name
    row["name"].lower(): int(row["number"]) for row in _TABLES["enums"] if row["of"] == "sensor"
}
LIMITS: dict[str, int] = _TABLES["limits"]
EYES_SPEED_SIGMA_MPS: float = _TABLES["limits"]["eyes_speed_sigma_mps"]
PLAUSIBLE: dict[str, float] = _TABLES["plausible"]  # a session refuses larger values
MESSAGES: dict[str, MessageTable] = {row["name"]: _message(row) for row in _TABLES["messages"]}
SETTINGS: dict[int, Setting] = {row["id"]: _setting(row) for row in _TABLES["settings"]}
DEFAULTS: dict[str, float] = {
    row["name"]: row["default"] for row in _TABLES["settings"] if "default" in row
}
STATUSES = _words("status")
HEALTHS = _words("health")
REASONS = _words("reason")
REASON_NAMES: dict[int, str] = {
    int(row["number"]): row["name"] for row in _TABLES["words"] if row["of"] == "reason"
}


def number(of: str, name: str) -> int:
    """Returns the number of a name: number("status", "CORRUPT") is -15."""
    return next(
        int(row["number"])
        for row in (*_TABLES["enums"], *_TABLES["words"])
        if (row["of"], row["name"]) == (of, name)
    )


def word_of(setting: str, value: float) -> str:
    """Returns the word of a choice's value: word_of("process", 1) is "imu"."""
    row = next(row for row in SETTINGS.values() if row.name == setting)
    return row.words[int(value)]


def kind(name: str) -> int:
    """Returns the number of a kind of message."""
    return MESSAGES[name].kind
