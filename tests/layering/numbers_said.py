#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares numbers that have to stand in several places, in code that cannot share them or in the
docs, with the place that they come from: versions, sizes, counts, limits and defaults.

usage: numbers_said.py PROJECT_ROOT

Prints every number that differs, or is not found any more. Exit status 1 if there is any.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

WORDS = {"three": 3, "eleven": 11, "thirteen": 13}
BYTES = {"U32": 4, "U64": 8}

# What a pattern found, as what it says; a place says one thing, or each of its lines says the same.
Said = str | float
Reading = Callable[[list[str]], list[Said]]
Place = tuple[str, str] | tuple[str, str, Reading]


def number(text: str) -> Said:
    """Returns the number that a text or a word stands for; else the text."""
    try:
        return float(WORDS.get(text, text))
    except ValueError:
        return text


def each(found: list[str]) -> list[Said]:
    """Returns what each of them says."""
    return [number(text) for text in found]


def times(factor: float) -> Reading:
    """Returns a reading of numbers in another unit."""
    return lambda found: [round(float(text) * factor, 9) for text in found]


def count(found: list[str]) -> list[Said]:
    """Returns how many there are."""
    return [float(len(found))]


def total(found: list[str]) -> list[Said]:
    """Returns the sum of all numbers in the texts."""
    return [sum(float(text) for text in re.findall(r"\d+", " ".join(found)))]


def total_bytes(found: list[str]) -> list[Said]:
    """Returns the bytes of all fields of those types."""
    return [float(sum(BYTES[text] for text in found))]


def kilobytes(found: list[str]) -> list[Said]:
    """Returns bytes in units of 1024, rounded."""
    return [float(round(float(text) / 1024)) for text in found]


def hexadecimal_version(found: list[str]) -> list[Said]:
    """Returns 0x000100 as 0.1.0."""
    return [".".join(str(int(text[i : i + 2], 16)) for i in (0, 2, 4)) for text in found]


CONFIG = "include/pelorus/config.h"
PARTS = "include/pelorus/session_parts.h"
SETTINGS = "src/record/settings.def"
LIMITS = "src/session/limits.def"
FILTER = "include/pelorus/filter.h"
STATE = "docs/STATE-FORMAT.md"
PORTING = "docs/PORTING.md"
SIZES = "docs/SIZES.md"
TABLE_VERSION = r"version.*version of this table, (\d+)"

