# SPDX-License-Identifier: MIT
"""The .npz files of UCSD's ECE276A project 3, editions 2019 to 2021.

`time_stamps` (1, T) s; `features` (4, M, T) px in the order uL vL uR vR, all four -1 where absent;
`linear_velocity` (3, T) m/s; `angular_velocity` or `rotational_velocity` (3, T) rad/s; `K` (3, 3);
`b` baseline, m; `imu_T_cam` or `cam_T_imu` (4, 4). They have no noise sigmas; what can be measured
of the noise goes into the HEADER (twist_noise.py).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from pelorus.converters import twist_noise
from pelorus.faults import stale
from pelorus.faults.finding import Finding
from pelorus.faults.mend import findings_of, mend
from pelorus.io import arrays, trajectory
from pelorus.io.arrays import Arrays
from pelorus.io.foreign import ForeignFileError
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math import se3
from pelorus.math.axes import body_axes
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Header, TwistTiming, header_name

from pelorus_course import timing


def convert(
    source: Path,
    truth: Path | None = None,
    fix: bool = True,
    twist_timing: TwistTiming | None = None,
    keep_ids: bool = False,
) -> tuple[Recording, list[Finding]]:
    """Reads a file; with `fix` mends it and measures the twists' noise; adds the truth.

    `twist_timing` None: the data decide. With `keep_ids` stale tracks are not mended.
    """
    recording = read(source)
    tracks = recording.tracks
    findings: list[Finding] = []
    if fix:
        mended = mend(recording)
        recording, findings = mended.recording, list(mended.changes)
    if twist_timing is None:
        recording, finding = timing.choose(recording)
        findings.append(finding)
    else:
        recording = recording.with_header(twist_timing=twist_timing)
    if fix:
        recording, finding = twist_noise.suggest(recording)
        findings += [finding, *findings_of(recording)]  # anew, for the timing is another
    if keep_ids:
        recording = replace(recording, tracks=tracks)
        findings = [_left_alone(finding) for finding in findings]
    recording = recording.with_header(body_axes=body_axes(recording.T_CB.R))
    return (with_truth(recording, truth) if truth else recording), findings


def _left_alone(finding: Finding) -> Finding:
    if finding.subject != stale.SUBJECT or not finding.found:
        return finding
    return replace(finding, action="left as they are, since the ids were to be kept")


def read(source: Path) -> Recording:
    """Reads the file as it is."""
    file = arrays.read_npz(source)
    t_ns = arrays.nanoseconds(source, "time_stamps", file.get("time_stamps").ravel())
    count = len(t_ns)
    K = file.get("K", shape=(3, 3))
    camera = arrays.camera_of(source, K[0, 0], K[1, 1], K[0, 2], K[1, 2], file.scalar("b"))
    T_CB = _extrinsic(file)
    tracks = Tracks.from_dense(file.get("features", shape=(4, None, count)))
    tracks.check(source)
    w = file.get("angular_velocity", "rotational_velocity", shape=(3, count)).T
    header = Header(camera, T_CB.R, T_CB.p, name=header_name(source.stem))
    v = file.get("linear_velocity", shape=(3, count)).T
    return Recording(header, t_ns, v, w, t_ns, tracks)


def _extrinsic(file: Arrays) -> Poses:
    """Returns T_CB: `cam_T_imu` maps body to camera, `imu_T_cam` is its inverse."""
    key = file.one_of("cam_T_imu", "imu_T_cam")
    matrix = file.get(key, shape=(4, 4))
    if np.abs(matrix[3] - [0, 0, 0, 1]).max() > 1e-9:
        raise ForeignFileError(
            file.path, f"the last row of {key} is {matrix[3]}; 0 0 0 1 is expected"
        )
    T = Poses(arrays.rotation(file.path, key, matrix[:3, :3]), matrix[:3, 3])
    return T if key == "cam_T_imu" else se3.inverse(T)


def with_truth(recording: Recording, path: Path) -> Recording:
    """Adds KITTI poses of the left camera; row k belongs to frame k, rows may be fewer."""
    poses = trajectory.read_kitti(path)
    frames = len(recording.frame_t_ns)
    if len(poses.p) > frames:
        raise ForeignFileError(
            path, f"{len(poses.p)} poses for {frames} frames; at most one each is expected"
        )
    body = trajectory.body_poses(poses, recording.T_CB)
    return recording.with_truth(recording.frame_t_ns[: len(poses.p)], body)
