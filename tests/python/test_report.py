# SPDX-License-Identifier: MIT
"""`pelorus report`: what it computes against the replay's own figures, what it draws and says."""

from __future__ import annotations

import json
import math
import re
import stat
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run as Command
from pelorus.commands.report import DRAWINGS
from pelorus.errors import PelorusError
from pelorus.evaluate.evaluation import assess, made_in, map_figures
from pelorus.evaluate.frame_table import frame_table, write_csv
from pelorus.io.trajectory import Trajectory, estimate_in, read_stamped
from pelorus.math import se3
from pelorus.math.consistency import nees_per_dof
from pelorus.native.replay import Outputs, Programs
from pelorus.report import words
from pelorus.report.comparison import Comparison, read_map
from pelorus.wire.frames import Kind, Landmark, Pose, Report, Role, Stereo, Truth
from pelorus.wire.layout import pack_symmetric, unpack_symmetric
from PIL import Image
from replay_drive import FRAMES, ROOT, drive, encode, header, known, t_ns
from replay_drive import run as run_replay
from report_runs import built_programs, compared, recorded

ALWAYS = {"top-view", "map"}
WITH_TRUTH = ALWAYS | {"hero"}
ALSO = ("--also", "course", "--also", "world")
RUNS = ("yours", "dead-reckoning", "course", "world")


@pytest.fixture
def programs() -> Programs:
    return built_programs()


def pictures_in(folder: Path) -> set[str]:
    return {path.stem for path in folder.glob("*.png")}


# --- numbers --------------------------------------------------------------------------------------


def test_mean_NEES_is_the_one_that_the_replay_reports(tmp_path: Path, programs: Programs) -> None:
    found = compared(recorded(tmp_path, drive()), programs)
    for run in found.runs:
        accuracy = found.accuracy[run.name]
        assert len(accuracy.nees) == FRAMES
        assert math.isnan(accuracy.nees[0])
        mean = float(np.nanmean(accuracy.nees))
        assert mean == pytest.approx(run.summary["nees_per_dof"], rel=1e-3, abs=1e-9)


def test_error_is_the_one_of_the_summary(tmp_path: Path, programs: Programs) -> None:
    found = compared(recorded(tmp_path, drive()), programs)
    body = found.accuracy["yours"]
    rotation = np.degrees(np.sqrt(np.mean(np.sum(body.error[:, 3:] ** 2, axis=1))))
    assert rotation == pytest.approx(found.main.summary["rot_deg"], rel=1e-4)
    assert np.all(body.sigma > 0)


def test_poses_of_the_log_are_those_of_the_trajectory_file(
    tmp_path: Path, programs: Programs
) -> None:
    found = compared(recorded(tmp_path, drive()), programs)
    written = read_stamped(Outputs.named(tmp_path / "runs", "yours").trajectory)
    assert np.array_equal(written.t_ns, found.main.trajectory.t_ns)
    assert np.allclose(written.poses.p, found.main.trajectory.poses.p, atol=1e-7)


def test_truth_in_another_world_changes_no_error() -> None:
    chance = np.random.default_rng(3)
    path = se3.exp(chance.normal(size=(30, 3)), chance.normal(scale=0.3, size=(30, 3)))
    off = se3.exp(chance.normal(scale=0.01, size=(30, 3)), chance.normal(scale=0.01, size=(30, 3)))
    estimate = Trajectory(np.arange(30), se3.compose(path, off))
    P = np.tile(1e-4 * np.eye(6), (30, 1, 1))
    by = se3.exp([5.0, -3.0, 1.0], [0.2, 1.0, -0.4])
    here = assess(estimate, Trajectory(estimate.t_ns, path), P)
    there = assess(estimate, Trajectory(estimate.t_ns, se3.compose(by, path)), P)
    assert here is not None
    assert there is not None
    assert np.allclose(here.error, there.error, atol=1e-12)
    assert np.allclose(here.error[0], 0, atol=1e-12)
    assert np.allclose(there.truth.p, here.truth.p, atol=1e-12)


def test_NEES_of_drawn_errors_is_one_and_knows_correlations() -> None:
    chance = np.random.default_rng(4)
    root = np.tril(chance.normal(size=(6, 6))) + 3 * np.eye(6)
    error = chance.normal(size=(4000, 6)) @ root.T
    P = np.tile(root @ root.T, (4000, 1, 1))
    assert np.nanmean(nees_per_dof(error, P)) == pytest.approx(1, abs=0.04)
    assert np.nanmean(nees_per_dof(3 * error, P)) == pytest.approx(9, abs=0.4)


