#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Holds the sources against the rules of the design: who may include whom, and what must not occur.

usage: sources.py PROJECT_ROOT

Prints every breach as file:line: what, and what would be right. Exit status 1 if there is any.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# Folders of src/ that a folder of src/ may include, from the lowest room to the highest.
FOLDERS: dict[str, set[str]] = {
    "math": {"math"},
    "record": {"record"},
    "limits": {"limits"},
    "state": {"state", "math"},
    "process": {"process", "state", "limits", "math"},
    "sensor": {"sensor", "state", "math"},
    "supervise": {"supervise", "limits", "math"},
    "known_map": {"known_map", "sensor", "state", "math"},
    "vision": {"vision", "math"},
    "eyes": {"eyes", "math"},
    "filter": {
        "filter",
        "known_map",
        "supervise",
        "sensor",
        "process",
        "state",
        "record",
        "limits",
        "math",
    },
    "absent": {"supervise", "known_map"},
    "session": {"session", "filter", "record", "math"},
}
# The parts of the filter's memory; state.h puts them side by side.
PART_HEADERS = {
    "assertions.h",
    "config.h",
    "camera.h",
    "belief.h",
    "source.h",
    "workspace.h",
    "map.h",
    "types.h",
    "settings.h",
    "supervisor.h",
}
FILTER_HEADERS = PART_HEADERS | {"state.h", "filter.h", "pelorus.h"}
# The public headers that a folder of src/ may see.
HEADERS: dict[str, set[str]] = {
    "math": {"assertions.h", "config.h"},
    "record": FILTER_HEADERS | {"wire.h"},
    "limits": {"limits.def", "supervisor.h"},
    "state": PART_HEADERS,
    "process": PART_HEADERS,
    "sensor": PART_HEADERS,
    # The supervisor sees evidence, and no filter: neither its state nor its covariance.
    "supervise": {
        "assertions.h",
        "config.h",
        "settings.h",
        "supervisor.h",
        "types.h",
    },
    "known_map": PART_HEADERS,
    # Eyes see pictures, and no filter.
    "vision": {"assertions.h", "config.h", "rig.h", "types.h", "vision.h"},
    "eyes": {"assertions.h", "config.h", "eyes.h"},
    "absent": PART_HEADERS,
    "filter": FILTER_HEADERS,
    "session": FILTER_HEADERS
    | {"wire.h", "port.h", "session.h", "session_parts.h", "state_store.h", "eyes.h"},
}
# The files of src/session, from the lowest to the highest: each may include those above it here.
# The first ones are parts, which do not know the session that they are part of.
SESSION_PARTS = (
    "line",
    "plausible",
    "known_map",
    "queue",
    "budget",
    "layers",
    "phase",
    "state_store",
)
SESSION_FILES = (
    *(*SESSION_PARTS, "clock", "send", "reanchor", "start", "saving", "use", "events", "look"),
    "session",
)
# What a public header may include of its siblings: wire.h must stay free of the filter.
SIBLINGS: dict[str, set[str]] = {
    "assertions.h": set(),
    "config.h": set(),
    "types.h": set(),
    "camera.h": {"config.h"},
    "belief.h": {"config.h", "types.h"},
    "source.h": {"config.h", "types.h"},
    "workspace.h": {"config.h", "types.h"},
    "map.h": {"types.h"},
    "settings.h": {"config.h", "types.h"},
    "supervisor.h": {"config.h", "types.h", "limits.def"},
    "state.h": PART_HEADERS - {"assertions.h"},
    "filter.h": FILTER_HEADERS - {"filter.h", "pelorus.h"},
    "pelorus.h": FILTER_HEADERS - {"pelorus.h"},
    "rig.h": {"types.h"},
    "vision.h": {"config.h", "rig.h", "types.h"},
    "wire.h": {"rig.h", "types.h"},
    "eyes.h": {"vision.h", "wire.h"},
    "port.h": {"types.h"},
    "session_parts.h": {"config.h", "wire.h"},
    "session.h": FILTER_HEADERS | {"wire.h", "port.h", "session_parts.h", "state_store.h"},
    "state_store.h": {"filter.h", "port.h"},
}
# No heap, no stdio, no mathematics: what is left of the standard library.
STANDARD = {"float.h", "limits.h", "stdbool.h", "stddef.h", "stdint.h", "string.h"}
# The compiler's own functions for a processor's vectors: of integers, which no mathematics is in.
VECTORS = {"src/vision/kernels_mve.h": "arm_mve.h"}

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
CONDITION = re.compile(r"^\s*#\s*(if|ifdef|ifndef|elif)\b\s*(.*)")
TABLE_ROW = re.compile(r"^ {4}\[(?:PLR_KIND_)?(\w+)\]\s*= \{\{([A-Z, ]+)\}", re.MULTILINE)
SETS_PHASE = re.compile(r"(->|\.)phase\s*=[^=]")
COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)


