# SPDX-License-Identifier: MIT
"""`pelorus fleet`: rows of a folder as one by one, whatever dies, and what is made of them."""

from __future__ import annotations

import os
import shutil
import signal
import threading
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from converted import Run
from draws import LONG
from pelorus.errors import PelorusError
from pelorus.evaluate import evaluation
from pelorus.fleet import cluster, table
from pelorus.fleet.examine import Work, digest_of_tools, examine
from pelorus.fleet.page import rank, write_page
from pelorus.fleet.table import BROKEN, Found, Journal, Row
from pelorus.fleet.whole import in_pieces
from pelorus.native.replay import result_of
from pelorus.program.console import spoken_time
from pelorus.wire.frames import Stereo
from pelorus.wire.framing import Counts
from replay_drive import BIN

pytest.importorskip("distributed")
pytest.importorskip("duckdb")
pytestmark = pytest.mark.usefixtures("built")

COUNT = 300 if LONG else 36
MISHAPS: tuple[tuple[object, ...], ...] = (
    (),
    ("--frozen-from", 1, "--frozen-for", 1),
    ("--dead-encoder-from", 1, "--dead-encoder-for", 1),
    ("--imu-rate", 100, "--rest", 1),
)


@pytest.fixture
def fleet(once: Callable[..., Path], pelorus: Run) -> Path:
    """A folder of short recordings, one of them damaged, one no recording at all."""

    def make(folder: Path) -> None:
        (folder / "monday").mkdir(parents=True)
        for k in range(COUNT - 2):
            path = folder / ("monday" if k % 2 else ".") / f"drive-{k:03}.plr"
            words = (*("--duration", 3, "--landmarks", 300), *MISHAPS[k % len(MISHAPS)])
            pelorus("simulate", path, "--seed", k, *words)
        sound = (folder / "drive-000.plr").read_bytes()
        torn = bytearray(sound)
        for at in range(2000, len(torn), 9001):
            torn[at] ^= 0x55
        (folder / "damaged.plr").write_bytes(torn)
        (folder / "noise.plr").write_bytes(bytes(range(1, 256)) * 40)

    return once("fleet", make)


def found_in(folder: Path) -> list[Found]:
    paths = sorted(folder.rglob("*.plr"))
    about = [(path.relative_to(folder).as_posix(), path.stat()) for path in paths]
    return [Found(folder, name, x.st_size, x.st_mtime_ns) for name, x in about]


def work(checked: bool = False) -> Work:
    return Work(checked=checked, tools=digest_of_tools(None))


@pytest.fixture
def one_by_one(fleet: Path, kept: Callable[..., dict[str, Row]]) -> dict[str, Row]:
    return kept("fleet-rows", lambda: {x.recording: examine(x, work()) for x in found_in(fleet)})


@contextmanager
def here(*_: object) -> Iterator[None]:
    """In the place of a cluster: this process."""
    yield None


def one_after_another(_: object, found: Sequence[Found], asked: Work) -> Iterator[Row]:
    yield from (examine(one, asked) for one in found)


def few(folder: Path, fleet: Path, names: Sequence[str]) -> Path:
    folder.mkdir()
    for name in names:
        shutil.copy2(fleet / name, folder / Path(name).name)
    return folder


FEW = ("drive-000.plr", "monday/drive-001.plr", "drive-002.plr", "noise.plr")


# --- the cluster ----------------------------------------------------------------------------------


