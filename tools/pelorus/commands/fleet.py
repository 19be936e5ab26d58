# SPDX-License-Identifier: MIT
"""`pelorus fleet FOLDER --out FLEET.parquet`."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.markup import escape
from rich.table import Table

from pelorus.commands.choices import CONFIG, PROGRAMS, SETTINGS, settings_given
from pelorus.commands.outputs import VERDICT_COLOURS
from pelorus.errors import Existing, PelorusError
from pelorus.fleet import table
from pelorus.fleet.table import Journal
from pelorus.program.console import err, out, print_json, tally, waiting

if TYPE_CHECKING:
    from pelorus.fleet.examine import Work
    from pelorus.fleet.page import Ranking
    from pelorus.fleet.table import Found, Row

PATTERNS = ("*.plr", "*.plr.zst")
TABLE = ".parquet"
TOLD_MOST = 10
COLOURS = {**VERDICT_COLOURS, "broken": "magenta"}

app = typer.Typer()


@app.command(
    epilog="Example:  pelorus fleet logs --out fleet.parquet "
    '--ask "select cause, count(*) from fleet group by cause"'
)
def fleet(
    source: Path = typer.Argument(
        ...,
        metavar="FOLDER|FLEET.parquet",
        help="A folder of recordings and logs (.plr, .plr.zst), with the folders in it. Or what "
        "this command wrote, to ask it.",
    ),
    target: Path | None = typer.Option(
        None, "--out", metavar="FLEET.parquet", help="The table to write: a row a recording."
    ),
    page: Path | None = typer.Option(
        None,
        "--page",
        metavar="OUT.html",
        help="What to look at first and why; by default beside the table.",
    ),
    since: Path | None = typer.Option(
        None,
        metavar="EARLIER.parquet",
        help="An earlier run: what became worse or better since. Rows that would be the same are "
        "taken from it.",
    ),
    question: str | None = typer.Option(
        None, "--ask", metavar="SQL", help="To the tables `fleet` and, with --since, `before`."
    ),
    scheduler: str | None = typer.Option(
        None,
        metavar="tcp://HOST:PORT",
        help="A Dask scheduler, whose workers see the same folder; else this machine's processors.",
    ),
    workers: int | None = typer.Option(
        None, min=1, help="Processes on this machine, if not one a processor."
    ),
    checked: bool = typer.Option(
        True, "--check/--no-check", help="Look for settings, too: a minute for one of driving."
    ),
    config: Path | None = CONFIG,
    settings: list[str] = SETTINGS,
    programs: Path | None = PROGRAMS,
    as_json: bool = typer.Option(False, "--json", help="The answer, or the ranking, as JSON."),
) -> None:
    """Check, evaluate and explain a whole folder; rank what to look at first; ask with SQL.

    A broken recording is a row with its error. Whoever stops it goes on with the same command. A
    log of many hours is explained in pieces, so memory stays bounded.
    """
    is_table = source.suffix == TABLE and source.is_file()
    if is_table == (target is not None):
        asked = "is of a folder's recordings" if is_table else "is needed for a folder"
        raise typer.BadParameter(asked, param_hint="--out")
    table.require_database()
    before = [] if since is None else table.read(since)
    if target is not None:
        shown = page or target.with_suffix(".html")
        Existing.keep(shown)
        from pelorus.fleet.examine import Work, digest_of_tools  # noqa: PLC0415 - loads slowly

        given = tuple(settings_given(config, settings).items())
        own = None if programs is None else programs.resolve()
        work = Work(given, checked, own, digest_of_tools(own))
        rows = _judged(_recordings(source), work, target, before, scheduler, workers)
        ranking = _shown(rows, before, shown, target.name, since, source)
    else:
        rows = table.read(source)
        ranking = _shown(rows, before, page, source.name, since, None)
    if question is not None:
        names, found = table.ask(question, target or source, since)
        _answer(names, found, as_json)
    elif as_json:
        print_json(_json(ranking))
    else:
        _tell(ranking, target, page)


def _recordings(folder: Path) -> list[Found]:
    from pelorus.fleet.table import Found  # noqa: PLC0415 - with its caller

    if not folder.is_dir():
        raise PelorusError(f"{folder}: a folder of recordings is expected, or a {TABLE} table")
    folder = folder.resolve()
    paths = {path for pattern in PATTERNS for path in folder.rglob(pattern) if path.is_file()}
    if not paths:
        raise PelorusError(f"{folder}: holds no recording ({' or '.join(PATTERNS)})")
    found = []
    for path in sorted(paths):
        about = path.stat()
        name = path.relative_to(folder).as_posix()
        found.append(Found(folder, name, about.st_size, about.st_mtime_ns))
    return found


def _judged(
    recordings: list[Found],
    work: Work,
    target: Path,
    before: list[Row],
    scheduler: str | None,
    workers: int | None,
) -> list[Row]:
    """Returns all rows, which are in the table then; each is in the journal as soon as it is
    known.
    """
    from pelorus.fleet.cluster import client_of, examined  # noqa: PLC0415 - loads slowly

    journal = Journal(target.with_name(target.name + ".rows"))
    known = {row.recording: row for row in (*before, *journal.rows())}
    done = {}
    for found in recordings:
        row = known.get(found.recording)
        if row is not None and row.is_of(found, work.made_by):
            done[found.recording] = row
    wanting = [found for found in recordings if found.recording not in done]
    if done:
        err.print(f"{len(done)} of {len(recordings)} recordings are judged already")
    try:
        if wanting:
            weight = float(sum(found.bytes for found in wanting))
            with (
                client_of(scheduler, workers) as client,
                tally("recordings", len(wanting), weight) as advance,
                closing(examined(client, wanting, work)) as rows,
            ):
                for row in rows:
                    journal.write(row)
                    done[row.recording] = row
                    advance(row.bytes)
    except (KeyboardInterrupt, PelorusError):
        err.print(f"{len(done)} rows are kept in {escape(str(journal.path))}: "
                  "the same command goes on from there")  # fmt: skip
        raise
    with journal.until_written(), waiting(f"writing {target.name}"):
        table.write(target, list(done.values()))
    return list(done.values())


def _shown(
    rows: list[Row],
    before: list[Row],
    page: Path | None,
    name: str,
    since: Path | None,
    folder: Path | None,
) -> Ranking:
    """Returns the ranking, and writes its page if one is wanted."""
    from pelorus.fleet.page import rank, write_page  # noqa: PLC0415 - loads slowly

    ranking = rank(rows, before)
    if page is not None:
        write_page(page, ranking, name, None if since is None else since.name, folder)
    return ranking


def _answer(names: list[str], found: list[tuple[Any, ...]], as_json: bool) -> None:
    if as_json:
        print_json({"rows": [dict(zip(names, row, strict=True)) for row in found]})
        return
    shown = Table(box=None, pad_edge=False)
    for name in names:
        shown.add_column(escape(name))
    for row in found:
        shown.add_row(*(escape(_cell(value)) for value in row))
    out.print(shown)


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, list):
        return "; ".join(map(str, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _json(ranking: Ranking) -> dict[str, Any]:
    return {
        "summary": ranking.summary(),
        "grades": dict(ranking.counts),
        "causes": {cause.name: [row.recording for row in cause.rows] for cause in ranking.causes},
        "first": [
            {"recording": row.recording, "grade": row.grade, "cause": row.cause, "why": row.why}
            for row in ranking.rows
        ],
        "worse": {change.now.recording: change.words() for change in ranking.worse},
        "better": {change.now.recording: change.words() for change in ranking.better},
    }


def _tell(ranking: Ranking, target: Path | None, page: Path | None) -> None:
    from pelorus.fleet.page import why  # noqa: PLC0415 - loads slowly

    out.print(f"[bold]{escape(ranking.summary())}[/]")
    wanting = [row for row in ranking.rows if row.grade != "good"]
    for number, row in enumerate(wanting[:TOLD_MOST], 1):
        grade = f"[{COLOURS[row.grade]}]{row.grade}[/]"
        cause = escape(row.cause or "")
        out.print(f"{number}. {escape(row.recording)}  {grade}  {cause}: {escape(why(row))}")
    if len(wanting) > TOLD_MOST:
        out.print(f"and {len(wanting) - TOLD_MOST} more")
    for change in ranking.worse[:TOLD_MOST]:
        out.print(f"[yellow]worse[/]  {escape(change.now.recording)}: {escape(change.words())}")
    if target is not None:
        out.print(f"table: {escape(str(target))}, page: "
                  f"{escape(str(page or target.with_suffix('.html')))}")  # fmt: skip