@dataclass(frozen=True)
class Breach:
    """One line that breaks a rule."""

    path: Path
    line: int
    text: str


def without_comments(text: str) -> str:
    """The text with comments blanked, so that line numbers stay."""
    return COMMENT.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), text)


def code_lines(path: Path) -> Iterator[tuple[int, str]]:
    """(number, line) of every line, comments blanked."""
    yield from enumerate(without_comments(path.read_text(encoding="utf-8")).splitlines(), start=1)


def includes(path: Path) -> Iterator[tuple[int, bool, str]]:
    """(line, is it <...>, name) of every include."""
    for number, line in code_lines(path):
        if match := INCLUDE.match(line):
            yield number, match.group(1) == "<", match.group(2)


def check_include(root: Path, path: Path, number: int, system: bool, name: str) -> Iterator[Breach]:
    """An include of a file in src/."""
    folder = path.relative_to(root / "src").parts[0]
    first, _, rest = name.partition("/")
    if system:
        own = VECTORS.get(path.relative_to(root).as_posix())
        if name not in STANDARD and name != own:
            allowed = ", ".join(sorted(STANDARD))
            yield Breach(path, number, f"<{name}> is not for src/; only {allowed}")
    elif first == "pelorus":
        if rest not in HEADERS[folder]:
            allowed = ", ".join(sorted(HEADERS[folder]))
            yield Breach(path, number, f"src/{folder} may not see {name}; only {allowed}")
    elif not (root / "src" / name).is_file():
        yield Breach(path, number, f'"{name}" is not a file of src/: name it from there')
    elif first not in FOLDERS[folder]:
        allowed = ", ".join(sorted(FOLDERS[folder]))
        yield Breach(path, number, f"src/{folder} may not include src/{first}; only {allowed}")


def check_layers(root: Path) -> Iterator[Breach]:
    """Includes point one way."""
    for path in sorted((root / "src").rglob("*.[ch]")):
        if path.relative_to(root / "src").parts[0] not in FOLDERS:
            yield Breach(path, 1, f"a folder that the layering does not know: add it to {__file__}")
            continue
        for number, system, name in includes(path):
            yield from check_include(root, path, number, system, name)
    for path in sorted((root / "include").rglob("*.h")):
        for number, system, name in includes(path):
            if system and name not in STANDARD:
                yield Breach(path, number, f"<{name}> is not for a public header")
            if not system and name.removeprefix("pelorus/") not in SIBLINGS.get(path.name, set()):
                yield Breach(path, number, f'{path.name} may not include "{name}"')


def check_session(root: Path) -> Iterator[Breach]:
    """In src/session too includes point one way, and one function changes the phase."""
    rank = {name: index for index, name in enumerate(SESSION_FILES)}
    for path in sorted((root / "src" / "session").glob("*.[ch]")):
        if path.stem not in rank:
            yield Breach(path, 1, f"a file without a place: add it to SESSION_FILES in {__file__}")
            continue
        for number, _, name in includes(path):
            folder, _, file = name.partition("/")
            below = rank.get(Path(file).stem, len(rank)) < rank[path.stem]
            own = Path(file).stem == path.stem or file.endswith(".def")  # a table of its own
            if folder == "session" and not below and not own:
                yield Breach(path, number, f'an arrow upward: {path.stem} lies below "{name}"')
            if name == "pelorus/session.h" and path.stem in SESSION_PARTS:
                yield Breach(path, number, "a part of the session does not see it: session_parts.h")
        for number, line in code_lines(path):
            if SETS_PHASE.search(line):
                yield Breach(path, number, "the phase is changed by plr_phase_change alone")


def check_imu_phase(root: Path) -> Iterator[Breach]:
    """One function changes the phase of an IMU's start."""
    for path in sorted((root / "src").glob("*/*.[ch]")):
        if path.stem == "imu_phase" or path.parent.name == "session":
            continue
        for number, line in code_lines(path):
            if SETS_PHASE.search(line):
                yield Breach(path, number, "the phase is changed by plr_imu_phase_change alone")