def test_NEES_leaves_out_what_is_no_covariance() -> None:
    P = np.tile(np.eye(6), (4, 1, 1))
    P[1, 2, 2], P[2, 0, 0] = -1, np.nan
    found = nees_per_dof(np.ones((4, 6)), P)
    assert np.isnan(found[1:3]).all()
    assert found[[0, 3]] == pytest.approx(1)


def test_packed_covariances_are_lower_triangles_row_by_row() -> None:
    whole = unpack_symmetric(np.arange(6, dtype=np.float64)[None], 3)[0]
    assert whole.tolist() == [[0, 1, 3], [1, 2, 4], [3, 4, 5]]


def test_poses_between_the_frames_are_left_out() -> None:
    poses = [Pose(k, p_WB_m=np.array([k, 0.0, 0.0]), after_stereo=k % 2 == 1) for k in range(6)]
    found = estimate_in([header(), *poses])
    assert found is not None
    trajectory, covariance = found
    assert trajectory.t_ns.tolist() == [1, 3, 5]
    assert trajectory.poses.p[:, 0].tolist() == [1, 3, 5]
    assert covariance.shape == (3, 6, 6)
    assert estimate_in([header(), *poses[::2]]) is None


def test_a_refused_frame_has_no_estimate_but_its_counts(tmp_path: Path) -> None:
    t = 1_699_999_999_000_000_001
    seen = Stereo(t, np.zeros(0, np.uint32), np.zeros((0, 4), np.float32))
    good = (Report(t, Kind.STEREO, used=4), Report(t, Kind.STEREO, status=-6, health=2, used=7))
    pose = Pose(t, after_stereo=True, trace=2.5)
    between = Pose(t, p_WB_m=np.ones(3))  # after a twist
    log = [seen, pose, good[0], between, seen, good[1]]  # the same time again is refused
    table = frame_table(log)
    assert table.t_ns.tolist() == [t, t]
    assert table["trace"][0] == 2.5
    assert np.isnan(table["x_m"]).tolist() == [False, True]
    assert math.isnan(table["trace"][1])
    assert table["used"].tolist() == [4, 7]
    write_csv(tmp_path / "frames.csv", table)
    titles, first, second = (tmp_path / "frames.csv").read_text().splitlines()
    cells = dict(zip(titles.split(","), second.split(","), strict=True))
    assert first.startswith("1699999999.000000001,0,0,0,")
    assert (cells["trace"], cells["status"], cells["health"]) == ("", "-6", "lost")
    with pytest.raises(PelorusError, match="no answer to a stereo frame"):
        frame_table([between])


def test_a_map_without_landmarks_is_empty() -> None:
    known = Landmark(3, np.array([4.0, 5, 6]), np.ones(6), Role.KNOWN)
    assert read_map([known]).p_W_m.shape == (0, 3)
    made = Landmark(7, np.array([1.0, 2, 3]), np.array([0.5, 9, 0.25, 9, 9, 0]), Role.EVICTED)
    assert read_map([known, made]).p_W_m.tolist() == [[1, 2, 3]]
    assert read_map([known, made]).sigma_m.tolist() == [0.5]


# --- the runs -------------------------------------------------------------------------------------


def test_settings_hold_for_all_runs_but_the_course(tmp_path: Path, programs: Programs) -> None:
    found = compared(recorded(tmp_path, drive()), programs, "--pixel-sigma", "0.625")
    sigmas = {run.name: run.summary["pixel_sigma"] for run in found.runs}
    assert tuple(sigmas) == RUNS
    assert sigmas["yours"] == sigmas["world"] == sigmas["dead-reckoning"] == 0.625
    assert sigmas["course"] == pytest.approx(math.sqrt(5))
    precisions = [run.summary["precision"] for run in found.runs]
    assert precisions == ["float32", "float32", "float64", "float64"]
    models = [found.run(name).summary["model"] for name in ("yours", "course", "world")]
    assert models == ["body", "world", "world"]
    assert found.run("dead-reckoning").summary["used"] == 0


@pytest.mark.parametrize(("given", "due"), [("0", 60.0), ("15", 15.0)])
def test_world_has_a_depth_limit(
    tmp_path: Path, programs: Programs, given: str, due: float
) -> None:
    config = tmp_path / "robot.conf"
    config.write_text(f"max-depth = {given}  # m\n")
    found = compared(recorded(tmp_path, drive()), programs, "--config", str(config))
    assert found.run("world").summary["max_depth"] == due
    assert found.main.summary["max_depth"] == float(given)


