# SPDX-License-Identifier: MIT
"""What include/pelorus/settings.h says first above each field of plr_config (name, unit, limits and
default), from the table src/record/settings.def."""

from __future__ import annotations

import re
from collections.abc import Iterator

# A row: id, name, unit, about, kind, words, minimum, maximum, default, field, storage.
ROW = re.compile(
    r'^SETTING\((\d+), "([^"]*)", "([^"]*)", "[^"]*", (\w+), (\w+), '
    r"([^,]+), ([^,]+), ([^,]+), ([^,]+), \w+\)$",
    re.MULTILINE,
)
# The first line of a field's comment, the rest of the comment, and the field.
FIELD = re.compile(
    r"/\* Setting ([a-z0-9-]+)([^\n]*?)\."
    r"(?= \*/\n|\n)((?: \*/)?\n(?:     \*[^\n]*\n)*    \w+ (\w+))"
)
MEMBER = re.compile(r"^    (?:uint8_t|uint16_t|double) (\w+)(?:\[3\])?;", re.MULTILINE)
# How the header words what is an expression in the table.
WORDS = {
    "PLR_MAX_LANDMARKS < 100 ? PLR_MAX_LANDMARKS : 100": "100 or PLR_MAX_LANDMARKS, the smaller",
}
ENUM = re.compile(r"one of plr_\w+")


def rows_of(table: str) -> dict[str, tuple[str, str]]:
    """Returns of each setting the field, and its line without the name."""
    rows = {}
    for _, name, unit, kind, _, low, high, standard, field in ROW.findall(table):
        allowed = {"SWITCH": "0 or 1", "CHOICE": "one of"}.get(kind, f"{low} to {high}")
        line = f" [{unit}]" if unit else ""
        rows[name] = field, f"{line}: {allowed}, default {WORDS.get(standard, standard)}"
    return rows


def header_from(table: str, header: str) -> str:
    """Returns the header as it should be."""
    rows = rows_of(table)

    def line(found: re.Match[str]) -> str:
        name, said, rest, _ = found.groups()
        if name not in rows:
            return found[0]
        enum = ENUM.search(said)  # the table does not know which
        expected = rows[name][1].replace("one of", enum[0] if enum else "one of")
        return f"/* Setting {name}{expected}.{rest}"

    return FIELD.sub(line, header)


def faults_of(table: str, header: str) -> Iterator[str]:
    """A sentence for each setting or field that lacks the other."""
    rows = rows_of(table)
    struct = header[header.index("typedef struct plr_config {") : header.index("} plr_config;")]
    said = {name: field for name, _, _, field in FIELD.findall(struct)}
    if len(rows) != table.count("\nSETTING("):
        yield "a row of settings.def does not have the form that this test reads"
    for name, (field, line) in rows.items():
        whole = re.sub(r"-[yz]$", "", name)
        if said.get(whole) != field.partition("[")[0]:
            yield f"setting {name}: above plr_config.{field} must stand `Setting {whole}: ...`"
        elif line != rows[whole][1]:
            yield f"setting {name} has other limits than {whole}"
    for field in set(MEMBER.findall(struct)) - set(said.values()):
        yield f"plr_config.{field} has no comment that begins with `Setting`"
    for name in said.keys() - rows.keys():
        yield f"setting {name} is not in the table"
