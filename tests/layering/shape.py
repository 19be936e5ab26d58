#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Holds the sources against the rules of shape: how long a file and a function may be, who may
touch the covariance, who may see the whole filter, and where the dimensions and the setting `bias`
may be known.

usage: shape.py PROJECT_ROOT

Prints every breach as file:line: what, and what would be right. Exit status 1 if there is any.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from sources import Breach, code_lines, without_comments

LONGEST_FILE = 500
LONGEST_FUNCTION = 60
FOLDERS = ("include", "src", "port", "tests", "tools")
# Rooms that know the state by its blocks.
ROOMS = ("state", "process", "sensor", "filter")
# Rooms whose functions take what they touch, and never the whole filter.
ROOMS_WITH_PARTS = (
    "math",
    "record",
    "limits",
    "state",
    "process",
    "sensor",
    "supervise",
    "known_map",
    "absent",
)

# The first line of a function's body in C as clang-format writes it: `{` ends a line that began, or
# whose head began, in the first column. What else opens a brace there holds no statements.
NO_FUNCTION = re.compile(r"^(typedef|struct|enum|union|extern|static const|const)\b[^(]*$|=\s*\{?$")
TOUCHES_P = re.compile(r"\b(belief|f|filter|like|copy)\s*(->|\.)\s*P\b|->P\[")
IN_A_STRUCT_OF_ITS_OWN = re.compile(r"\b(at|landmark|known|entering)->P\[")
BARE_DIMENSION = re.compile(
    r"\[(36|21|18)\]|(?<![\w.-])6 \* | \* 6\b(?!\.)|< 6\b(?!\.)|\(6, |\[(12|18|24|30) \+ "
    r"|(?<![\w.(])(36|21|18)(?= [*+] )|(?<= [*+] )(36|21|18)\b|\+ (12|18|24|30)\b"
)
WHOLE_FILTER = re.compile(r"\bplr_filter\b")
BIAS_SETTING = re.compile(r"\bconfig\s*(\.|->)\s*bias\b")


def sources_of(root: Path, *suffixes: str) -> Iterator[Path]:
    """Every source file of the project, generated ones left out."""
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in suffixes and path.is_file() and ".egg-info" not in str(path):
                yield path


def check_files(root: Path) -> Iterator[Breach]:
    """No file is longer than 500 lines."""
    for path in sources_of(root, ".c", ".h", ".def", ".py", ".sh", ".cmake"):
        lines = len(path.read_text(encoding="utf-8").splitlines())
        if lines > LONGEST_FILE:
            yield Breach(path, lines, f"{lines} lines: split it ({LONGEST_FILE} at most)")


def c_functions(text: str) -> Iterator[tuple[int, int, str]]:
    """(first line, length, name) of the functions in clang-formatted C."""
    head: list[str] = []
    begin = 0
    inside = False
    for number, line in enumerate(without_comments(text).splitlines(), start=1):
        if inside:
            if line.startswith("}"):
                name = re.search(r"(\w+)\s*\(", " ".join(head))
                yield begin, number - begin + 1, name.group(1) if name else "?"
                inside, head = False, []
            continue
        if not line.strip() or line.startswith("#") or line.rstrip().endswith((";", "}")):
            head = []
            continue
        if not head:
            begin = number
        head.append(line.strip())
        if line.rstrip().endswith("{"):
            opened = " ".join(head)
            inside = "(" in opened and not NO_FUNCTION.search(opened.rstrip("{ "))
            if not inside:
                head = []


def python_functions(text: str) -> Iterator[tuple[int, int, str]]:
    """(first line, length, name) of the functions of a Python file. Of a command the options, with
    their help, are a table: the body counts."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            begin = node.body[0].lineno
            yield begin, (node.end_lineno or begin) - begin + 1, node.name


def check_functions(root: Path) -> Iterator[Breach]:
    """No function is longer than 60 lines."""
    for path in sources_of(root, ".c", ".h", ".py"):
        text = path.read_text(encoding="utf-8")
        functions = python_functions(text) if path.suffix == ".py" else c_functions(text)
        for line, length, name in functions:
            if length > LONGEST_FUNCTION:
                what = f"{name} has {length} lines: split it ({LONGEST_FUNCTION} at most)"
                yield Breach(path, line, what)


def check_covariance(root: Path) -> Iterator[Breach]:
    """The covariance P is touched in src/state alone."""
    for path in sorted((root / "src").rglob("*.[ch]")):
        if path.relative_to(root / "src").parts[0] == "state":
            continue
        for number, line in code_lines(path):
            if TOUCHES_P.search(IN_A_STRUCT_OF_ITS_OWN.sub("", line)):
                yield Breach(path, number, "P is touched in src/state alone: covariance.h")


def check_parts(root: Path) -> Iterator[Breach]:
    """A function takes the structs that it touches: src/filter and the public calls alone see the
    whole filter.
    """
    for room in ROOMS_WITH_PARTS:
        for path in sorted((root / "src" / room).rglob("*.[ch]")):
            for number, line in code_lines(path):
                if WHOLE_FILTER.search(line):
                    yield Breach(
                        path, number, "the whole filter: take the structs that are touched"
                    )


def check_dimensions(root: Path) -> Iterator[Breach]:
    """Dimensions have names, and the setting `bias` is the process's alone."""
    for room in ROOMS:
        for path in sorted((root / "src" / room).rglob("*.[ch]")):
            for number, line in code_lines(path):
                if BARE_DIMENSION.search(line):
                    yield Breach(path, number, "a bare dimension: config.h has names for them")
                if room != "process" and BIAS_SETTING.search(line):
                    yield Breach(path, number, "ask plr_has_block: `bias` is the process's setting")


CHECKS = (check_files, check_functions, check_covariance, check_parts, check_dimensions)


def main() -> int:
    """Runs all checks; the exit status."""
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "src").is_dir():
        print(__doc__, file=sys.stderr)
        return 2
    root = Path(sys.argv[1]).resolve()
    breaches = [breach for check in CHECKS for breach in check(root)]
    for breach in breaches:
        print(f"{breach.path.relative_to(root)}:{breach.line}: {breach.text}")
    functions = sum(
        1 for path in sources_of(root, ".c") for _ in c_functions(path.read_text(encoding="utf-8"))
    )
    print(f"{functions} functions in C, {len(breaches)} breaches")
    return 1 if breaches or functions == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