# --- the command ----------------------------------------------------------------------------------


def titles(said: str) -> list[str]:
    """Returns the titles of the runs' table, which is below the verdict."""
    return next(line for line in said.splitlines() if line.split()[:1] == ["yours"]).split()


def test_report_leaves_page_pictures_and_runs(
    pelorus: Command, tmp_path: Path, programs: Programs
) -> None:
    path, out = recorded(tmp_path, drive()), tmp_path / "a" / "out"
    said = pelorus("report", path, "--out", out, "--bin", programs.float32.parent, *ALSO)
    assert pictures_in(out) == set(DRAWINGS)
    assert titles(said.out) == list(RUNS)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert (
        page.count("data:image/png;base64,") == 2
    )  # map, covariance; the others are for elsewhere
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)
    assert "Position error of each run" in page
    for name in RUNS:
        assert name in said.out
        assert f'<td data-head="run">{name}</td>' in page
        for end in ("tum", "plr", "json"):
            assert (out / "runs" / f"{name}.{end}").stat().st_size > 0
    with Image.open(out / "hero.png") as hero:
        assert hero.width == 1200


def test_without_truth_no_error_is_claimed(
    pelorus: Command, tmp_path: Path, programs: Programs
) -> None:
    path = recorded(tmp_path, [m for m in drive() if not isinstance(m, Truth)])
    (tmp_path / "nees.png").write_bytes(b"of an earlier version's report")
    (tmp_path / "hero.png").write_bytes(b"of an earlier report")
    (tmp_path / "mine.png").write_bytes(b"none of ours")
    said = pelorus("report", path, "--out", tmp_path, "--bin", programs.float32.parent)
    (tmp_path / "mine.png").unlink()
    assert pictures_in(tmp_path) == ALWAYS
    rows = said.out.splitlines()
    assert titles(said.out) == ["yours", "dead-reckoning"]
    for title in ("err0 m", "ATE m", "rotation deg", "NEES/6"):
        row = next(line for line in rows if line.startswith(title))
        assert row.removeprefix(title).split() == ["-", "-"]
    assert "no truth" in said.out


@pytest.mark.parametrize(("frames", "due"), [(1, {"top-view"}), (3, WITH_TRUTH)])
def test_a_handful_of_frames_is_enough(
    pelorus: Command, tmp_path: Path, programs: Programs, frames: int, due: set[str]
) -> None:
    path = recorded(tmp_path, drive(frames))
    said = pelorus("report", path, "--out", tmp_path, "--bin", programs.float32.parent)
    assert pictures_in(tmp_path) == due
    assert "Too few frames have truth" in said.out
    assert "NEES/6 is" not in said.out


def test_the_report_leads_with_the_users_own_run_and_the_others_are_asked_for(
    pelorus: Command, tmp_path: Path, programs: Programs
) -> None:
    path = recorded(tmp_path, drive())
    options = ("--bin", programs.float32.parent, "--set", "model=world", "--also", "course")
    said = pelorus("report", path, "--out", tmp_path, *options)
    assert titles(said.out) == ["yours", "dead-reckoning", "course"]
    own = json.loads((tmp_path / "runs" / "yours.json").read_text(encoding="utf-8"))
    assert own["model"] == "world"  # the settings are the user's, whatever they say
    assert not (tmp_path / "runs" / "world.plr").exists()


def test_the_report_says_from_when_to_when_health_was_not_good_and_why(
    pelorus: Command, tmp_path: Path, programs: Programs
) -> None:
    messages = drive(60)
    seen = [k for k, m in enumerate(messages) if isinstance(m, Stereo)]
    for k in range(30, 50):  # t = 3.0 to 4.9 s: the camera repeats a picture
        frozen = messages[seen[29]]
        assert isinstance(frozen, Stereo)
        messages[seen[k]] = replace(frozen, t_ns=t_ns(k))
    path = recorded(tmp_path, messages)
    said = pelorus("report", path, "--out", tmp_path, "--bin", programs.float32.parent)
    lines = [line.strip() for line in said.out.splitlines()]
    assert any(re.match(r"lost from 3\.9 to 4\.9 s \(\d+ frames\): identical", x) for x in lines)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(line in page for line in lines if line.startswith(("lost", "degraded")))
    shown = pelorus("info", tmp_path / "runs" / "yours.plr").out
    assert any(line.strip().startswith("lost from 3.9 to 4.9 s") for line in shown.splitlines())


