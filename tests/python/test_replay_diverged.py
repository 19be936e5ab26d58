# SPDX-License-Identifier: MIT
"""pelorus-replay over a drive on which the filter diverges and recovers: what is told of it.

`world` in float32 from a start that is hardly known (docs/NUMERICS.md, section 2).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from pelorus.evaluate.evaluation import judge
from pelorus.evaluate.frame_table import frame_table
from pelorus.wire.frames import Report
from replay_drive import (
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
DEGRADED, LOST = 1, 2  # plr_health
NOT_POSITIVE, RECOVERED = 1 << 10, 1 << 18  # plr_reason
OPTIONS = ("--model", "world", "--start-sigma", "30")


def replay(folder: Path, *options: str) -> Result:
    path = recorder(folder)(drive(FRAMES))
    return run(path, *OPTIONS, *options, "--out", folder / "log.plr")


def recovered_at(folder: Path) -> list[int]:
    """Indices of the frames that found the filter diverged, and recovered it."""
    reports = [m for m in log_of(folder / "log.plr") if isinstance(m, Report)]
    assert len(reports) == FRAMES
    recovered = [k for k, r in enumerate(reports) if r.reasons & RECOVERED]
    assert recovered
    assert 3 < recovered[0] < FRAMES - 3
    return recovered


def test_every_frame_has_a_pose_with_a_covariance(tmp_path: Path) -> None:
    replay(tmp_path)
    recovered = recovered_at(tmp_path)
    diagonal = [i * (i + 3) // 2 for i in range(6)]
    for k, pose in enumerate(poses_of(tmp_path / "log.plr")):
        assert pose.t_ns == t_ns(k)
        assert np.isfinite(pose.p_WB_m).all()
        assert pose.knows_covariance
        if k in recovered:
            assert (np.asarray(pose.covariance)[diagonal] > 0).all()


def test_the_frame_that_recovers_says_so_and_takes_what_it_sees(tmp_path: Path) -> None:
    replay(tmp_path)
    recovered = recovered_at(tmp_path)
    reports = [m for m in log_of(tmp_path / "log.plr") if isinstance(m, Report)]
    for k in recovered:
        assert reports[k].status == 0
        assert reports[k].health in (DEGRADED, LOST)
        assert reports[k].reasons & NOT_POSITIVE
        assert reports[k].active == reports[k].created > 3
    assert all(bool(r.reasons & NOT_POSITIVE) == (k in recovered) for k, r in enumerate(reports))


def test_the_summary_says_how_often_and_when_first(tmp_path: Path) -> None:
    summary = replay(tmp_path, "--json").summary
    recovered = recovered_at(tmp_path)
    assert summary["frames"] == FRAMES
    assert summary["frames_refused"] == 0
    assert summary["frames_diverged"] == 0
    assert summary["recoveries"] == len(recovered)
    assert summary["diverged_s"] == pytest.approx(t_ns(recovered[0]) * 1e-9, abs=1e-9)


def test_a_human_reads_the_same(tmp_path: Path) -> None:
    result = replay(tmp_path)
    recovered = recovered_at(tmp_path)
    first_s = t_ns(recovered[0]) * 1e-9
    told = f"diverged and recovered {len(recovered)} times, first at {first_s:.3f} s"
    assert told in result.stdout
    assert re.search(r"^health .* 0 diverged$", result.stdout, re.MULTILINE)
    for k in recovered:
        assert f"the filter diverged at {t_ns(k) * 1e-9:.3f} s" in result.stderr
    assert result.stderr.count("the filter diverged at") == len(recovered)


def test_nees_leaves_out_what_has_no_inverse_and_errors_are_those_of_all(
    tmp_path: Path,
) -> None:
    replay(tmp_path)
    figures = judge(log_of(tmp_path / "log.plr"))
    positions = np.array([pose.p_WB_m for pose in poses_of(tmp_path / "log.plr")])
    moved = positions - np.array([true_pose(k)[1] for k in range(FRAMES)])  # the same start
    assert figures["truth_frames"] == FRAMES
    assert figures["nees_left_out"] == 0  # recovered: every frame has a covariance
    assert figures["err0_m"] == pytest.approx(np.sqrt(np.mean(np.sum(moved**2, axis=1))), rel=1e-6)


def test_in_float64_it_does_not_diverge(tmp_path: Path) -> None:
    path = recorder(tmp_path)(drive(FRAMES))
    summary = run(path, *OPTIONS, "--json", program="pelorus-replay-f64").summary
    assert summary["frames_diverged"] == 0
    assert summary["recoveries"] == 0
    assert summary["diverged_s"] is None


def test_the_frame_table_has_every_variance(tmp_path: Path) -> None:
    replay(tmp_path)
    recovered = recovered_at(tmp_path)
    table = frame_table(log_of(tmp_path / "log.plr"))
    for name in ("var_rho_x", "var_theta_z", "trace", "var_bias_vx", "var_bias_wz"):
        assert np.isfinite(table[name]).all()
        assert (table[name][recovered] > 0).all()
    for name in ("x_m", "qw", "bias_wz"):
        assert np.isfinite(table[name]).all()