# Of each number the place that it comes from, then the others.
NUMBERS: dict[str, list[Place]] = {
    "version": [
        ("CMakeLists.txt", r"project\(pelorus VERSION ([0-9.]+)"),
        (CONFIG, r"#define PLR_VERSION_NUMBER 0x(\d{6})", hexadecimal_version),
        ("library.json", r'"version": "([0-9.]+)"'),
        ("idf_component.yml", r'version: "([0-9.]+)"'),
        ("conanfile.py", r'version = "([0-9.]+)"'),
        ("src/record/words.c", r'plr_version\(void\) {\s*return "([0-9.]+)"'),
        ("tools/pelorus/__init__.py", r'__version__ = "([0-9.]+)"'),
    ],
    "arithmetic": [
        (CONFIG, r"#define PLR_ARITHMETIC (\d+)"),
        ("tools/pelorus/__init__.py", r"ARITHMETIC = (\d+)"),
    ],
    "version of the saved state": [
        ("src/filter/snapshot.c", r"STATE_VERSION = (\d+)"),
        ("src/filter/snapshot.def", TABLE_VERSION),
        (STATE, r"`PLRF`.*\n.*version of this table, (\d+)"),
    ],
    "version of a slot": [
        ("src/session/state_store.c", r"STORE_VERSION = (\d+)"),
        ("src/session/slot.def", TABLE_VERSION),
        (STATE, r"`PLRS`.*\n.*version of this table, (\d+)"),
    ],
    "bytes of a slot's header": [
        ("src/session/slot.def", r"^FIELD\(\w+, +(\w+)", total_bytes),
        ("include/pelorus/state_store.h", r"PLR_STORE_HEADER = (\d+)"),
    ],
    "settings": [
        (SETTINGS, r"^SETTING\((\d+)", count),
        (STATE, r"S settings \((\d+) in this version\)"),
    ],
    "rows of the state with biases": [
        (CONFIG, r"PLR_(?:POSE|BIAS)_DIM = (\d+)", total),
        (STATE, r"with biases (\d+)"),
        (SIZES, r"\((\d+) \+ 3 N with twists"),
    ],
    "rows of the state with an IMU": [
        (CONFIG, r"PLR_(?:POSE|BIAS|VELOCITY)_DIM = (\d+)", total),
        (STATE, r"with biases \d+, with an IMU (\d+)"),
        (SIZES, r"(\d+) \+ 3 N with an IMU"),
    ],
    "steps that wait": [
        (PARTS, r"PLR_SESSION_HELD_TWISTS = (\d+)"),
        (PORTING, r"holds (\d+) readings \(`PLR_SESSION_HELD_TWISTS`\)"),
        (PORTING, r"(\d+) ms at 400 Hz", times(0.4)),
        (PORTING, r"(\d+) ms at 1 kHz"),
    ],
    "frames that wait": [
        (PARTS, r"PLR_SESSION_HELD_FRAMES = (\d+)"),
        (PORTING, r"Up to (\w+)\s+frames wait \(`PLR_SESSION_HELD_FRAMES`\)"),
    ],
    "messages that agree about a clock": [
        (PARTS, r"PLR_SESSION_AGREEING = (\d+)"),
        ("src/session/reanchor.c", r"; (\w+) messages agree"),
    ],
    "observations processed at once": [
        (CONFIG, r"#define PLR_BLOCK_OBSERVATIONS (\d+)"),
        ("docs/MATH.md", r"`PLR_BLOCK_OBSERVATIONS` \((\d+)\)"),
        (SIZES, r"blocks of (\d+),"),
    ],
    "observations of a frame": [
        (CONFIG, r"#define PLR_MAX_OBSERVATIONS (\d+)"),
        (PORTING, r"(\d+)\s+observations a frame \(`PLR_MAX_OBSERVATIONS`"),
        (SIZES, r"at most (\d+) observations a frame"),
    ],
    "numbers of the calibration that can be estimated": [
        (CONFIG, r"#define PLR_MAX_CALIBRATION (\d+)"),
        (PORTING, r"\(setting `calibrate`\): (\d+) by default"),
    ],
    "numbers of the calibration": [
        ("src/record/settings.c", r"part_numbers\[\] = {([\d, ]+)}", total),
        ("src/record/settings.c", r"up to (\d+)\"}"),
        (CONFIG, r"\(setting calibrate\): 0 to (\d+)"),
        (PORTING, r"with all (\w+) 5\.2 KB"),
    ],
    "KB of a filter of 16 landmarks": [
        (SIZES, r"^\| stm32f405 \| 16 \| \d+ \| \d+ \| (\d+)(?: \| \d+){3} \|$", kilobytes),
        (CONFIG, r"(\d+) KB\s+\* for 16 landmarks"),
        ("README.md", r"(\d+) KB for 16 landmarks"),
    ],
    "KB of a filter of 32 landmarks": [
        (SIZES, r"^\| stm32f405 \| 32 \| \d+ \| \d+ \| (\d+)(?: \| \d+){3} \|$", kilobytes),
        (CONFIG, r"for 16 landmarks, (\d+) KB for 32"),
        ("README.md", r"for 16 landmarks, (\d+) KB for 32"),
    ],
    "most metres of a position": [
        (LIMITS, r"LIMIT\(POSITION, +([\d.e]+)"),
        (FILTER, r"beyond ([\d.e]+) m or a variance"),
    ],
    "most of a variance": [
        (LIMITS, r"LIMIT\(VARIANCE, +([\d.e]+)"),
        (FILTER, r"variance(?: beyond|\s+\* of| of) (1e\d+)"),
    ],
    "most seconds of twist-delay": [
        (SETTINGS, r'"twist-delay".*NUMBER, NULL, 0, ([\d.e]+),'),
        ("tools/pelorus/io/arrivals.py", r"WAIT_MAX_NS = ([\d_]+)", times(1e-9)),
    ],
    "default of max-gap": [
        (SETTINGS, r'"max-gap".*NULL, [\d.e-]+, [\d.e-]+, ([\d.e-]+),'),
        ("docs/TESTING.md", r"`max-gap` 30 \(([\d.]+) by default\)"),
    ],
    "rejected landmarks of EVIDENCE": [
        ("include/pelorus/types.h", r"PLR_SUPERVISION_REJECTED = (\d+)"),
        ("tools/pelorus/native/binding.py", r"REJECTED = (\d+)"),
    ],
    "lines of a file": [
        ("tests/layering/shape.py", r"LONGEST_FILE = (\d+)"),
        ("CONTRIBUTING.md", r"files of more than (\d+)"),
        ("docs/DESIGN.md", r"no file is longer than (\d+) lines"),
    ],
    "lines of a function": [
        ("tests/layering/shape.py", r"LONGEST_FUNCTION = (\d+)"),
        ("CONTRIBUTING.md", r"functions of more than (\d+) lines"),
        ("docs/DESIGN.md", r"lines and no function than (\d+)"),
    ],
    "Python": [
        ("pyproject.toml", r'requires-python = ">=([\d.]+)"'),
        ("tools/pyproject.toml", r'python_version = "([\d.]+)"'),
        ("tools/setup.sh", r"is too old: ([\d.]+) or later"),
        ("docs/INSTALL.md", r"every version from ([\d.]+) on"),
    ],
    "CMake": [
        ("CMakeLists.txt", r"cmake_minimum_required\(VERSION ([\d.]+)\)"),
        ("port/cortex_m/CMakeLists.txt", r"cmake_minimum_required\(VERSION ([\d.]+)\)"),
        (
            "CMakePresets.json",
            r'"major": (\d+, "minor": \d+)',
            lambda f: each([re.sub(r"\D+", ".", f[0])]),
        ),
    ],
}
# In config.h: what the comment says is the default, and what is.
DEFAULT = re.compile(
    r"/\*((?:(?!\*/).)*?)\*/\n#ifndef (PLR_\w+)\n#define \2 (\d+)\n#endif", re.DOTALL
)
SAID_DEFAULT = re.compile(r"default\s+(?:\* )?(\d+)|(\d+) \(default\)")


