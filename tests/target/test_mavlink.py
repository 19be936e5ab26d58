# SPDX-License-Identifier: MIT
"""The second output: ODOMETRY as an autopilot decodes it, held against the link's POSE."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from pelorus.robot.emulator import Emulator
from pelorus.robot.stream import Streamer
from pelorus.wire.frames import BodyAxes, Header, Kind, Message, Pose
from pelorus.wire.framing import read_file
from recordings import first_frames
from scipy.spatial.transform import Rotation

common = pytest.importorskip("pymavlink.dialects.v20.common", reason="pymavlink is not installed")

Matrix = npt.NDArray[np.float64]

FRAMES = 30
AWAY = 32  # frames of the drive by an IMU: it rests for 2 s, and sets off
HANG_S = 1800.0
TURNS = {
    BodyAxes.FORWARD_LEFT_UP: np.diag([1.0, -1.0, -1.0]),
    BodyAxes.FORWARD_RIGHT_DOWN: np.eye(3),
}
FLOAT32 = 2e-6
EULER_STEP = 1e-6


def fly(
    emulator: Emulator, messages: list[Message], axes: BodyAxes
) -> tuple[list[Pose], list[Any]]:
    """Poses from the link, and what an autopilot makes of the second UART's bytes."""
    second = emulator.connect_telemetry()
    link = emulator.connect()
    said = [replace(m, body_axes=axes) if isinstance(m, Header) else m for m in messages]
    heard = b""
    streamer = Streamer(link)
    streamer.greet()
    for message in said:
        streamer.send(message)
        heard += second.exchange(b"")
    streamer.finish()
    decoder = common.MAVLink(None)
    odometries = decoder.parse_buffer(heard) or []
    due = len(streamer.outcome.poses) if axes in TURNS else 0
    deadline = time.monotonic() + HANG_S
    while len(odometries) < due and time.monotonic() < deadline:
        odometries += decoder.parse_buffer(second.exchange(b"", 1.0)) or []
    odometries += decoder.parse_buffer(second.exchange(b"", 1.0)) or []  # and none too many
    assert decoder.total_receive_errors == 0
    link.close()
    second.close()
    return streamer.outcome.poses, odometries


def symmetric(upper: list[float]) -> Matrix:
    """A 6x6 from its upper triangle, row by row."""
    full = np.zeros((6, 6))
    full[np.triu_indices(6)] = upper
    return full + np.triu(full, 1).T


def symmetric_from_lower(packed: Matrix) -> Matrix:
    """A 6x6 from its lower triangle, row by row."""
    full = np.zeros((6, 6))
    full[np.tril_indices(6)] = packed
    return full + np.tril(full, -1).T


def euler_jacobian(R: Matrix) -> Matrix:
    """d(roll, pitch, yaw) / d theta for R Exp(theta), by differences."""
    columns = []
    for axis in np.eye(3):
        ends = [
            (Rotation.from_matrix(R) * Rotation.from_rotvec(s * EULER_STEP * axis)).as_euler("ZYX")
            for s in (1, -1)
        ]
        columns.append((ends[0] - ends[1])[::-1] / (2 * EULER_STEP))
    return np.array(columns).T


def close(found: Any, expected: Matrix) -> None:
    """Equal to float32, measured by the largest element."""
    scale = max(1e-12, float(np.abs(expected).max()))
    np.testing.assert_allclose(found, expected, rtol=0, atol=FLOAT32 * scale)


@pytest.mark.parametrize("axes", list(TURNS), ids=["flu", "frd"])
def test_odometry_is_the_pose_in_forward_right_down_axes(
    emulator: Emulator, drive: list[Message], axes: BodyAxes
) -> None:
    poses, odometries = fly(emulator, first_frames(drive, FRAMES), axes)
    assert len(poses) == FRAMES
    assert_told(poses, odometries, axes)


@pytest.mark.spread
def test_with_an_imu_velocity_is_the_estimated_one_with_its_covariance(
    emulator: Emulator, robot: Path
) -> None:
    recording = read_file(robot / "recordings" / "imu.plr")[0]
    messages = [frame.message for frame in recording if frame.message.kind != Kind.TRUTH]
    axes = BodyAxes.FORWARD_LEFT_UP
    poses, odometries = fly(emulator, first_frames(messages, AWAY), axes)
    assert len(poses) == AWAY
    assert_told(poses, odometries, axes)
    told = odometries[-1]
    assert np.hypot(told.vx, told.vy) > 0.5, "it has set off"
    assert all(0 < told.velocity_covariance[k] < 0.1 for k in (0, 6, 11))
    assert odometries[0].quality == 1, "it has not found its tilt yet"
    assert told.quality == 100


def assert_told(poses: list[Pose], odometries: list[Any], axes: BodyAxes) -> None:
    """Each ODOMETRY is its POSE in the autopilot's axes."""
    assert len(poses) == len(odometries)
    M = TURNS[axes]
    both = np.kron(np.eye(2), M)
    for number, (pose, odometry) in enumerate(zip(poses, odometries, strict=True)):
        assert odometry.get_type() == "ODOMETRY"
        assert odometry.get_seq() == number
        assert odometry.time_usec == pose.t_ns // 1000
        close([odometry.x, odometry.y, odometry.z], M @ pose.p_WB_m)
        R = M @ pose.R_WB @ M
        w, x, y, z = odometry.q
        close(Rotation.from_quat([x, y, z, w]).as_matrix(), R)
        close([odometry.vx, odometry.vy, odometry.vz], M @ pose.v_B_mps)
        close([odometry.rollspeed, odometry.pitchspeed, odometry.yawspeed], M @ pose.w_B_radps)
        velocity = both @ symmetric_from_lower(pose.velocity_covariance) @ both
        close(symmetric(odometry.velocity_covariance), velocity)
        J = np.block([[R, np.zeros((3, 3))], [np.zeros((3, 3)), euler_jacobian(R)]]) @ both
        P = symmetric_from_lower(pose.covariance)
        close(symmetric(odometry.pose_covariance), J @ P @ J.T)


@pytest.mark.spread
def test_frames_estimator_quality_and_resets_are_told(
    emulator: Emulator, drive: list[Message]
) -> None:
    poses, odometries = fly(emulator, first_frames(drive, FRAMES), BodyAxes.FORWARD_LEFT_UP)
    for pose, odometry in zip(poses, odometries, strict=True):
        assert odometry.frame_id == common.MAV_FRAME_LOCAL_FRD
        assert odometry.child_frame_id == common.MAV_FRAME_BODY_FRD
        assert odometry.estimator_type == common.MAV_ESTIMATOR_TYPE_VIO
        assert odometry.get_srcComponent() == common.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
        assert odometry.reset_counter == pose.reset_count
    assert {odometry.quality for odometry in odometries} <= {-1, 1, 50, 100}
    assert 100 in {odometry.quality for odometry in odometries}


@pytest.mark.spread
def test_other_body_axes_are_not_guessed(emulator: Emulator, drive: list[Message]) -> None:
    poses, odometries = fly(emulator, first_frames(drive, FRAMES), BodyAxes.OTHER)
    assert len(poses) == FRAMES
    assert all(isinstance(pose, Pose) for pose in poses)
    assert odometries == []
