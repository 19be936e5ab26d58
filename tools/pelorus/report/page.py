# SPDX-License-Identifier: MIT
"""The report as one HTML file that can be sent: pictures inside, no script, nothing fetched."""

from __future__ import annotations

import base64
import shlex
from collections.abc import Sequence
from html import escape
from pathlib import Path

from pelorus.errors import write_text
from pelorus.report import words
from pelorus.report.comparison import Comparison
from pelorus.report.pictures import Picture
from pelorus.report.results import Run

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 1040px; margin: 2em auto; padding: 0 1em;
  color: #1a1a1a; background: #fff; }
h1 { font-size: 1.6em; } h2 { font-size: 1.2em; margin-top: 2em; }
table { border-collapse: collapse; } .wide { overflow-x: auto; }
th, td { padding: .3em .8em; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
img { max-width: 100%; height: auto; } figure { margin: 1em 0; }
figcaption { color: #444; } code { font-size: .9em; overflow-wrap: anywhere; }
"""

MEANING = (
    "err0: RMS position error, first poses aligned. ATE: RMS position error after the best rigid "
    "fit. Rotation: RMS angle, first poses aligned. NEES/6: mean over the frames, 1 is due. Used "
    "and gated: observations. Map: RMS distance of the landmarks from where the recording knows "
    "them to be, with its NEES an axis; poses that were given, in mode mapping, have no error. The "
    "last column: time of the recording over time of the computing. "
    "Yours is the filter with the settings that were given, in float32 like dead reckoning, which "
    "is the twists alone. Where they were asked for: world is the textbook's EKF with landmarks in "
    "world coordinates, and course the same with the settings of the course report that Pelorus "
    "grew from, whatever settings the others have; both in float64."
)


def write(
    path: Path, compared: Comparison, lines: Sequence[str], drawn: Sequence[tuple[Picture, Path]]
) -> None:
    """Write the page; `drawn` are the pictures with their files."""
    title = f"Pelorus report: {compared.subject.title}"
    parts = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width">',
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>",
        f"<h1>{escape(title)}</h1>",
        f"<p>{escape(_facts(compared))}</p>",
        _table(compared),
        f"<p>{escape(MEANING)}</p>",
        _list("What is off", lines),
        _list("Health", compared.main.health.told(compared.origin_ns)),
        *(_figure(picture, file) for picture, file in drawn if picture.caption),
        _commands(compared.runs),
        "</body>\n</html>\n",
    ]
    write_text(path, "\n".join(parts))


def _facts(compared: Comparison) -> str:
    summary = compared.main.summary
    header = compared.subject.header
    return (
        f"{compared.subject.path.name}: {summary['duration_s']:.1f} s, "
        f"{summary['frames'] + summary['frames_refused']} stereo frames with "
        f"{summary['observations']} observations, {summary['twists']} twists; "
        f"path {summary['path_m']:.1f} m; body axes "
        f"{header.body_axes.name.lower().replace('_', '-')}."
    )


def _table(compared: Comparison) -> str:
    head = "".join(f"<th>{escape(title)}</th>" for title in words.titles(compared))
    rows = "\n".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in words.row(compared, run)) + "</tr>"
        for run in compared.runs
    )
    return f'<div class="wide"><table>\n<tr>{head}</tr>\n{rows}\n</table></div>'


def _list(title: str, lines: Sequence[str]) -> str:
    items = "\n".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"<h2>{escape(title)}</h2>\n<ul>\n{items}\n</ul>"


def _figure(picture: Picture, file: Path) -> str:
    data = base64.b64encode(file.read_bytes()).decode("ascii")
    return (
        f"<h2>{escape(picture.title)}</h2>\n<figure>"
        f'<img alt="{escape(picture.title)}" src="data:image/png;base64,{data}">\n'
        f"<figcaption>{escape(picture.caption)}</figcaption></figure>"
    )


def _commands(runs: Sequence[Run]) -> str:
    commands = [
        f"<li><code>{escape(shlex.join((run.plan.program.name, 'IN.plr', *run.plan.options)))}"
        "</code></li>"
        for run in runs
    ]
    return "<h2>Runs</h2>\n<ul>\n" + "\n".join(commands) + "\n</ul>"
