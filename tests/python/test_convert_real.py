# SPDX-License-Identifier: MIT
"""The real recordings, where they are: which faults they have, and their dead reckoning."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Converted
from drives import with_turned_axes
from pelorus.evaluate import road
from pelorus.evaluate.evaluation import Accuracy, assess
from pelorus.faults.finding import Finding
from pelorus.faults.mend import mend
from pelorus.io import trajectory
from pelorus.io.recording import Recording
from pelorus.io.trajectory import Trajectory
from pelorus.wire.frames import BodyAxes, TwistTiming
from pelorus_course import ece276a, matlab


def changed(findings: Sequence[Finding]) -> list[str]:
    """Returns what was changed in a recording."""
    mended = ("stale tracks", "axes", "lever")
    return [finding.subject for finding in findings if finding.found and finding.subject in mended]


def test_0027_has_stale_tracks_and_a_malformed_lever(
    real: Callable[[str], Path], of_0027: Converted
) -> None:
    source, (recording, findings) = real("ece276a/0027.npz"), of_0027
    assert changed(findings) == ["stale tracks", "lever"]
    assert "in 91 of 1106 frames" in findings[0].evidence
    assert "4196 observations" in findings[0].evidence
    given = ece276a.read(source).T_CB
    assert np.allclose(recording.T_CB.R, given.R)
    assert np.allclose(recording.T_CB.p, -given.R @ given.p)
    assert recording.header.body_axes is BodyAxes.FORWARD_LEFT_UP
    assert len(recording.truth_t_ns) == 1101
    assert not changed(mend(recording).changes)


def test_03_has_stale_tracks_and_turned_axes(real: Callable[[str], Path], of_03: Converted) -> None:
    source, (recording, findings) = real("ece276a/03.npz"), of_03
    assert changed(findings) == ["stale tracks", "axes"]
    given = ece276a.read(source).T_CB
    assert np.allclose(recording.T_CB.R, given.R @ np.diag([1, -1, -1]))
    assert np.allclose(recording.T_CB.p, given.p)
    assert recording.header.body_axes is BodyAxes.FORWARD_LEFT_UP
    assert recording.header.twist_timing is TwistTiming.END
    assert not changed(mend(recording).changes)


def test_0027_tells_the_noise_that_was_added_to_its_twists(of_0027: Converted) -> None:
    noise = of_0027.recording.header.noise
    assert noise.velocity_sigma_mps == pytest.approx(0.50, rel=0.05)
    assert noise.gyro_sigma_radps == pytest.approx(0.050, rel=0.1)


def test_of_03_the_images_can_tell_the_gyro_alone(of_03: Converted) -> None:
    noise = of_03.recording.header.noise
    assert noise.velocity_sigma_mps < 0
    assert 0.005 < noise.gyro_sigma_radps < 0.02


@pytest.mark.parametrize("drive", ["09_26_drive_0001", "09_26_drive_0036", "09_30_drive_0020"])
def test_the_klt_drives_have_none_of_the_faults(
    real: Callable[[str], Path], kept: Callable[..., Any], drive: str
) -> None:
    source = real(f"klt/2011_{drive}_sync_KLT.mat")
    recording = kept(drive, lambda: matlab.klt(source))
    assert not changed(mend(recording).changes)
    turned = mend(with_turned_axes(recording))
    assert changed(turned.changes) == ["axes"]
    assert np.allclose(turned.recording.T_CB.R, recording.T_CB.R)


def test_starry_night_has_none_of_the_faults(real: Callable[[str], Path]) -> None:
    recording = matlab.starry_night(real("starry-night/dataset3.mat"))
    assert len(recording.known) == 20
    assert not changed(mend(recording).changes)


def test_a_kitti_pose_file_reads_as_rigid_poses(real: Callable[[str], Path]) -> None:
    poses = trajectory.read_kitti(real("truth/kitti-odometry-07.txt"))
    assert len(poses.p) == 1101
    assert np.allclose(poses.R @ np.swapaxes(poses.R, 1, 2), np.eye(3), atol=1e-12)


def dead_reckoning(recording: Recording) -> Accuracy:
    t_ns = recording.truth_t_ns
    poses = recording.dead_reckoning().at(slice(0, len(t_ns)))
    found = assess(Trajectory(t_ns, poses), Trajectory(t_ns, recording.truth))
    assert found is not None
    return found


def test_dead_reckoning_of_starry_night_is_the_designs(real: Callable[[str], Path]) -> None:
    found = dead_reckoning(matlab.starry_night(real("starry-night/dataset3.mat")))
    assert found.err0_m == pytest.approx(1.28, abs=0.005)


def test_dead_reckoning_of_0027_is_the_designs(of_0027: Converted) -> None:
    found = dead_reckoning(of_0027.recording.with_header(twist_timing=TwistTiming.START))
    assert found.err0_m == pytest.approx(39.9, abs=0.05)
    assert found.ate_m == pytest.approx(15.8, abs=0.05)


@pytest.mark.parametrize(
    ("drive", "err0_m"),
    [("09_26_drive_0001", 1.52), ("09_26_drive_0036", 1.18), ("09_30_drive_0020", 9.2)],
)
def test_dead_reckoning_of_the_klt_drives_is_the_designs(
    real: Callable[[str], Path], kept: Callable[..., Any], drive: str, err0_m: float
) -> None:
    source = real(f"klt/2011_{drive}_sync_KLT.mat")
    found = dead_reckoning(kept(drive, lambda: matlab.klt(source)))
    assert found.err0_m == pytest.approx(err0_m, rel=0.005)


def test_dead_reckoning_of_03_leaves_the_road_as_the_design_says(
    real: Callable[[str], Path], of_03: Converted
) -> None:
    recording = of_03.recording.with_header(twist_timing=TwistTiming.START)
    digitised = road.read_road(real("truth/kitti360-0003-path.csv"))
    found = road.compare(recording.dead_reckoning().p, digitised, 45.0)
    assert found.road_m == pytest.approx(25.8, abs=0.05)