def test_with_a_worker_killed_the_rows_are_those_of_one_by_one(
    fleet: Path, one_by_one: dict[str, Row], tmp_path: Path, pelorus: Run
) -> None:
    """On a scheduler of two processes, one of which is killed when the first row has come."""
    from distributed import Client, LocalCluster  # noqa: PLC0415

    target = tmp_path / "fleet.parquet"
    rows = Journal(tmp_path / "fleet.parquet.rows")
    killed: list[int] = []
    with (
        LocalCluster(2, threads_per_worker=1, dashboard_address=None) as both,
        Client(both, set_as_default=False) as client,
    ):
        ended = threading.Event()

        def kill_one() -> None:
            while not ended.wait(0.05):
                if any(True for _ in rows.rows()):
                    pid = next(iter(client.run(os.getpid).values()))
                    os.kill(pid, signal.SIGKILL)
                    killed.append(pid)
                    return

        watching = threading.Thread(target=kill_one)
        watching.start()
        try:
            said = pelorus(
                "fleet", fleet, "--out", target, "--no-check", "--scheduler", both.scheduler_address
            )
        finally:
            ended.set()
            watching.join()
    assert killed
    got = {row.recording: row for row in table.read(target)}
    assert got == one_by_one
    assert len(got) == COUNT
    assert not rows.path.exists()
    assert "1 could not be judged" in said.out


def test_a_recording_that_kills_its_workers_is_a_row_and_costs_no_other(
    fleet: Path, tmp_path: Path
) -> None:
    programs, folder = tmp_path / "bin", few(tmp_path / "logs", fleet, FEW)
    programs.mkdir()
    for name in ("pelorus-replay", "pelorus-replay-f64"):
        script = programs / name
        script.write_text(
            f'#!/bin/sh\ncase "$1" in *drive-001*) kill -9 $PPID;; esac\nexec "{BIN / name}" "$@"\n'
        )
        script.chmod(0o755)
    asked = Work(checked=False, programs=programs, tools=digest_of_tools(programs))
    with cluster.client_of(None, 2) as client:
        rows = {row.recording: row for row in cluster.examined(client, found_in(folder), asked)}
    assert len(rows) == len(FEW)
    assert rows["drive-001.plr"].error == cluster.DIED
    assert rows["drive-000.plr"].grade != BROKEN
    assert rows["drive-002.plr"].grade != BROKEN


def test_an_address_where_no_scheduler_is_and_a_worker_with_other_tools_are_refused(
    fleet: Path, tmp_path: Path, pelorus: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "WORKERS_WITHIN_S", 1)
    words = ("fleet", fleet, "--out", tmp_path / "f.parquet", "--scheduler", "tcp://127.0.0.1:9")
    assert "no Dask scheduler with a worker answers there" in pelorus(*words, status=1).err

    class Other:
        def run(self, *_: object) -> dict[str, str]:
            return {"tcp://10.0.0.2:4000": "other"}

    with pytest.raises(PelorusError, match=r"tcp://10\.0\.0\.2:4000 has another Pelorus"):
        next(cluster.examined(Other(), [], work()))


# --- a row ----------------------------------------------------------------------------------------


def test_a_row_says_what_explain_and_evaluate_say(
    fleet: Path, one_by_one: dict[str, Row], pelorus: Run
) -> None:
    row = one_by_one["monday/drive-001.plr"]
    said = pelorus("explain", fleet / row.recording).out
    assert row.verdict is not None
    assert said.startswith(row.verdict)
    assert row.first_cause == "frozen-picture"
    assert row.first_s == pytest.approx(1, abs=0.2)
    assert row.cause in ("frozen-picture", *(row.faults or ()))
    figures = evaluation.judge(result_of(fleet / row.recording, [], None))
    assert row.ate_m == figures["ate_m"]
    assert row.nees_per_dof == figures["nees_per_dof"]
    assert one_by_one["damaged.plr"].damaged_frames
    assert one_by_one["damaged.plr"].error is None
    noise = one_by_one["noise.plr"]
    assert noise.grade == BROKEN
    assert "this is no .plr recording" in (noise.error or "")


