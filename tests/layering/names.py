#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Looks up what README, CHANGELOG and docs name: identifiers, tests and files in `backticks`, and
the files and headings that links lead to, must be there. Addresses elsewhere must be https.

usage: names.py PROJECT_ROOT

Prints every breach as file:line: what. Exit status 1 if there is any. Not looked up are fenced
blocks, patterns with * or {, and placeholders in capitals (NAME, RECORDING).
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from shape import FOLDERS, sources_of
from sources import Breach, without_comments

CODE = (".c", ".h", ".def", ".S", ".ld", ".py", ".sh", ".cmake")
C_COMMENTS = {".c", ".h", ".def", ".S"}
ALL_FOLDERS = (*FOLDERS, "cmake", "docs")
NOWHERE = f"is nowhere in {', '.join(FOLDERS)}"

FENCE = re.compile(r"^ *(```|~~~).*?^ *\1 *$", re.DOTALL | re.MULTILINE)
PARAGRAPH = re.compile(r"(?:^.*\S.*(?:\n|\Z))+", re.MULTILINE)
SPAN = re.compile(r"(?<!`)(`+)(?!`)(.+?)(?<!`)\1(?!`)", re.DOTALL)
LINK = re.compile(r"\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)")
HEADING = re.compile(r"^#{1,6} +(.*?)(?: +#+)? *$", re.MULTILINE)
ELSEWHERE = re.compile(r"[a-z][a-z0-9+.-]*:")  # https:, mailto:
ADDRESS = re.compile(r"https://[a-z0-9-]+(\.[a-z0-9-]+)+(/[\w./~#%?=&+-]*)?|mailto:\S+@\S+")

# A name of the project, also behind the compiler's -D, but not where a pattern begins or ends.
IDENTIFIER = re.compile(r"(?:(?<=-[DU])|(?<![\w*}-]))((?:plr|PLR|PELORUS)_\w*\w)(?![\w*{])")
# A name as the docs shorten it, without PLR_REASON_ or what else stands before it.
SHORT = re.compile(r"(?<![\w./*}-])(?!PLR_|PELORUS_)([A-Z]+(?:_[A-Z0-9]+)+)(?![\w.*{])")
FOREIGN = {"VISO_TYPE"}  # a parameter of ArduPilot's
CALL = re.compile(r"(?<![\w.*}])(?!plr_)([a-z][a-z0-9_]*)\(")
CALLED = re.compile(r"\b([a-z]\w*) ?\(")
TEST = re.compile(r"(?<![\w./-])((?:\w+/)*test_\w*?[a-z0-9])(?:_f32|_f64)?(?![\w.*{])")
FILE = re.compile(r"(?:[\w.-]+/)*[\w.-]*\w\.(?:c|h|def|py|sh|conf|cmake|md)")
PATH = re.compile(rf"(?:{'|'.join(ALL_FOLDERS)})/[\w./-]*\w")
PLACEHOLDER = re.compile(r"[A-Z]{2}")
QUOTED = re.compile(r"\"([\w.-]+)\"")


@dataclass(frozen=True)
class Tree:
    """What may be named."""

    files: set[str]  # each path, from the root and from every folder on its way; each folder
    words: set[str]  # of the sources
    endings: set[str]  # the words in capitals, without their first parts
    called: set[str]
    written: set[str]  # what tools quote: among it the names of the files that they write

    def has_file(self, name: str) -> bool:
        """Whether there is such a file, its suffix perhaps left out, or a placeholder stands for
        a part of its name."""
        if any(name + suffix in self.files for suffix in ("", ".c", ".h", ".py")):
            return True
        return name in self.written or bool(PLACEHOLDER.search(name) and name[-3:] != ".md")

    def has_test(self, name: str) -> bool:
        """Whether a file or a function is called so."""
        return name in self.words or self.has_file(name)


def all_files(root: Path) -> Iterator[Path]:
    """Every file of the project, from its root; what a build leaves is not among them."""
    for path in root.iterdir():
        if path.is_file():
            yield path.relative_to(root)
    for folder in ALL_FOLDERS:
        for path in (root / folder).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                yield path.relative_to(root)


def sources_and_lists(root: Path) -> Iterator[Path]:
    """Everything in which an identifier can be defined or used."""
    yield from sources_of(root, *CODE)
    yield root / "CMakeLists.txt"
    yield from (root / "cmake").glob("*.cmake")
    for folder in FOLDERS:
        yield from (root / folder).rglob("CMakeLists.txt")


def read_tree(root: Path) -> Tree:
    """Reads every source, C without its comments."""
    tree = Tree(set(), set(), set(), set(), set())
    for path in sources_and_lists(root):
        text = path.read_text(encoding="utf-8")
        if path.suffix in C_COMMENTS:
            text = without_comments(text)
        tree.words.update(re.findall(r"\w+", text))
        tree.called.update(CALLED.findall(text))
        if path.suffix == ".py" and (root / "tools") in path.parents:
            tree.written.update(QUOTED.findall(text))
    for word in filter(str.isupper, tree.words):
        parts = word.split("_")
        tree.endings.update("_".join(parts[first:]) for first in range(len(parts)))
    for path in all_files(root):
        tree.files.update("/".join(path.parts[first:]) for first in range(len(path.parts)))
        tree.files.update(str(folder) for folder in path.parents)
    return tree


def blank(match: re.Match[str]) -> str:
    """What was matched as blanks, so that line numbers stay."""
    return re.sub(r"[^\n]", " ", match.group())


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return FENCE.sub(blank, page.read_text(encoding="utf-8"))


def line_of(text: str, place: int) -> int:
    """The number of the line in which a place is."""
    return text.count("\n", 0, place) + 1


def spans(text: str) -> Iterator[tuple[int, str]]:
    """(line, text) of all that stands in backticks; no span reaches over an empty line."""
    for paragraph in PARAGRAPH.finditer(text):
        for match in SPAN.finditer(paragraph.group()):
            yield line_of(text, paragraph.start() + match.start()), match.group(2)


def links(text: str) -> Iterator[tuple[int, str]]:
    """(line, target) of every link."""
    plain = PARAGRAPH.sub(lambda paragraph: SPAN.sub(blank, paragraph.group()), text)
    for match in LINK.finditer(plain):
        yield line_of(text, match.start()), match.group(1)


def files_in(span: str) -> Iterator[str]:
    """The files of the project in a span; each is a whole word of it."""
    for word in span.split():
        name = word.rpartition("=")[2].strip("'\"(),;:").removeprefix("./").removeprefix("../")
        is_made = name.startswith(("build", "out/"))
        if not is_made and (FILE.fullmatch(name) or PATH.fullmatch(name)):
            yield name


def names_in(tree: Tree, span: str) -> Iterator[tuple[str, bool]]:
    """(name, is it there) of every name in a span."""
    for name in IDENTIFIER.findall(span):
        yield name, name in tree.words
    for name in SHORT.findall(span):
        yield name, name in tree.endings | FOREIGN
    for name in CALL.findall(span):
        yield f"{name}()", name in tree.called
    for name in TEST.findall(span):
        yield name, tree.has_test(name)
    for name in files_in(span):
        yield name, tree.has_file(name)


def anchors(page: Path) -> set[str]:
    """What GitHub calls the headings of a page: the second of a name gets -1."""
    names: set[str] = set()
    for title in HEADING.findall(prose(page)):
        shown = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title)
        name = re.sub(r"[^\w -]", "", shown.lower()).replace(" ", "-")
        again = 0
        while (f"{name}-{again}" if again else name) in names:
            again += 1
        names.add(f"{name}-{again}" if again else name)
    return names