def said_at(root: Path, place: Place) -> list[Said]:
    """Returns what is said there; nothing if the pattern does not fit any more."""
    file, pattern, *reading = place
    found = re.findall(pattern, (root / file).read_text(encoding="utf-8"), re.MULTILINE)
    return (reading[0] if reading else each)(found) if found else []


def differences(root: Path) -> Iterator[str]:
    """A sentence for each place that does not say what the first one says."""
    for name, places in NUMBERS.items():
        expected = said_at(root, places[0])
        if len(set(expected)) != 1:
            yield f"{places[0][0]}: {name}: found {expected or 'nothing'}, expected one number"
            continue
        for place in places[1:]:
            found = said_at(root, place)
            if set(found) != set(expected):
                says = ", ".join(map(str, found)) or "nothing that its pattern finds"
                yield f"{place[0]}: {name}: says {says}; {places[0][0]} has {expected[0]}"


def wrong_defaults(root: Path) -> Iterator[str]:
    """A sentence for each macro of config.h whose comment has another default, or none."""
    found = DEFAULT.findall((root / CONFIG).read_text(encoding="utf-8"))
    if not found:
        yield f"{CONFIG}: no default is found any more"
    for comment, name, value in found:
        said = SAID_DEFAULT.search(comment)
        if said and value not in said.groups():
            yield f"{CONFIG}: {name} is {value}, its comment says {said[0]}"


def main() -> int:
    """Compares them; the exit status."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    root = Path(sys.argv[1])
    faults = [*differences(root), *wrong_defaults(root)]
    for fault in faults:
        print(fault)
    print(f"{len(NUMBERS)} numbers, {sum(map(len, NUMBERS.values()))} places, {len(faults)} differ")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
