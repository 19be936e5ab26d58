# SPDX-License-Identifier: MIT
"""Messages with the fields of ROS' types, without ROS, for the estimator of port/ros2."""

from __future__ import annotations

from types import SimpleNamespace as Fields
from typing import Any

import numpy as np
from pelorus.wire.frames import Camera, Header, Imu, Message, Stereo, Twist
from pelorus_ros.conventions import quaternion
from pelorus_ros.estimator import Estimator
from pelorus_ros.parameters import Options


def header(t_ns: int, frame: str = "") -> Fields:
    """Returns a header."""
    return Fields(stamp=Fields(sec=t_ns // 10**9, nanosec=t_ns % 10**9), frame_id=frame)


def vector(x: Any) -> Fields:
    """Returns a Vector3."""
    return Fields(x=float(x[0]), y=float(x[1]), z=float(x[2]))


def imu(t_ns: int, a: Any, w: Any, frame: str = "imu") -> Fields:
    """Returns a sensor_msgs/Imu."""
    head = header(t_ns, frame)
    return Fields(header=head, linear_acceleration=vector(a), angular_velocity=vector(w))


def tracks(m: Stereo, frame: str = "camera") -> Fields:
    """Returns a pelorus_msgs/StereoTracks."""
    u0, v0, u1, v1 = m.pixels.T
    head = header(m.t_ns, frame)
    return Fields(header=head, id=m.ids, left_u=u0, left_v=v0, right_u=u1, right_v=v1)


def wheels(t_ns: int, v: Any, w: Any, frame: str = "base_link") -> Fields:
    """Returns a nav_msgs/Odometry."""
    twist = Fields(linear=vector(v), angular=vector(w))
    head, both = header(t_ns, "odom"), Fields(twist=twist, covariance=np.zeros(36))
    return Fields(header=head, child_frame_id=frame, twist=both)


def camera_info(camera: Camera, is_right: bool) -> Fields:
    """Returns the camera_info of a rectified camera."""
    K = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1]])
    shift = -camera.fx_px * camera.baseline_m if is_right else 0.0
    P = np.column_stack((K, (shift, 0, 0)))
    return Fields(
        k=K.ravel(), d=np.zeros(5), r=np.eye(3).ravel(), p=P.ravel(), width=640, height=480,
        distortion_model="plumb_bob",
    )  # fmt: skip


def transform(parent: str, child: str, R: Any, p: Any) -> Fields:
    """Returns a tf2_msgs/TFMessage."""
    turn = dict(zip("xyzw", quaternion(np.asarray(R)), strict=True))
    moved = Fields(translation=vector(p), rotation=Fields(**turn))
    one = Fields(header=header(0, parent), child_frame_id=child, transform=moved)
    return Fields(transforms=[one])


def options(**changes: Any) -> Options:
    """Returns options of a robot that sends tracks, and whose base is its IMU."""
    usual = {"tracks_type": "pelorus_msgs/msg/StereoTracks", "base_frame": ""}
    return Options(**(usual | changes))


def equipped(estimator: Estimator, head: Header, body: str = "imu") -> Estimator:
    """With camera_info, and the camera's place on the body in /tf_static."""
    for side in ("left", "right"):
        estimator.camera_info(side, camera_info(head.camera, side == "right"))
    R = np.asarray(head.R_CB).T
    estimator.transforms(transform(body, "camera", R, -R @ head.t_CB_m))
    return estimator


def driven(estimator: Estimator, messages: list[Message]) -> list[Any]:
    """What it tells of all of them."""
    told: list[Any] = []
    for m in messages:
        if isinstance(m, Imu):
            for t_ns, a, w in zip(m.times_ns, m.a_B_mps2, m.w_B_radps, strict=True):
                told += estimator.imu(imu(t_ns, a, w))
        elif isinstance(m, Twist):
            told += estimator.wheels(wheels(m.t_ns, m.v_B_mps, m.w_B_radps))
        elif isinstance(m, Stereo):
            told += estimator.tracks(tracks(m))
    return told