def test_a_fault_of_the_tools_is_a_row_too(fleet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("by chance")

    monkeypatch.setattr("pelorus.fleet.whole.explain", fail)
    (found,) = (one for one in found_in(fleet) if one.recording == "drive-000.plr")
    assert "ZeroDivisionError: by chance: a fault of these tools" in (
        examine(found, work()).error or ""
    )


def test_checked_a_row_has_the_settings_to_change(fleet: Path) -> None:
    (found,) = (one for one in found_in(fleet) if one.recording == "drive-000.plr")
    row = examine(found, work(checked=True))
    assert row.error is None
    assert row.check_error is None
    assert row.check_grade in ("good", "care", "bad")
    assert row.check_changes is not None
    assert row.made_by != work().made_by


def test_a_long_log_in_pieces_gives_the_same_figures_in_less_memory(
    tmp_path: Path, pelorus: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "long.plr"
    pelorus("simulate", path, "--duration", 12, "--frozen-from", 9, "--frozen-for", 2)
    (found,) = found_in(tmp_path)

    def measured(piece_bytes: int) -> tuple[Row, int]:
        tracemalloc.start()
        row = examine(found, replace(work(), piece_bytes=piece_bytes))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return row, peak

    whole, most = measured(1 << 30)
    parts, least = measured(40_000)
    assert (whole.pieces, parts.pieces) == (1, 9)
    assert least < 0.4 * most
    assert parts.error is None
    assert (parts.frames, parts.truth_frames) == (whole.frames, whole.truth_frames)
    for name in ("ate_m", "err0_m", "nees_per_dof", "path_m", "nis", "gated_share", "duration_s"):
        assert getattr(parts, name) == pytest.approx(getattr(whole, name), rel=1e-6), name
    assert parts.first_cause == whole.first_cause == "frozen-picture"
    assert parts.first_s == pytest.approx(whole.first_s)
    monkeypatch.setattr("pelorus.fleet.whole.POSES_MOST", 100)
    thinned = examine(found, replace(work(), piece_bytes=40_000))
    assert 50 <= (thinned.truth_frames or 0) <= 100
    assert thinned.ate_m == pytest.approx(whole.ate_m, rel=0.2)
    counts = Counts()
    seen = [m for piece in in_pieces(path, counts, 100_000) for m in piece]
    assert sum(isinstance(m, Stereo) for m in seen) == counts.frames[Stereo.kind]


# --- the command ----------------------------------------------------------------------------------


def test_a_run_that_was_stopped_goes_on_and_a_later_one_compares(
    fleet: Path,
    one_by_one: dict[str, Row],
    tmp_path: Path,
    pelorus: Run,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder, target = few(tmp_path / "logs", fleet, FEW), tmp_path / "fleet.parquet"
    asked: list[str] = []

    def stopped(_: object, found: Sequence[Found], job: Work) -> Iterator[Row]:
        for one in found[:2]:
            yield examine(one, job)
        raise PelorusError("the cluster is lost: for a test")

    def counted(_: object, found: Sequence[Found], job: Work) -> Iterator[Row]:
        asked.extend(one.recording for one in found)
        yield from one_after_another(_, found, job)

    monkeypatch.setattr(cluster, "client_of", here)
    monkeypatch.setattr(cluster, "examined", stopped)
    words = ("fleet", folder, "--out", target, "--no-check")
    said = pelorus(*words, status=1).err
    assert "2 rows are kept in" in said
    assert not target.exists()
    journal = Journal(tmp_path / "fleet.parquet.rows")
    assert len(list(journal.rows())) == 2
    with journal.path.open("a") as stream:
        stream.write('{"recording": "cut')  # the power failed
    monkeypatch.setattr(cluster, "examined", counted)
    assert "2 of 4 recordings are judged already" in pelorus(*words).err
    assert asked == ["drive-002.plr", "noise.plr"]
    names = {Path(name).name: one_by_one[name] for name in FEW}
    got = {row.recording: row for row in table.read(target)}
    assert {name: replace(row, recording="", error=None) for name, row in got.items()} == {
        name: replace(row, recording="", error=None) for name, row in names.items()
    }
    assert "is there already" in pelorus(*words, status=1).err

    asked.clear()
    shutil.copy2(fleet / "monday/drive-003.plr", folder / "new.plr")
    later = tmp_path / "later.parquet"
    pelorus("fleet", folder, "--out", later, "--no-check", "--since", target)
    assert sorted(asked) == ["new.plr", "noise.plr"]
    text = (tmp_path / "later.html").read_text()
    assert "Compared with fleet.parquet, which lacks 1 of them" in text
    asked.clear()
    question = "select count(*) as n from fleet join before using (recording)"
    said = pelorus("fleet", later, "--since", target, "--ask", question, "--json").out
    assert '"n": 4' in said
    assert not asked


def test_questions_in_SQL_are_answered_and_wrong_ones_refused_in_words(
    one_by_one: dict[str, Row], tmp_path: Path, pelorus: Run
) -> None:
    path = tmp_path / "fleet.parquet"
    table.write(path, list(one_by_one.values()))
    assert {row.recording: row for row in table.read(path)} == one_by_one
    question = "select recording, error from fleet where grade = 'broken'"
    said = pelorus("fleet", path, "--ask", question).out
    assert "noise.plr" in said
    assert "drive-000" not in said
    assert "--ask: " in pelorus("fleet", path, "--ask", "select nothing from it", status=1).err
    path.write_bytes(b"PAR1 no more")
    assert f"error: {path}" in pelorus("fleet", path, status=1).err
    assert "holds no recording" in pelorus(
        "fleet", tmp_path, "--out", tmp_path / "x.parquet", status=1
    ).err.replace("\n", " ")


# --- the ranking ----------------------------------------------------------------------------------


def a_row(name: str, grade: str, cause: str | None = None, **more: object) -> Row:
    about = {"good_share": 0.9, "events": 0, "diverged": 0} | more
    return Row(name, 1, 1, "x", grade=grade, cause=cause, **about)  # type: ignore[arg-type]


def test_each_cause_is_shown_once_before_any_a_second_time() -> None:
    rows = [
        a_row("a", "bad", "slip", good_share=0.5),
        a_row("b", "bad", "slip", good_share=0.4),
        a_row("c", "bad", "jump", good_share=0.8),
        a_row("d", "care", "settings"),
        a_row("e", "good"),
        a_row("f", "bad", "slip", diverged=1, good_share=0.9),
        Row.broken(Found(Path(), "g", 1, 1), "x", "torn"),
    ]
    ranking = rank(rows)
    assert [row.recording for row in ranking.rows] == ["f", "c", "b", "a", "g", "d", "e"]
    assert (ranking.causes[0].name, len(ranking.causes[0].rows)) == ("slip", 3)
    assert ranking.summary().startswith("4 of 7 recordings cannot be trusted, 1 with care, 1 can")


def test_what_became_worse_and_by_how_much_is_told(tmp_path: Path) -> None:
    before = [
        a_row("a", "good", ate_m=0.1),
        a_row("b", "bad", "slip", ate_m=2.0, events=2),
        a_row("c", "care", events=1, ate_m=0.3),
        a_row("gone", "good"),
    ]
    now = [
        a_row("a", "bad", "<script>", ate_m=0.4, why=["it <b>slips</b>"]),
        a_row("b", "care", "slip", ate_m=1.0, events=2),
        a_row("c", "care", events=1, ate_m=0.3),
        a_row("new", "good"),
    ]
    ranking = rank(now, before)
    assert [change.words() for change in ranking.worse] == [
        "grade good -> bad, cause none -> <script>"
    ]
    assert [change.now.recording for change in ranking.better] == ["b"]
    assert (ranking.new, ranking.gone) == (1, ["gone"])
    (figure,) = ranking.figures
    assert (figure.count, figure.larger, figure.smaller, figure.most) == (3, 1, 1, "a")
    assert (figure.before, figure.now) == (0.3, 0.4)
    page = tmp_path / "page.html"
    write_page(page, ranking, "now.parquet", "before.parquet", Path("/logs"))
    text = page.read_text()
    for words in ("Worse than in before.parquet", "Better than", "Errors beside", "good -&gt; bad"):
        assert words in text
    assert "it &lt;b&gt;slips&lt;/b&gt;" in text
    assert "pelorus explain /logs/a --page look-1.html" in text


def test_the_time_left_is_spoken_as_people_do() -> None:
    assert [spoken_time(s) for s in (7.4, 99, 120, 3599, 11_100)] == [
        *("7 s", "99 s", "2 min", "1 h 0 min", "3 h 5 min"),
    ]
