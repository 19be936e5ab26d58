# SPDX-License-Identifier: MIT
"""`pelorus export`: what a log holds, as tables for other programs."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from pelorus.converters import landmark_map
from pelorus.evaluate.evaluation import made_in
from pelorus.evaluate.frame_table import HEALTH
from pelorus.io.trajectory import read_stamped
from pelorus.wire.frames import Landmark, Report, Role
from replay_drive import BIN, FRAMES, drive, log_of, points, poses_of, recorder, run


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """With landmarks that left the state."""
    out = tmp_path / "log.plr"
    run(recorder(tmp_path)(drive()), "--out", out, "--slots", "12", "--quiet")
    return out


def landmarks_of(log: Path) -> list[Landmark]:
    return [m for m in log_of(log) if isinstance(m, Landmark)]


def test_the_frame_table_agrees_with_the_log(pelorus: Run, log: Path, tmp_path: Path) -> None:
    csv = tmp_path / "a.csv"
    pelorus("export", log, "--frames", csv)
    poses = poses_of(log)
    rows = np.genfromtxt(csv, delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert len(rows) == len(poses) == FRAMES
    assert np.allclose(rows["x_m"], [p.p_WB_m[0] for p in poses], rtol=1e-8)
    assert np.allclose(rows["qz"], [np.sin(0.01 * k) for k in range(FRAMES)], atol=0.02)
    assert np.allclose(rows["var_theta_z"], [p.covariance[20] for p in poses], rtol=1e-6)
    assert (rows["trace"] > rows["var_rho_x"] + rows["var_rho_y"]).all()
    assert (rows["var_bias_wz"] > 0).all()
    reports = [m for m in log_of(log) if isinstance(m, Report)]
    for column, field in (("used", "used"), ("new", "created"), ("nis_dof", "nis_dof")):
        assert rows[column].tolist() == [getattr(report, field) for report in reports]
    assert rows["health"].tolist() == [HEALTH[report.health] for report in reports]
    assert csv.read_text().splitlines()[1].startswith("5.000000000,")


def test_the_map_to_look_at_has_every_landmark_of_the_log(
    pelorus: Run, log: Path, tmp_path: Path
) -> None:
    ply = tmp_path / "a.ply"
    pelorus("export", log, "--map", ply)
    landmarks = landmarks_of(log)
    head, body = ply.read_text().split("end_header\n")
    assert f"element vertex {len(landmarks)}" in head
    table = np.loadtxt(io.StringIO(body))
    assert {int(role) for role in table[:, 4]} == {Role.EVICTED, Role.FINAL}
    near = [i for i, m in enumerate(landmarks) if np.sqrt(m.covariance[[0, 2, 5]]).max() < 0.2]
    assert len(near) > 5
    error = np.linalg.norm(table[near, :3] - points()[table[near, 3].astype(int)], axis=1)
    assert np.median(error) < 0.3
    assert table[:, 5].tolist() == [m.times_seen for m in landmarks]
    sigma = [np.sqrt(m.covariance[[0, 2, 5]].mean()) for m in landmarks]
    assert np.allclose(table[:, 6], sigma, rtol=1e-5)


def test_the_map_as_csv_comes_back_with_its_covariance(
    pelorus: Run, log: Path, tmp_path: Path
) -> None:
    table = tmp_path / "map.csv"
    pelorus("export", log, "--map", table)
    last = {m.id: m for m in made_in(log_of(log))}  # an id that came back stands twice
    lines = table.read_text().splitlines()
    assert len(lines) == 1 + len(landmarks_of(log))
    table.write_text("\n".join([lines[0], *{row.split(",")[0]: row for row in lines[1:]}.values()]))
    back = landmark_map.convert(table, log).known
    assert {m.id for m in back} == set(last)
    for m in back:
        assert np.allclose(m.p_W_m, last[m.id].p_W_m, rtol=1e-8)
        assert np.allclose(m.covariance, last[m.id].covariance, rtol=1e-8)


def test_a_recording_is_replayed_first(pelorus: Run, tmp_path: Path) -> None:
    path, ply = recorder(tmp_path)(drive()), tmp_path / "a.ply"
    options = ("--bin", BIN, "--set", "slots=12")
    pelorus("export", path, "--map", ply, *options)
    assert "property double x" in ply.read_text()


def test_what_cannot_be_written_is_told_and_leaves_nothing(
    pelorus: Run, log: Path, tmp_path: Path
) -> None:
    said = pelorus("export", log, status=2)
    assert "say what to write" in said.err
    said = pelorus("export", log, "--map", tmp_path / "map.txt", status=1)
    assert "neither .csv nor .ply" in said.err
    said = pelorus("export", log, "--map", tmp_path / "none" / "map.ply", status=1)
    assert "cannot be written" in said.err
    said = pelorus("export", log, "--map", tmp_path / "map.ply", "--set", "slots=3", status=1)
    assert "result already" in said.err
    assert {path.name for path in tmp_path.iterdir()} == {"drive.plr", "log.plr"}


def test_the_trajectory_is_a_tum_file_that_is_read_back(
    pelorus: Run, log: Path, tmp_path: Path
) -> None:
    tum = tmp_path / "way.tum"
    pelorus("export", log, "--tum", tum)
    way, poses = read_stamped(tum), poses_of(log)
    assert way.t_ns.tolist() == [pose.t_ns for pose in poses]
    assert np.allclose(way.poses.p, [pose.p_WB_m for pose in poses], rtol=1e-8, atol=1e-12)
    assert np.allclose(way.poses.R, [pose.R_WB for pose in poses], atol=1e-8)