def test_a_replay_that_fails_ends_the_report_with_its_words(
    pelorus: Command, tmp_path: Path, programs: Programs
) -> None:
    path = recorded(tmp_path, [m for m in drive() if not isinstance(m, Stereo)])
    said = pelorus("report", path, "--out", tmp_path, "--bin", programs.float32.parent, status=1)
    assert "drive.plr: pelorus-replay ended with status 1" in said.err
    assert "no frame could be used" in said.err
    assert not (tmp_path / "report.html").exists()


def test_a_crash_of_the_replay_is_told(pelorus: Command, tmp_path: Path) -> None:
    for name in ("pelorus-replay", "pelorus-replay-f64"):
        program = tmp_path / name
        program.write_text("#!/bin/sh\nkill -SEGV $$\n")
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
    path = recorded(tmp_path, drive(3))
    said = pelorus("report", path, "--out", tmp_path / "out", "--bin", tmp_path, status=1)
    assert "ended with signal 11" in said.err


def test_an_unknown_setting_is_the_replays_to_refuse(
    pelorus: Command, tmp_path: Path, programs: Programs
) -> None:
    path, bin_ = recorded(tmp_path, drive(3)), programs.float32.parent
    said = pelorus(
        "report", path, "--out", tmp_path, "--bin", bin_, "--set", "nonsense=1", status=1
    )
    assert "--nonsense: unknown option" in said.err
    said = pelorus("report", path, "--out", tmp_path, "--bin", bin_, "--set", "nonsense", status=2)


def test_lacking_programs_and_places_are_named(
    pelorus: Command, tmp_path: Path, programs: Programs
) -> None:
    path, empty = recorded(tmp_path, drive(3)), tmp_path / "empty"
    said = pelorus("report", path, "--out", tmp_path, "--bin", empty, status=1)
    assert "PELORUS_BIN" in said.err
    blocked = tmp_path / "file"
    blocked.write_text("")
    said = pelorus("report", path, "--out", blocked, "--bin", programs.float32.parent, status=1)
    assert "cannot be made" in said.err
    said = pelorus("report", tmp_path / "nothing.plr", "--out", tmp_path, status=1)
    assert "there is no such file" in said.err


# --- what is off ----------------------------------------------------------------------------------


def lines_with(found: Comparison, **changes: Any) -> str:
    """The remarks, were body's summary another."""
    body = found.main
    other = replace(body, summary=body.summary | changes)
    runs = [other if run is body else run for run in found.runs]
    return "\n".join(line for line in words.remarks(Comparison(found.subject, runs)))


def test_verdicts_name_what_is_off(tmp_path: Path, programs: Programs) -> None:
    found = compared(recorded(tmp_path, drive()), programs)
    assert "yours: slower than real time" in lines_with(found, realtime_factor=0.5)
    assert "yours: 7 of 47 frames were refused" in lines_with(found, frames_refused=7)
    assert "dead-reckoning:" not in lines_with(found)
    assert "yours: no better than dead reckoning" in lines_with(found, ate_m=99.0)
    assert "found no slot" in lines_with(found, no_room=found.main.summary["observations"])


def test_it_is_said_whether_a_gate_is_inert_or_locked(tmp_path: Path, programs: Programs) -> None:
    found = compared(recorded(tmp_path, drive()), programs)
    reasons = found.main.frames["reasons"]
    reasons[:] = words.GATE_INERT
    assert "yours: gate inert" not in lines_with(found)  # the verdict judges the gate of the user
    assert "course: gate inert in 6 frames" in lines_with(found)
    reasons[:] = words.GATE_LOCKED
    assert "yours: gate locked in 40 frames" in lines_with(found)


@pytest.mark.parametrize("name", ["GATE_LOCKED", "GATE_INERT", "NIS_HIGH", "NOT_POSITIVE"])
def test_reasons_are_those_of_the_library(name: str) -> None:
    types = (ROOT / "include" / "pelorus" / "types.h").read_text(encoding="utf-8")
    bit = re.search(rf"PLR_REASON_{name} = 1 << (\d+)", types)
    assert bit is not None
    assert getattr(words, name) == 1 << int(bit.group(1))


def test_another_programs_way_stands_beside_the_drives_own(
    pelorus: Command, tmp_path: Path, programs: Programs
) -> None:
    path, way = recorded(tmp_path, drive()), tmp_path / "other.tum"
    bin_ = ("--bin", programs.float32.parent)
    pelorus("export", path, "--tum", way, *bin_)
    rows = np.loadtxt(way)
    rows[:, 1:4] += [100.0, -20.0, 3.0]  # in a world of its own
    np.savetxt(way, rows, fmt="%.9f")
    pelorus("report", path, "--out", tmp_path / "out", "--beside", way, *bin_)
    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert '"name":"other"' in page
    rows[:, 0] += 1e3
    np.savetxt(way, rows, fmt="%.9f")
    said = pelorus("report", path, "--out", tmp_path / "b", "--beside", way, *bin_, status=1)
    assert "none of its times is that of a frame" in said.err