def check_session_table(root: Path) -> Iterator[Breach]:
    """docs/REPLAY-FORMAT.md shows the table of phases and kinds that the session goes by."""
    page = root / "docs" / "REPLAY-FORMAT.md"
    text = (root / "src" / "session" / "session.c").read_text(encoding="utf-8")
    names = {"LANDMARK": "LANDMARK (known)", "RESTORE": "STATE (restore)", "STATE": "STATE (save)"}
    rows = TABLE_ROW.findall(text)
    lines = page.read_text(encoding="utf-8").splitlines()
    if not rows:
        yield Breach(page, 1, "the table of src/session/session.c is not found")
    for kind, rules in rows:
        shown = " | ".join([names.get(kind, kind), *rules.lower().replace(" ", "").split(",")])
        if f"| {shown} |" not in lines:
            yield Breach(page, 1, f"src/session/session.c says otherwise: | {shown} |")


def check_conditions(root: Path) -> Iterator[Breach]:
    """`#if` stands where the build is configured, in config.h, for PLR_ASSERT in assertions.h,
    around what stands in for a room, and in fma.c, which refuses a processor without the
    instruction; elsewhere only include guards and `extern "C"`."""
    configuration = {root / "include/pelorus" / name for name in ("assertions.h", "config.h")}
    configuration |= {root / "src/math/fma.c", *(root / "src/absent").glob("*.c")}
    paths = [*(root / "src").rglob("*.[ch]"), *(root / "include").rglob("*.h")]
    for path in sorted(set(paths) - configuration):
        guard = "PELORUS_" if "include" in path.relative_to(root).parts else "PLR_"
        guards = 0
        for number, line in code_lines(path):
            match = CONDITION.match(line)
            if not match or match.group(2).strip() == "__cplusplus":
                continue
            is_guard = match.group(1) == "ifndef" and match.group(2).strip().endswith("_H")
            guards += is_guard
            if not is_guard or guards > 1 or path.suffix == ".c":
                yield Breach(path, number, "a preprocessor condition: choose by file or by table")
        if path.suffix == ".h" and guards != 1:
            yield Breach(path, 1, f"no include guard ({guard}..._H)")


def check_licence_lines(root: Path) -> Iterator[Breach]:
    """An SPDX line on top of each source file (behind `#!` in scripts)."""
    for folder in ("cmake", "include", "src", "port", "tests", "tools"):
        for path in sorted((root / folder).rglob("*")):
            if path.suffix not in {".c", ".h", ".py", ".sh", ".cmake", ".S", ".ld"}:
                continue
            if ".egg-info" in str(path) or not path.is_file():
                continue
            head = path.read_text(encoding="utf-8").splitlines()[:3]
            if not any("SPDX-License-Identifier: MIT" in line for line in head):
                yield Breach(path, 1, "no line `SPDX-License-Identifier: MIT` on top")


def check_port_is_outside(root: Path) -> Iterator[Breach]:
    """The port may include src/session's public header, never the inside of src/."""
    for path in sorted((root / "port").rglob("*.[ch]")):
        for number, system, name in includes(path):
            if not system and name.partition("/")[0] in FOLDERS:
                yield Breach(path, number, f'"{name}" is inside the library: use include/pelorus')


def check_textbook_is_another(root: Path) -> Iterator[Breach]:
    """The textbook is the filter's oracle: it shares nothing with it."""
    for path in sorted((root / "tests" / "textbook").rglob("*.[ch]")):
        for number, system, name in includes(path):
            if not system and name.partition("/")[0] in FOLDERS.keys() - {"session"}:
                yield Breach(path, number, f'"{name}" is what the textbook is held against')


CHECKS = (
    check_layers,
    check_session,
    check_imu_phase,
    check_session_table,
    check_conditions,
    check_licence_lines,
    check_port_is_outside,
    check_textbook_is_another,
)


def main() -> int:
    """Runs all checks; the exit status."""
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "src").is_dir():
        print(__doc__, file=sys.stderr)
        return 2
    root = Path(sys.argv[1]).resolve()
    breaches = [breach for check in CHECKS for breach in check(root)]
    for breach in breaches:
        print(f"{breach.path.relative_to(root)}:{breach.line}: {breach.text}")
    files = len(list((root / "src").rglob("*.[ch]")))
    print(f"{files} files in src/, {len(breaches)} breaches")
    return 1 if breaches or files == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
