#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Makes two files of the library, to drop into a project: pelorus.h and pelorus.c.

usage: amalgamate.py FOLDER

The options of include/pelorus/config.h are those of the two files. Compile pelorus.c like this; the
result has the same bits as the library's:

    cc -std=c99 -O3 -march=x86-64-v3 -ffp-contract=off -fno-math-errno -c pelorus.c
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
INCLUDE = re.compile(
    r'^[ \t]*#[ \t]*include[ \t]+(?:"([^"]+)"|(PLR_(?:TILE|ROW|PIXELS)_FILE))[^\n]*\n', re.M
)
COMMENT_OR_TEXT = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"', re.S)
SPDX = re.compile(r"^// SPDX[^\n]*\n")
# Static names, which another source may use, too.
STATIC = re.compile(r"^static\b[^;{=()]*?(\w+)(?:\[[^\]]*\])*[ ]*(?=[(;=])", re.M)
TYPE = re.compile(
    r"^(?:typedef )?(?:static )?(?:const )?(?:struct|union|enum)\b"
    r"[^;{}]*\{([^{}]*)\}[ ]*(\w*)[^;]*;",
    re.M,
)
CONSTANT = re.compile(r"(\w+)\s*(?:=[^,]*)?(?:,|$)")
MACRO = re.compile(r"^[ \t]*#[ \t]*define[ \t]+(\w+)", re.M)
# Rooms that a build may leave out, with their options.
ROOMS = {
    "supervise": "PLR_SUPERVISE",
    "known_map": "PLR_KNOWN_MAP",
    "vision": "PLR_VISION",
    "eyes": "PLR_VISION",
}
# Files between which config.h chooses: the condition, the file if it holds, and if not.
CHOICES = {
    "PLR_TILE_FILE": ("PLR_TILE_CORTEX_M", "math/tile_cortex_m.h", "math/tile_in_c.h"),
    "PLR_ROW_FILE": ("PLR_WASM_FMA", "math/row_wasm.h", "math/row_in_c.h"),
    "PLR_PIXELS_FILE": ("PLR_PIXELS_MVE", "vision/kernels_mve.h", "vision/kernels_in_c.h"),
}

HEAD = """\
// SPDX-License-Identifier: MIT
/* Pelorus {version}, {what}, made of its sources by tools/amalgamate.py: do not edit. */
"""
GUARD = """\
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("no-fast-math", "fp-contract=off")
#elif defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif
#if defined(__GNUC__) /* a room that is left out leaves what it alone had used */
#pragma GCC diagnostic ignored "-Wunused-function"
#endif
"""


def read(path: Path) -> str:
    """Returns a file's text without the licence line: one is enough."""
    return SPDX.sub("", path.read_text(encoding="utf-8"))


def without_comments(text: str) -> str:
    """Returns the code alone."""
    return COMMENT_OR_TEXT.sub(" ", text)


def names_of(text: str) -> set[str]:
    """Returns the static names that a source defines at file level."""
    code = without_comments(text)
    names = set(STATIC.findall(code))
    for body, name in TYPE.findall(code):
        names |= {name} if name else set()
        if ";" not in body:
            names |= set(CONSTANT.findall(body))
    return {name for name in names if not name.startswith("plr_")}


def renamed(text: str, names: set[str], prefix: str) -> str:
    """Returns the text with these names prefixed; members, comments and texts keep theirs."""
    if not names:
        return text
    word = re.compile(r"(?<![\w.>])(?:" + "|".join(sorted(names)) + r")\b(?!\s*\")")

    def in_code(code: str) -> str:
        return word.sub(lambda match: f"{prefix}_{match[0]}", code)

    parts, at = [], 0
    for skipped in COMMENT_OR_TEXT.finditer(text):
        parts += [in_code(text[at : skipped.start()]), skipped[0]]
        at = skipped.end()
    return "".join([*parts, in_code(text[at:])])


