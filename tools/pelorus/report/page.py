# SPDX-License-Identifier: MIT
"""Writes the result page: one HTML file that opens from anywhere and fetches nothing.

What was found stands first, as text, and needs no script: verdict, settings to change, events.
Below, one time cursor and one zoom are shared by health with its reasons, curves, path and map.
`report`, `check` and `explain` write it. Names and words of a recording are escaped here, and only
ever set as text by the script; the JSON that it reads holds no `<`.

uPlot 1.6.32 (MIT, (c) 2022 Leon Sorokin) draws the curves: assets/uPlot.LICENSE.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from pelorus.errors import write_text
from pelorus.report.curves import Curves

COLUMNS_MOST = 5
FIGURE_MOST = 24  # letters of a cell; a column with a longer one holds words, which wrap
GRADES = ("good", "care", "bad")


@dataclass(frozen=True)
class Event:
    """An event: times in seconds since the first frame; the first of `lines` says most of it."""

    from_s: float
    to_s: float
    lines: Sequence[str]


@dataclass(frozen=True)
class PageTable:
    """A table of text cells; the first row is its head."""

    title: str
    rows: Sequence[Sequence[str]]
    about: str = ""
    folded: bool = False


@dataclass(frozen=True)
class Drawing:
    """SVG, made by spectra.py."""

    title: str
    about: str
    svg: str


@dataclass(frozen=True)
class Answer:
    """The text above the curves. `grade` is one of GRADES."""

    title: str
    grade: str
    verdict: str
    facts: str = ""
    lines: Sequence[str] = ()
    changes: Sequence[str] = ()  # settings, as in a config file
    events: Sequence[Event] = ()
    tables: Sequence[PageTable] = ()
    pictures: Sequence[tuple[str, str, Path]] = ()  # title, caption, PNG
    moments: Sequence[tuple[float, str, bytes]] = ()  # s since the first frame, words, WebP
    about_moments: str = ""
    drawings: Sequence[Drawing] = ()
    commands: Sequence[str] = ()
    lists: Sequence[tuple[str, Sequence[str]]] = ()  # folded lists: head, and rows


def write(path: Path, answer: Answer, curves: Curves | None = None) -> None:
    """Writes the whole page; without curves only the text above them."""
    parts = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        "script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:\">",
        f"<title>{escape(answer.title)}</title>",
        f"<style>{_asset('uPlot.min.css')}\n{_asset('page.css')}</style>\n</head>\n<body>",
        *_above(answer),
    ]
    if curves is not None:
        content = curves.json()  # before what it left out is written
        body = _asset("body.html").replace("<!-- moments -->", _moments(answer))
        parts += [body, *_below(answer, curves), *_scripts(content, curves)]
    else:
        parts += ["<main>", *_pictures(answer), "</main>", *_commands(answer)]
    parts.append("</body>\n</html>\n")
    write_text(path, "\n".join(parts))


def _asset(name: str) -> str:
    return (files("pelorus.report") / "assets" / name).read_text(encoding="utf-8")


def _above(answer: Answer) -> list[str]:
    assert answer.grade in GRADES
    out = ["<header>", f"<h1>{escape(answer.title)}</h1>"]
    if answer.facts:
        out.append(f'<p class="soft">{escape(answer.facts)}</p>')
    out.append(f'<div class="verdict {answer.grade}"><strong>{escape(answer.verdict)}</strong>')
    out += [_list(answer.lines), "</div>"]
    if answer.changes:
        settings = escape("\n".join(answer.changes))
        out.append(f"<h2>Settings to use</h2>\n<pre>{settings}</pre>")
    if answer.events:
        out.append("<h2>What happened</h2>")
        out += [_event(event) for event in answer.events]
    for title, lines in answer.lists:
        summary = f"<summary>{escape(title)}: {escape(lines[0])}</summary>"
        out.append(f"<details>{summary}{_list(lines[1:])}</details>")
    out += [_table(table) for table in answer.tables]
    return [*out, "</header>"]


def _list(lines: Sequence[str]) -> str:
    items = "\n".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"<ul>\n{items}\n</ul>" if lines else ""


def _event(event: Event) -> str:
    head, *rest = event.lines
    more = "".join(f'<br><span class="soft">{escape(line)}</span>' for line in rest)
    return (
        f'<button class="event" data-from="{event.from_s:.3f}" data-to="{event.to_s:.3f}">'
        f"<b>{event.from_s:.2f} s</b> {escape(head)}{more}</button>"
    )


def _table(table: PageTable) -> str:
    head, *rows = table.rows
    worded = [any(len(x) > FIGURE_MOST for x in column) for column in zip(*rows, strict=True)]
    kinds = [' class="words"' if words else "" for words in worded or [False] * len(head)]
    cells = "".join(f"<th{kind}>{escape(x)}</th>" for kind, x in zip(kinds, head, strict=True))
    many = len(head) > COLUMNS_MOST  # then a phone shows a row as a list, with the names
    names = [
        kind + (f' data-head="{escape(name)}"' if many else "")
        for kind, name in zip(kinds, head, strict=True)
    ]
    body = "\n".join(
        "<tr>"
        + "".join(f"<td{name}>{escape(x)}</td>" for name, x in zip(names, row, strict=True))
        + "</tr>"
        for row in rows
    )
    about = (
        f"<details><summary>What the columns mean</summary><p>{escape(table.about)}</p></details>"
        if table.about
        else ""
    )
    kind = "wide many" if many else "wide"
    content = f'<div class="{kind}"><table>\n<tr>{cells}</tr>\n{body}\n</table></div>{about}'
    title = escape(table.title)
    if table.folded:
        return f"<details><summary>{title}</summary>{content}</details>"
    return f"<h2>{title}</h2>\n{content}"


_KEYS = (
    "Drag over a curve to zoom, double-click for all. Keys: left and right one frame, with shift "
    "ten; + and - zoom, 0 all; n and p next and previous event; d dark or light."
)


def _below(answer: Answer, curves: Curves) -> list[str]:
    out = [f'<p class="soft">{escape(_KEYS)}</p>', *_drawings(answer), *_pictures(answer)]
    if curves.left_out:
        words = "; ".join(curves.left_out)
        out.append(f'<p class="soft">Left out, to keep the page small: {escape(words)}.</p>')
    return [*out, "</main>", *_commands(answer)]


def _drawings(answer: Answer) -> list[str]:
    made = [
        f"<section><h2>{escape(one.title)}</h2>{one.svg}\n"
        f'<p class="soft">{escape(one.about)}</p></section>'
        for one in answer.drawings
    ]
    return ['<div class="drawings">', *made, "</div>"] if made else []


def _moments(answer: Answer) -> str:
    """Returns a strip of pictures, each of which moves the cursor to its frame."""
    if not answer.moments:
        return ""
    out = [f'<h2>In the pictures</h2>\n<p class="soft">{escape(answer.about_moments)}</p>']
    out.append('<div class="strip" tabindex="0" role="group" aria-label="pictures">')
    for t_s, words, packed in answer.moments:
        caption = escape(f"{t_s:.2f} s {words}".strip())
        out.append(
            f'<button class="moment" data-at="{t_s:.3f}"><img alt="the left picture at {caption}" '
            f'src="data:image/webp;base64,{base64.b64encode(packed).decode("ascii")}">'
            f"<span>{caption}</span></button>"
        )
    return "\n".join([*out, "</div>"])


def _pictures(answer: Answer) -> list[str]:
    return [
        f"<h2>{escape(title)}</h2>\n"
        f'<img alt="{escape(title)}" src="data:image/png;base64,'
        f'{base64.b64encode(picture.read_bytes()).decode("ascii")}">\n'
        f'<p class="soft">{escape(caption)}</p>'
        for title, caption, picture in answer.pictures
    ]


def _commands(answer: Answer) -> list[str]:
    if not answer.commands:
        return []
    items = "\n".join(f"<li><code>{escape(line)}</code></li>" for line in answer.commands)
    return [f"<footer><h2>Runs</h2>\n<ul>\n{items}\n</ul></footer>"]


def _scripts(content: dict[str, Any], curves: Curves) -> list[str]:
    told = json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return [
        f'<script type="application/json" id="data">{told}</script>',
        f'<script type="application/octet-stream" id="columns">{curves.packer.text()}</script>',
        f"<script>{_asset('uPlot.min.js')}</script>",
        f"<script>{_asset('map.js')}</script>",
        f"<script>{_asset('page.js')}</script>",
    ]
