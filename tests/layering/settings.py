#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares what include/pelorus/settings.h says above each field of plr_config (name, unit, limits,
default) with the table src/record/settings.def, which is what the code accepts.

usage: settings.py PROJECT_ROOT
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, replace
from pathlib import Path

# A row: id, name, unit, about, kind, words, minimum, maximum, default, field, storage.
ROW = re.compile(
    r'^SETTING\((\d+), "([^"]*)", "([^"]*)", "[^"]*", (\w+), (\w+), '
    r"([^,]+), ([^,]+), ([^,]+), ([^,]+), \w+\)$",
    re.MULTILINE,
)
# The first line of a field's comment, the rest of the comment, and the field.
FIELD = re.compile(
    r"/\* Setting ([a-z0-9-]+)(?: \[([^\]]*)\])?: ([^\n]+?), default ([^\n]+?)\.(?: \*/)?\n"
    r"(?:     \*[^\n]*\n)*    \w+ (\w+)"
)
MEMBER = re.compile(r"^    (?:uint8_t|uint16_t|double) (\w+)(?:\[3\])?;", re.MULTILINE)
# How the header words what is an expression in the table.
WORDS = {
    "PLR_MAX_LANDMARKS < 100 ? PLR_MAX_LANDMARKS : 100": "100 or PLR_MAX_LANDMARKS, the smaller",
}
OF_AXIS = re.compile(r"(.*)-[yz]$")


@dataclass(frozen=True)
class Setting:
    """What is said of one setting."""

    name: str
    unit: str
    allowed: str
    standard: str
    field: str


def same_text(text: str) -> str:
    """A number in one spelling; anything else as it is."""
    try:
        return repr(float(text))
    except ValueError:
        return WORDS.get(text, text)


def from_table(source: str) -> list[Setting]:
    """The rows of the table; those of a single axis are named by their field."""
    settings = []
    for _, name, unit, kind, words, low, high, standard, field in ROW.findall(source):
        allowed = f"{same_text(low)} to {same_text(high)}"
        if kind == "SWITCH":
            allowed = "0 or 1"
        if kind == "CHOICE":
            allowed = f"one of {words}"
        settings.append(Setting(name, unit, allowed, same_text(standard), field))
    return settings


def from_header(header: str) -> list[Setting]:
    """The comments of plr_config."""
    settings = []
    for name, unit, allowed, standard, field in FIELD.findall(header):
        limits = " to ".join(same_text(limit) for limit in allowed.split(" to "))
        settings.append(Setting(name, unit, limits, same_text(standard), field))
    return settings


def differences(table: list[Setting], header: list[Setting]) -> list[str]:
    """A sentence for each contradiction."""
    texts = []
    said = {setting.name: setting for setting in header}
    for row in table:
        of_axis = OF_AXIS.match(row.name)
        name = of_axis.group(1) if of_axis else row.name
        found = said.get(name)
        if found is None:
            texts.append(
                f"setting {row.name} has no comment `Setting {name}...: LIMITS, default D.`"
            )
            continue
        expected = replace(row, name=name, field=row.field.partition("[")[0])
        if row.allowed.startswith("one of"):  # its words are in the table, its values in an enum
            expected = replace(expected, allowed=found.allowed)
        if found != expected:
            texts.append(f"setting {row.name}: the header says {found}, the table {expected}")
    for name in said.keys() - {row.name for row in table}:
        texts.append(f"setting {name} is not in the table")
    return texts


def main() -> int:
    """Compares; the exit status."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    root = Path(sys.argv[1]).resolve()
    source = (root / "src/record/settings.def").read_text(encoding="utf-8")
    text = (root / "include/pelorus/settings.h").read_text(encoding="utf-8")
    struct = text[text.index("typedef struct plr_config {") : text.index("} plr_config;")]
    table, header = from_table(source), from_header(struct)
    texts = differences(table, header)
    for field in MEMBER.findall(struct):
        if field not in {setting.field for setting in header}:
            texts.append(f"plr_config.{field} has no comment that begins with `Setting`")
    if len(table) != source.count("\nSETTING("):
        texts.append("a row of the table does not have the form that this test reads")
    for line in texts:
        print(line)
    print(f"{len(table)} rows, {len(header)} fields, {len(texts)} differences")
    return 1 if texts or not table or not header else 0


if __name__ == "__main__":
    sys.exit(main())