def test_a_bias_that_is_suggested_and_not_estimated_is_told(
    tmp_path: Path, programs: Programs
) -> None:
    noise = replace(header().noise, bias_gyro_sigma_radps=0.01)
    messages = [header(noise=noise), *drive()[1:]]
    found = compared(recorded(tmp_path, messages), programs, "--bias", "off")
    assert "try --set bias=on" in lines_with(found)


# --- maps ---------------------------------------------------------------------------------------


def test_where_poses_are_given_the_map_is_judged_and_not_the_poses(
    pelorus: Command, tmp_path: Path, programs: Programs
) -> None:
    path = recorded(tmp_path, [header(), *known(), *drive()[1:]])
    options = ("--bin", programs.float32.parent, "--set", "pixel-sigma=0.5")
    said = pelorus("report", path, "--out", tmp_path, *options, "--set", "mode=mapping", *ALSO)
    assert "yours: its poses were given; the map of" in said.out
    assert "not positive" not in said.out  # the given poses have no covariance
    assert "hero" not in pictures_in(tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    body = re.search(r"<tr><td[^>]*>yours</td>(.*?)</tr>", page)
    assert body is not None
    cells = re.findall(r"<td[^>]*>(.*?)</td>", body.group(1))
    assert cells[:4] == ["-"] * 4
    assert 0 < float(cells[4]) < 0.5


def test_a_map_is_compared_in_the_estimates_world_and_by_its_covariance() -> None:
    chance = np.random.default_rng(5)
    points = chance.uniform(-20, 20, (400, 3))
    root = np.tril(chance.normal(size=(3, 3))) + 2 * np.eye(3)
    packed = pack_symmetric(0.01 * root @ root.T)
    A = se3.exp([5.0, -3.0, 1.0], [0.2, 1.0, -0.4])
    truth = [Landmark(k, p) for k, p in enumerate(points)]
    mine = se3.apply(A, points) + 0.1 * chance.normal(size=(400, 3)) @ root.T
    result = [Landmark(k, p, packed, Role.FINAL) for k, p in enumerate(mine)]
    found = map_figures([*result, Landmark(999, mine[0], packed, Role.FINAL)], truth, A)
    assert found["map_landmarks"] == 400
    assert found["map_nees_per_dof"] == pytest.approx(1, abs=0.15)
    assert found["map_rms_m"] == pytest.approx(0.1 * np.sqrt(np.trace(root @ root.T)), rel=0.1)
    assert map_figures(made_in(truth), truth, A)["map_landmarks"] == 0  # known ones are no result


def test_evaluate_compares_the_map_of_a_result(pelorus: Command, tmp_path: Path) -> None:
    path = recorded(tmp_path, [header(), *known(), *drive()[1:]])
    for mode, pose in (("mapping", False), ("slam", True)):
        log = tmp_path / f"{mode}.plr"
        done = run_replay(path, "--mode", mode, "--pixel-sigma", "0.5", "--out", log, "--quiet")
        assert done.status == 0, done.stderr
        said = pelorus("evaluate", log, "--truth", path, "--json")
        found = json.loads(said.out)
        assert (found["err0_m"] is not None) is pose
        assert 0 < found["map_median_m"] < 0.3
    bare = tmp_path / "bare.plr"
    bare.write_bytes(encode(drive()))
    run_replay(bare, "--mode", "mapping", "--out", log, "--quiet")
    said = pelorus("evaluate", log, "--truth", bare, status=1)
    assert "there is nothing to compare" in said.err


# --- what cannot be compared ----------------------------------------------------------------------


def test_comparisons_that_take_twists_alone_are_refused_for_an_imu(
    tmp_path: Path, pelorus: Command, programs: Programs
) -> None:
    path = tmp_path / "imu.plr"
    pelorus("simulate", path, "--imu-rate", "200", "--duration", "2")
    also = ("--also", "world", "--bin", programs.float32.parent)
    said = pelorus("report", path, "--out", tmp_path / "out", *also, status=1)
    assert "holds an IMU's readings, and --also world asks for a filter that takes" in said.err
    assert not (tmp_path / "out").exists()