@dataclass
class Amalgamation:
    """Joins the files of a source tree, each header once."""

    folders: Sequence[Path]  # folders of included files
    done: set[Path]  # headers that are in already

    def find(self, name: str) -> Path:
        for folder in self.folders:
            if (folder / name).is_file():
                return folder / name
        raise SystemExit(f'"{name}" is in none of {", ".join(map(str, self.folders))}')

    def insides(self, text: str) -> str:
        """Returns a file's text with its includes replaced by their text."""

        def included(match: re.Match[str]) -> str:
            if match[2]:
                condition, *names = CHOICES[match[2]]
                one, other = (self.header(self.find(name)) for name in names)
                return f"#if {condition}\n{one}#else\n{other}#endif\n"
            found = self.find(match[1])
            return self.insides(read(found)) if found.suffix == ".def" else self.header(found)

        return INCLUDE.sub(included, text)

    def header(self, path: Path) -> str:
        """Returns the same for a header at its first include; empty later."""
        if path in self.done:
            return ""
        self.done.add(path)
        return self.insides(read(path))

    def headers(self, paths: Sequence[Path]) -> str:
        return "".join(self.header(path) for path in paths)

    def sources(self, paths: Sequence[Path]) -> Iterator[tuple[Path, str]]:
        """Yields each source with distinct static names, and its macros undefined at its end."""
        texts = {path: read(path) for path in paths}
        shared = Counter(name for text in texts.values() for name in names_of(text))
        for path, text in texts.items():
            mine = {name for name in names_of(text) if shared[name] > 1}
            ends = "".join(f"#undef {name}\n" for name in sorted(set(MACRO.findall(text))))
            yield path, self.insides(renamed(text, mine, f"own_{path.stem}")) + ends


def own_header_files(folder: Path) -> list[Path]:
    """Returns the headers to include by themselves; some are included by a choice alone."""
    chosen = {Path(name).name for _, *names in CHOICES.values() for name in names}
    return [path for path in sorted(folder.rglob("*.h")) if path.name not in chosen]


def library(root: Path) -> tuple[str, str]:
    """Returns pelorus.h and pelorus.c."""
    include, src = root / "include", root / "src"
    amalgamation = Amalgamation((include, src), set())
    version = re.search(r'plr_version\(void\) \{\s*return "([^"]+)"', all_text(src))
    shown = version[1] if version else "of an unknown version"
    header = HEAD.format(version=shown, what="its whole interface")
    header += amalgamation.headers(sorted((include / "pelorus").glob("*.h")))
    source = [HEAD.format(version=shown, what="the whole library"), '#include "pelorus.h"\n', GUARD]
    source.append(amalgamation.headers(own_header_files(src)))
    for path, text in amalgamation.sources(sorted(src.glob("*/*.c"))):
        option = ROOMS.get(path.parent.name)
        if path.parent.name == "absent":
            option = f"!{ROOMS[path.stem]}"
        source += [f"#if {option}\n{text}#endif\n" if option else text]
    return header, "".join(source)


def program(root: Path, paths: Sequence[Path]) -> str:
    """Returns one source for a program; it includes pelorus.h."""
    amalgamation = Amalgamation((root / "include", root / "port"), set())
    amalgamation.headers(sorted((root / "include/pelorus").glob("*.h")))
    folders = sorted({path.parent for path in paths})
    headers = "".join(amalgamation.headers(own_header_files(folder)) for folder in folders)
    texts = (text for _, text in amalgamation.sources(paths))
    return "".join(['#include "pelorus.h"\n', headers, *texts])


def all_text(folder: Path) -> str:
    """Returns all sources of a folder, for a search."""
    return "\n".join(path.read_text(encoding="utf-8") for path in sorted(folder.rglob("*.c")))


def main() -> int:
    """Writes both files; returns the exit status."""
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        print(__doc__, file=sys.stderr)
        return 2
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in zip(("pelorus.h", "pelorus.c"), library(ROOT), strict=True):
        (folder / name).write_text(text, encoding="utf-8")
        print(f"{folder / name}: {len(text.splitlines())} lines, {len(text) // 1024} KB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
