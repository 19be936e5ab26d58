# SPDX-License-Identifier: MIT
"""`pelorus-textbook`: either model with every landmark kept, beside the replay."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from pelorus.io.trajectory import read_stamped
from pelorus.wire.frames import Kind, Landmark, Stereo
from replay_drive import (
    BIN,
    EXACT_CAMERA,
    USAGE,
    Record,
    Result,
    drive,
    err0_m,
    header,
    judged,
    known,
    log_of,
    run,
    t_ns,
)

TEXTBOOK = "pelorus-textbook"
MEMORY = 5
COURSE = ("--preset", "course")


def textbook(*arguments: str | Path, stdin: bytes = b"") -> Result:
    return run(*arguments, program=TEXTBOOK, stdin=stdin, status=None)


@pytest.mark.parametrize(
    "options",
    [
        COURSE,
        (*COURSE, "--landmark-prior", "correlated", "--gate-residual", "0"),
        ("--model", "world", "--max-depth", "30", "--bias", "on"),
        (*COURSE, "--mode", "dead_reckoning"),
        (),
        ("--bias", "off", "--max-depth", "20"),
        ("--gate-residual", "20"),
        ("--mode", "dead_reckoning"),
    ],
)
def test_with_slots_for_all_the_replay_computes_the_same(
    record: Record, tmp_path: Path, options: tuple[str, ...]
) -> None:
    path = record(drive())
    ways = []
    summaries = []
    for program in (TEXTBOOK, "pelorus-replay-f64"):
        way = tmp_path / f"{program}.tum"
        slots = ("--slots", "256", "--trajectory", way)
        summaries.append(judged(path, *options, *EXACT_CAMERA, *slots, program=program))
        ways.append(read_stamped(way))
    assert summaries[0].keys() == summaries[1].keys()
    for count in ("frames", "matched", "used", "gated", "new", "poor", "evicted"):
        assert summaries[0][count] == summaries[1][count], count
    assert np.abs(ways[0].poses.p - ways[1].poses.p).max() < 1e-6
    assert summaries[0]["nees_per_dof"] == pytest.approx(summaries[1]["nees_per_dof"], rel=1e-4)


def test_no_landmark_leaves_it(record: Record, tmp_path: Path) -> None:
    path, log = record(drive()), tmp_path / "log.plr"
    few = run(path, *COURSE, "--slots", "5", "--json", program="pelorus-replay-f64").summary
    assert few["evicted"] > 0
    result = textbook(path, *COURSE, "--slots", "5", "--json", "--out", log)
    assert result.summary["evicted"] == 0
    kept = [message for message in log_of(log) if message.kind is Kind.LANDMARK]
    assert len(kept) == result.summary["new"]
    assert all(isinstance(landmark, Landmark) for landmark in kept)
    assert "every landmark kept" in textbook(path, *COURSE).stdout


@pytest.mark.parametrize("model", [COURSE, ("--model", "body")])
def test_known_landmarks_locate_it(record: Record, model: tuple[str, ...]) -> None:
    path = record([header(), *known(), *drive()[1:]])
    options = (*model, "--mode", "localization")
    mine, theirs = judged(path, *options, program=TEXTBOOK), judged(path, *options)
    assert mine["used"] == theirs["used"] > 0
    assert mine["err0_m"] == pytest.approx(theirs["err0_m"], abs=1e-3)


def test_the_memory_is_told_first_and_refused_where_it_is_not_there(
    record: Record, tmp_path: Path
) -> None:
    path = record(drive(5))
    assert "all of them kept: P is" in textbook(path, *COURSE).stderr
    assert textbook(path, *COURSE, "--quiet").stderr == ""
    pixels = np.tile(np.array([330, 240, 310, 240], dtype=np.float32), (1000, 1))
    ids = np.arange(1000, dtype=np.uint32)
    crowd = [Stereo(t_ns(k), ids + 1000 * k, pixels) for k in range(30)]
    way = tmp_path / "never.tum"
    arguments = f"{BIN / TEXTBOOK} {record([header(), *crowd])} --preset course --trajectory {way}"
    done = subprocess.run(  # 30,000 landmarks: 65 GB
        ["bash", "-c", f"ulimit -v 8000000; exec {arguments}"],
        capture_output=True,
        check=False,
        text=True,
        timeout=1800,
    )
    assert done.returncode == MEMORY
    assert "P is 90006 x 90006 numbers" in done.stderr
    assert "not enough memory: 6" in done.stderr
    assert not way.exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((*COURSE, "--save-state", "s.state"), "keeps no states"),
        ((*COURSE, "--load-state", "s.state"), "keeps no states"),
        ((*COURSE, "--preset", "cuorse"), "course"),
    ],
)
def test_what_the_textbook_has_not_is_refused_by_name(
    record: Record, options: tuple[str, ...], words: str
) -> None:
    result = textbook(record(drive(2)), *options)
    assert result.status == USAGE
    assert words in result.stderr
    assert not Path("s.state").exists()


def test_the_standard_input_is_read_twice(record: Record, tmp_path: Path) -> None:
    path = record(drive())
    log = tmp_path / "piped.plr"
    result = textbook("-", *COURSE, "--json", "--out", log, stdin=path.read_bytes())
    whole = judged(path, *COURSE, program=TEXTBOOK)
    assert err0_m(log) == whole["err0_m"]
    assert result.summary["used"] == whole["used"]


def test_what_is_no_recording_is_told_as_the_replay_tells_it(tmp_path: Path) -> None:
    path = tmp_path / "none.plr"
    path.write_bytes(b"nothing of ours")
    mine, theirs = textbook(path, *COURSE), run(path, *COURSE, status=None)
    assert mine.status == theirs.status
    assert mine.stderr == theirs.stderr.replace("pelorus-replay", TEXTBOOK)
