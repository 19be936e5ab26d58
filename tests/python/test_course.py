# SPDX-License-Identifier: MIT
"""`pelorus course`: the whole map's trace, the figures, the table, and the course's own figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run as Command
from draws import long_run
from drives import clean, npz_arrays, with_stale_tracks
from pelorus.evaluate import road
from pelorus.report.comparison import traces
from pelorus.wire.frames import Config, Kind, Landmark, Message, Report, Role, Stereo, Truth
from pelorus.wire.framing import messages_of
from pelorus.wire.settings import IDS
from pelorus_course import ece276a
from PIL import Image
from replay_drive import BIN, ROOT, drive, encode, header
from report_runs import built_programs

PRIOR = 6.0  # trace of 2 I

# --- the whole map's trace ------------------------------------------------------------------------


def frame(k: int, *ids: int, disparity: float = 5.0) -> list[Message]:
    """A frame and its report."""
    pixels = np.tile(np.array([disparity, 0, 0, 0], np.float32), (len(ids), 1))
    return [Stereo(k, np.array(ids, np.uint32), pixels), Report(k, subject=Kind.STEREO)]


def gone(id: int, variance: float, role: Role = Role.EVICTED) -> Landmark:
    return Landmark(id, covariance=variance * np.array([1.0, 9, 1, 9, 9, 1]), role=role)


def whole(messages: list[Message], active: list[float]) -> Any:
    t_ns = np.arange(len(active))
    return traces([header(), *messages], t_ns, np.array(active)).whole.tolist()


def test_landmarks_not_seen_yet_stand_at_their_prior() -> None:
    drive_on = [*frame(0, 1, 2), *frame(1, 1, 3), *frame(2, 4)]
    assert whole(drive_on, [1.0, 2.0, 3.0]) == [1 + 2 * PRIOR, 2 + PRIOR, 3]


def test_a_landmark_that_has_left_keeps_the_covariance_with_which_it_left() -> None:
    first, second, third = frame(0, 1), frame(1, 2), frame(2, 2)
    messages = [*first, second[0], gone(1, 0.5), second[1], *third, gone(2, 7.0, Role.FINAL)]
    assert whole(messages, [1.0, 1.0, 1.0]) == [1 + PRIOR, 1 + 1.5, 1 + 1.5]


def test_a_landmark_that_comes_back_is_not_counted_twice() -> None:
    second = frame(1, 2)
    messages = [*frame(0, 1), second[0], gone(1, 0.5), second[1], *frame(2, 1)]
    assert whole(messages, [1.0, 1.0, 2.0])[2] == 2


def test_an_observation_of_which_no_landmark_can_be_made_does_not_count_as_seen() -> None:
    config = Config({IDS["min-disparity"]: 0.1}, build_fingerprint=1)
    messages = [config, *frame(0, 1, disparity=0.05), *frame(1, 1, disparity=0.2)]
    assert whole(messages, [1.0, 1.0]) == [1 + PRIOR, 1]


def test_the_prior_is_the_landmark_sigma_in_force() -> None:
    config = Config({IDS["landmark-sigma"]: 0.5}, build_fingerprint=1)
    assert whole([config, *frame(0, 1), *frame(1, 2)], [1.0, 1.0]) == [1 + 0.75, 1]


# --- ids as they stand in the file ----------------------------------------------------------------


def test_ids_can_be_kept_where_all_else_is_mended(tmp_path: Path) -> None:
    stale, repeated = with_stale_tracks(clean(), range(40, 42))
    path = tmp_path / "drive.npz"
    np.savez(path, **npz_arrays(stale))
    split, _ = ece276a.convert(path)
    kept, findings = ece276a.convert(path, keep_ids=True)
    assert repeated > 0
    assert len(set(kept.tracks.id.tolist())) < len(set(split.tracks.id.tolist()))
    assert np.array_equal(kept.tracks.id, ece276a.read(path).tracks.id)
    assert np.array_equal(kept.header.R_CB, split.header.R_CB)
    assert kept.header.noise == split.header.noise
    assert "left as they are" in findings[0].action


# --- the fit to a road ----------------------------------------------------------------------------


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_what_is_fitted_to_a_road_lies_on_it(mirror: float) -> None:
    t = np.linspace(0, 1, 400)
    way = np.stack((300 * t, 40 * np.sin(5 * t) + 60 * t**2), axis=-1)
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    driven = np.column_stack((way * [1, mirror], 0.02 * way[:, 0])) @ turn + [5, 6, 7]
    found = road.fit(driven, way, 10.0)
    assert found.figures.road_m < 0.35  # the road's points are a metre apart: 1 / sqrt(12)
    assert np.abs(found.place(driven) - way).max() < 0.6


# --- the command ----------------------------------------------------------------------------------


def recorded(folder: Path, name: str, messages: list[Message]) -> Path:
    path = folder / f"{name}.plr"
    path.write_bytes(encode(messages))
    return path


def without_truth() -> list[Message]:
    return [m for m in drive() if not isinstance(m, Truth)]


def test_figures_and_table_are_made_in_one_go(pelorus: Command, tmp_path: Path) -> None:
    built_programs()
    one = recorded(tmp_path, "one", drive())
    two = recorded(tmp_path, "two", drive())
    said = pelorus("course", one, two, "--out", tmp_path / "out", "--bin", BIN)
    for name in ("figure1.png", "figure2.png"):
        with Image.open(tmp_path / "out" / name) as picture:
            assert picture.width > 1000
    table = (tmp_path / "out" / "table.md").read_text().splitlines()
    assert len(table) == 2 + 2 * 3
    for run in ("dead reckoning", "the course's filter", "Pelorus (body)"):
        assert sum(run in line for line in table) == 2
        assert all(word in said.out for word in run.split()), "the terminal's table wraps words"
    assert "the whole map of" in said.out


def test_the_course_filter_can_be_changed_to_try_its_claims(
    pelorus: Command, tmp_path: Path
) -> None:
    built_programs()
    path, common = recorded(tmp_path, "one", drive(sigma_px=1)), ("--bin", BIN)
    rows = []
    for changes in ((), ("--course", "landmark-sigma=0.001", "--course", "gate=off")):
        pelorus("course", path, "--out", tmp_path / "out", "--force", *common, *changes)
        rows.append((tmp_path / "out" / "table.md").read_text().splitlines()[2:])
    assert rows[0][1] != rows[1][1]  # the course's
    assert rows[0][0] == rows[1][0]
    assert rows[0][2] == rows[1][2]


def test_a_truth_is_taken_for_the_one_recording_that_has_none(
    pelorus: Command, tmp_path: Path
) -> None:
    built_programs()
    known, bare = recorded(tmp_path, "known", drive()), recorded(tmp_path, "bare", without_truth())
    common = ("--force", "--out", tmp_path / "out", "--bin", BIN, "--truth")
    pelorus("course", bare, *common, known)
    cells = (tmp_path / "out" / "table.md").read_text().splitlines()[4].split("|")
    ate = float(cells[5])
    assert 0 < ate < 0.5
    said = pelorus("course", known, *common, known, status=1)
    assert "0 of the 1 recordings lack a TRUTH" in said.err


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--config", "a.conf", "--config", "b.conf"), "2 config files for 1 recordings"),
        (("--truth", "a", "--road", "b"), "one of them, not both"),
        (("--set", "bias"), "not NAME=VALUE"),
    ],
)
def test_options_that_make_no_sense_are_refused(
    pelorus: Command, tmp_path: Path, options: tuple[str, ...], word: str
) -> None:
    path, folder = recorded(tmp_path, "one", drive(3)), tmp_path / "out"
    said = pelorus("course", path, "--out", folder, "--bin", BIN, *options, status=2)
    assert word in " ".join(said.err.split())
    assert not folder.exists()


def test_two_recordings_of_one_name_are_refused(pelorus: Command, tmp_path: Path) -> None:
    path, other = recorded(tmp_path, "one", drive(3)), tmp_path / "x"
    other.mkdir()
    again = recorded(other, "one", drive(3))
    said = pelorus("course", path, again, "--out", tmp_path / "out", "--bin", BIN, status=2)
    assert "same name" in " ".join(said.err.split())


# --- the course's recordings ----------------------------------------------------------------------


def numbers(line: str) -> dict[str, Any]:
    """A row of table.md by its titles."""
    from pelorus_course.table import TITLES  # noqa: PLC0415 - matplotlib loads slowly

    return dict(zip(TITLES, (cell.strip() for cell in line.strip("|\n").split("|")), strict=True))


@long_run
def test_the_course_filter_is_what_the_report_says_on_03(
    pelorus: Command, real: Callable[[str], Path], plr_03: Path, tmp_path: Path
) -> None:
    """The road within 5 m; with the file's own ids, the whole map's trace falls as in figure 2."""
    source, way = real("ece276a/03.npz"), real("truth/kitti360-0003-path.csv")
    kept = tmp_path / "03-ids.plr"
    pelorus("convert", "ece276a", source, kept, "--keep-ids")
    config = ("--config", ROOT / "tools" / "config" / "03.conf")
    common = ("--force", "--out", tmp_path / "out", "--bin", BIN)
    pelorus("course", plr_03, *common, *config, "--road", way)
    dead, course, body = map(numbers, (tmp_path / "out" / "table.md").read_text().splitlines()[2:])
    assert float(course["road m"]) <= 5.0
    assert float(body["road m"]) < float(course["road m"]) < float(dead["road m"])
    pelorus("course", kept, *common)
    log = tmp_path / "out" / "runs" / "03-ids" / "course.plr"
    assert len({id for m in messages_of(log) if isinstance(m, Stereo) for id in m.ids}) == 5105
    text = numbers((tmp_path / "out" / "table.md").read_text().splitlines()[3])["trace, whole map"]
    first, last = (float(word.replace(",", "")) for word in text.split(" to "))
    assert first == pytest.approx(30_400, rel=0.005)
    assert last == pytest.approx(3_000, rel=0.15)


def test_the_course_filter_stays_within_8_m_on_0027(
    pelorus: Command, plr_0027: Path, tmp_path: Path
) -> None:
    pelorus("course", plr_0027, "--out", tmp_path / "out", "--bin", BIN)
    course = numbers((tmp_path / "out" / "table.md").read_text().splitlines()[3])
    assert float(course["ATE m"]) <= 8.0
    assert float(course["NEES/6"]) > 1000  # and it has no idea how wrong it is
