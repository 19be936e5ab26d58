# SPDX-License-Identifier: MIT
"""pelorus-replay over a drive on which the filter diverges: what its summary and its log say then.

`world` in float32 from a start that is hardly known (docs/NUMERICS.md, section 2).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from pelorus.frames import Report
from pelorus.frames.filter import UNKNOWN_VARIANCE
from pelorus.report.accuracy import assess
from pelorus.report.results import read_frames, read_poses
from pelorus.se3 import Poses
from pelorus.trajectory import Trajectory
from replay_drive import (
    OK,
    Result,
    drive,
    log_of,
    poses_of,
    recorder,
    run,
    t_ns,
    true_pose,
)

FRAMES = 60
DIVERGED = 3  # plr_health
OPTIONS = ("--model", "world", "--start-sigma", "100")


def replay(folder: Path, *options: str) -> Result:
    path = recorder(folder)(drive(FRAMES))
    result = run(path, *OPTIONS, *options, "--out", folder / "log.plr")
    assert result.status == OK
    return result


def unknown_from(folder: Path) -> int:
    """Index of the first pose without a covariance; from there on all are, before it none."""
    unknown = [not pose.knows_covariance for pose in poses_of(folder / "log.plr")]
    assert len(unknown) == FRAMES
    first = unknown.index(True)
    assert 3 < first < FRAMES - 3
    assert all(unknown[first:])
    return first


def test_every_frame_has_a_pose_and_those_after_it_no_covariance(tmp_path: Path) -> None:
    replay(tmp_path)
    first = unknown_from(tmp_path)
    nothing_known = UNKNOWN_VARIANCE * np.eye(6)[np.tril_indices(6)]
    for k, pose in enumerate(poses_of(tmp_path / "log.plr")):
        assert pose.t_ns == t_ns(k)
        assert np.isfinite(pose.p_WB_m).all()
        if k >= first:
            assert np.array_equal(pose.covariance, nothing_known)
            assert np.array_equal(pose.velocity_covariance, nothing_known)


def test_the_summary_says_when_and_for_how_many_frames(tmp_path: Path) -> None:
    summary = replay(tmp_path, "--json").summary
    first = unknown_from(tmp_path)
    reports = [m for m in log_of(tmp_path / "log.plr") if isinstance(m, Report)]
    assert [r.health == DIVERGED for r in reports] == [k >= first for k in range(FRAMES)]
    assert summary["frames"] == FRAMES
    assert summary["frames_refused"] == 0
    assert summary["frames_diverged"] == FRAMES - first
    assert summary["diverged_s"] == pytest.approx(t_ns(first) * 1e-9, abs=1e-9)
    assert summary["truth_frames"] == FRAMES


def test_a_human_reads_the_same(tmp_path: Path) -> None:
    result = replay(tmp_path)
    first = unknown_from(tmp_path)
    assert re.search(rf"^health .* {FRAMES - first} diverged$", result.stdout, re.MULTILINE)
    assert f"the filter diverged at {t_ns(first) * 1e-9:.3f} s" in result.stderr
    assert result.stderr.count("diverged at") == 1
    left_out = re.search(r"NEES leaves out (\d+) frames", result.stdout)
    assert left_out
    assert int(left_out[1]) >= FRAMES - first


def test_nees_is_that_of_the_frames_before_and_errors_are_those_of_all(tmp_path: Path) -> None:
    summary = replay(tmp_path, "--json").summary
    first = unknown_from(tmp_path)
    truth = [true_pose(k) for k in range(FRAMES)]
    estimate, covariance = read_poses(tmp_path / "log.plr")
    real = Trajectory(
        estimate.t_ns, Poses(np.array([R for R, _ in truth]), np.array([p for _, p in truth]))
    )
    accuracy = assess(estimate, covariance, real)
    assert accuracy is not None
    assert np.isnan(accuracy.nees[first:]).all()
    assert np.isnan(accuracy.sigma[first:]).all()
    before = accuracy.nees[:first]
    assert summary["nees_per_dof"] == pytest.approx(float(np.nanmean(before)), rel=1e-3)
    assert summary["nees_left_out"] == FRAMES - 1 - np.count_nonzero(~np.isnan(before))
    moved = np.linalg.norm(accuracy.truth.p - estimate.poses.p, axis=1)
    assert summary["err0_m"] == pytest.approx(float(np.sqrt(np.mean(moved**2))), rel=1e-6)


def test_in_float64_it_does_not_diverge(tmp_path: Path) -> None:
    path = recorder(tmp_path)(drive(FRAMES))
    summary = run(path, *OPTIONS, "--json", program="pelorus-replay-f64").summary
    assert summary["frames_diverged"] == 0
    assert summary["diverged_s"] is None


def test_the_frame_table_leaves_the_variances_empty(tmp_path: Path) -> None:
    replay(tmp_path, "--frames", str(tmp_path / "frames.csv"))
    first = unknown_from(tmp_path)
    table = read_frames(tmp_path / "frames.csv")
    for name in ("var_rho_x", "var_theta_z", "trace", "var_bias_vx", "var_bias_wz"):
        assert np.isfinite(table[name][:first]).all()
        assert np.isnan(table[name][first:]).all()
    for name in ("x_m", "qw", "bias_wz"):
        assert np.isfinite(table[name]).all()
