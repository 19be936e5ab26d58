# SPDX-License-Identifier: MIT
"""Latency of the node from picture to odometry, on real pictures over a real ROS 2.

usage: tools/ros2.sh -s tests/ros2/latency.py     (it reports, and bars nothing)

EuRoC MH_01's first ten seconds of $PELORUS_DATA, pictures at 20 Hz and the IMU at 200 Hz, are
played at the pace of their stamps by this process to the node in another one. A picture's latency
is the time from the call that publishes the right one to the odometry of that stamp, at this
process.
"""

from __future__ import annotations

import os
import resource
import time
from pathlib import Path

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from pelorus.commands.choices import settings_given
from pelorus.commands.cli import main
from pelorus.converters import euroc
from pelorus.converters.streams import Asked, Pictures, Readings
from pelorus.wire.frames import Stereo
from pelorus.wire.framing import messages_of
from robot import Played, Robot, image_message, imu_message
from sensor_msgs.msg import Image, Imu

FOLDER = Path(os.environ.get("PELORUS_DATA", "../shared/data")) / "images/euroc-mh01-start"
CONF = Path(__file__).parents[2] / "tools/config/imu-adis16448.conf"


def ns(stamp: Time) -> int:
    """Returns a stamp's time."""
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def test_latency_from_picture_to_odometry(tmp_path: Path) -> None:
    """Prints it, beside the poses that came and the node's CPU; its log replays to the bit."""
    if not FOLDER.is_dir():
        pytest.skip(f"{FOLDER} is not here")
    found = euroc.read(FOLDER, Asked())
    assert isinstance(found.frames, Pictures)
    assert isinstance(found.motion, Readings)
    played = []
    for t, (left, right) in zip(found.frames.t_ns.tolist(), found.frames.read(), strict=True):
        for side, picture in (("left", left), ("right", right)):
            played.append(
                Played(t, len(played), f"{side}/image", image_message(t, picture, "left_optical"))
            )
    own = found.motion.inertial
    for t, a, w in zip(own.t_ns.tolist(), own.a_B_mps2, own.w_B_radps, strict=True):
        played.append(Played(t, len(played), "imu", imu_message(t, a, w)))
    calibration = [str(one) for one in sorted((FOLDER / "mav0").glob("*/sensor.yaml"))]
    log = tmp_path / "drive.plr"
    settings = [f"{name}={value}" for name, value in settings_given(CONF, []).items()]
    parameters = {
        "image_qos": "reliable", "calibration": calibration, "base_frame": "",
        "settings": settings, "log": str(log),
    }  # fmt: skip
    sent_s: dict[int, float] = {}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with Robot(tmp_path, parameters) as robot:
        for topic, kind in (("left/image", Image), ("right/image", Image), ("imu", Imu)):
            robot.publisher(topic, kind)
        robot.heard(["left/image", "right/image", "imu"])
        robot.listened()
        right = robot.publisher("right/image", Image)
        publish = right.publish

        def publish_stamped(message: Image) -> None:
            sent_s[ns(message.header.stamp)] = time.monotonic()
            publish(message)

        right.publish = publish_stamped
        robot.play(played)
        until = time.monotonic() + 2.0
        while time.monotonic() < until:
            robot.executor.spin_once(timeout_sec=0.05)
        robot.stop()
        arrived = {ns(m.header.stamp): s for m, s in zip(robot.odom, robot.arrived_s, strict=True)}
    late_ms = np.array([1e3 * (arrived[t] - s) for t, s in sent_s.items() if t in arrived])
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    told = sorted({f"{one.name}: {one.message}" for one in robot.said})
    median, p99 = np.percentile(late_ms, [50, 99])
    used = {m.t_ns for m in messages_of(log) if isinstance(m, Stereo)}
    offset_ns = min((t - s for t in used for s in sent_s), key=abs)
    lost = [k for k, t in enumerate(sorted(sent_s)) if t + offset_ns not in used]
    print(
        f"\n{len(sent_s)} pairs, lost {lost or 'none'}; {len(late_ms)} poses; "
        f"picture to odometry {median:.1f} ms in the median, {p99:.1f} ms p99; "
        f"CPU of the node {spent_s:.1f} s\n" + "\n".join(told)
    )
    assert main(["compare", str(log)]) == 0