def what_is_wrong(page: Path, target: str) -> str | None:
    """Where a link leads to nothing."""
    if ELSEWHERE.match(target):
        return None if ADDRESS.fullmatch(target) else f"{target} is no https address"
    file, _, anchor = target.partition("#")
    path = page.parent / file if file else page
    if not path.exists():
        return f"the link leads to {file}, which is not there"
    if anchor and path.suffix == ".md" and anchor not in anchors(path):
        return f"the link leads to #{anchor}, which is no heading of {path.name}"
    return None


def check_page(tree: Tree, page: Path) -> tuple[int, list[Breach]]:
    """How much was looked up on a page, and what is not there."""
    text = prose(page)
    looked_up = 0
    breaches = []
    for line, span in spans(text):
        for name, is_there in names_in(tree, span):
            looked_up += 1
            if not is_there:
                breaches.append(Breach(page, line, f"`{name}` {NOWHERE}"))
    for line, target in links(text):
        looked_up += 1
        if wrong := what_is_wrong(page, target):
            breaches.append(Breach(page, line, wrong))
    return looked_up, breaches


def main() -> int:
    """Looks everything up; the exit status."""
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "docs").is_dir():
        print(__doc__, file=sys.stderr)
        return 2
    root = Path(sys.argv[1]).resolve()
    tree = read_tree(root)
    pages = [*sorted(root.glob("*.md")), *sorted((root / "docs").glob("*.md"))]
    results = [check_page(tree, page) for page in pages]
    breaches = [breach for _, found in results for breach in found]
    for breach in breaches:
        print(f"{breach.path.relative_to(root)}:{breach.line}: {breach.text}")
    looked_up = sum(count for count, _ in results)
    print(f"{looked_up} names and links on {len(pages)} pages, {len(breaches)} breaches")
    return 1 if breaches or looked_up == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
