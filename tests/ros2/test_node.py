# SPDX-License-Identifier: MIT
"""The node as a process, played to by this one, both with a real rclpy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Recorded, mounted
from pelorus.commands.cli import main
from pelorus.wire.frames import Pose
from pelorus.wire.framing import messages_of
from pelorus_msgs.msg import StereoTracks
from robot import Played, Robot, image_message, stamped
from sensor_msgs.msg import Image, Imu

TRACKS = {"tracks_type": "pelorus_msgs/msg/StereoTracks"}


@contextmanager
def started(
    folder: Path, recorded: Recorded, namespace: str = "/", mount: bool = True, **changes: Any
) -> Iterator[Robot]:
    """A node that hears the tracks and the IMU of this process."""
    with Robot(folder, TRACKS | changes, namespace) as robot:
        robot.publisher("tracks", StereoTracks)
        robot.publisher("imu", Imu)
        if mount:
            mounted(robot, recorded.header)
        robot.listened()
        robot.heard(["tracks", "imu"])
        yield robot


def settled(robot: Robot, recorded: Recorded) -> None:
    """Waits for the odometry of the last frame, or of the one before."""
    last_s = recorded.played[-1].arrives_ns * 1e-9 - 0.25
    robot.until(lambda: bool(robot.odom) and seconds(robot.odom[-1]) > last_s, "last odometry")


def seconds(message: Any) -> float:
    stamp = message.header.stamp
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def poses_in(log: Path) -> list[Pose]:
    return [m for m in messages_of(log) if isinstance(m, Pose)]


@pytest.mark.parametrize("rate", [1.0, 2.0])
def test_a_drive_is_estimated_as_it_comes_and_its_log_replays_to_the_bit(
    folder: Path, recorded: Recorded, rate: float
) -> None:
    """Odometry in the conventions of REP-105, and tf of the same pose."""
    log = folder / "drive.plr"
    with started(folder, recorded, log=str(log)) as robot:
        robot.play(recorded.played, rate)
        settled(robot, recorded)
        robot.until(lambda: bool(robot.messages_of("estimate")), "diagnostics")
        robot.stop()
        odom, tf = robot.odom, robot.tf
    assert main(["compare", str(log)]) == 0
    assert len(poses_in(log)) > 0.8 * recorded.frames  # the first ones come before the mounting
    assert odom[0].header.frame_id == "odom"
    assert odom[0].child_frame_id == "base_link"
    first = odom[0].pose.pose
    begins = (first.position.x, first.position.y, first.position.z)
    assert begins == pytest.approx((0, 0, 0), abs=1e-12)  # a product of poses, rounded
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in odom]
    assert stamps == sorted(set(stamps))
    C = np.array(odom[-1].pose.covariance).reshape(6, 6)
    assert np.linalg.eigvalsh(0.5 * (C + C.T)).min() > 0
    assert [t.transform.translation.x for t in tf] == [m.pose.pose.position.x for m in odom]


def test_late_dropped_and_reordered_messages_cost_frames_and_no_truth(
    folder: Path, recorded: Recorded
) -> None:
    chance, log = np.random.default_rng(2), folder / "drive.plr"
    late = [
        replace(one, arrives_ns=one.arrives_ns + int(chance.exponential(10e6)))
        for one in recorded.played
        if chance.random() > 0.03
    ]
    with started(folder, recorded, log=str(log)) as robot:
        robot.play(late)
        settled(robot, recorded)
        robot.stop()
    assert main(["compare", str(log)]) == 0


def test_a_camera_that_dies_is_told_and_the_covariance_grows(
    folder: Path, recorded: Recorded
) -> None:
    dies = recorded.played[0].arrives_ns + 4 * 10**9
    blind = [one for one in recorded.played if one.topic != "tracks" or one.arrives_ns < dies]
    with started(folder, recorded) as robot:
        robot.play(blind)
        robot.until(
            lambda: any("tracks (any more)" in w for w in robot.messages_of("inputs")), "cry"
        )
        robot.until(lambda: any("lost" in w for w in robot.messages_of("estimate")), "lost")
        sigma = [np.sqrt(m.pose.covariance[0]) for m in robot.odom]
    assert sigma[-1] > 5 * min(sigma)


def test_a_clock_that_steps_begins_a_new_log_and_both_replay(
    folder: Path, recorded: Recorded
) -> None:
    log = folder / "drive.plr"
    later = []
    for one in recorded.played:
        if one.topic.endswith("camera_info"):
            continue
        message = type(one.message)()
        for name in one.message.get_fields_and_field_types():
            setattr(message, name, getattr(one.message, name))
        t_ns = one.message.header.stamp.sec * 10**9 + one.message.header.stamp.nanosec
        message.header = stamped(t_ns + 3600 * 10**9, one.message.header.frame_id)
        later.append(Played(one.arrives_ns + 7 * 10**9, one.number, one.topic, message))
    with started(folder, recorded, log=str(log)) as robot:
        robot.play([*recorded.played, *later], 1.5)
        robot.until(lambda: any("stamps jumped" in w for w in robot.messages_of("clock")), "step")
        robot.until(lambda: robot.odom[-1].header.stamp.sec >= 3600, "odometry behind the step")
        robot.stop()
    for name in ("drive.plr", "drive-2.plr"):
        assert main(["compare", str(folder / name)]) == 0


def test_two_nodes_side_by_side_do_not_hear_each_other(folder: Path, recorded: Recorded) -> None:
    with (
        started(folder, recorded, "/one", publish_odom_to_base_tf=False) as one,
        started(folder, recorded, "/two", publish_odom_to_base_tf=False) as two,
    ):
        one.play(recorded.played, 2.0)
        settled(one, recorded)
        assert not two.odom
        assert not one.tf
        two.play(recorded.played, 2.0)
        settled(two, recorded)


def test_misspelt_parameters_and_missing_topics_are_told_and_the_node_stays_up(
    folder: Path, recorded: Recorded
) -> None:
    with Robot(folder, TRACKS | {"base_frme": "body"}) as robot:
        robot.listened()
        robot.until(
            lambda: (
                "there is no parameter base_frme; did you mean base_frame?"
                in robot.messages_of("parameters")
            ),
            "complaint",
        )
        robot.until(
            lambda: any("nobody publishes /imu" in w for w in robot.messages_of("topics")), "imu"
        )
        robot.publisher("imu", Image)
        robot.until(
            lambda: any("sensor_msgs/msg/Imu is expected" in w for w in robot.messages_of("types")),
            "type that does not fit",
        )
        assert robot.process.poll() is None
    del recorded


def test_a_value_that_is_impossible_is_told_and_the_node_stays_up(folder: Path) -> None:
    with Robot(folder, TRACKS | {"motion": "imus"}) as robot:
        robot.listened()
        robot.until(
            lambda: any(
                "one of 'imu', 'gyro_accel', 'wheels'" in w for w in robot.messages_of("parameters")
            ),
            "complaint",
        )


def test_a_frame_that_tf_does_not_know_gives_no_pose(folder: Path, recorded: Recorded) -> None:
    with started(folder, recorded, base_frame="chassis") as robot:
        robot.play(recorded.played[:400], 2.0)
        robot.until(
            lambda: any("where 'chassis' stands" in w for w in robot.messages_of("setup")), "frame"
        )
        assert not robot.odom


def test_an_imu_in_g_gives_no_pose_until_the_parameter_is_right(
    folder: Path, recorded: Recorded
) -> None:
    with started(folder, recorded, accel_scale=1 / 9.80665) as robot:
        robot.play(recorded.played, 2.0)
        robot.until(lambda: any("that is g" in w for w in robot.messages_of("setup")), "unit")
        assert not robot.odom


def test_state_is_saved_and_loaded_and_the_drive_begun_anew(
    folder: Path, recorded: Recorded
) -> None:
    with started(folder, recorded, state_file=str(folder / "state")) as robot:
        assert not robot.call("save_state").success
        robot.play(recorded.played, 2.0)
        settled(robot, recorded)
        saved = robot.call("save_state")
        assert saved.success, saved.message
        loaded = robot.call("load_state")
        assert loaded.success, loaded.message
        assert robot.call("reset").success


def test_pictures_of_another_size_than_the_calibrations_are_told_and_give_no_pose(
    folder: Path, recorded: Recorded
) -> None:
    grey = np.full((120, 160), 128, np.uint8)
    played = [one for one in recorded.played if one.topic != "tracks"]
    begin = played[0].arrives_ns
    for k in range(20):
        t = begin + k * 10**8
        for side in ("left", "right"):
            played.append(Played(t, k, f"{side}/image", image_message(t, grey, "left_optical")))
    with Robot(folder, {"image_qos": "reliable"}) as robot:
        for topic, kind in (("left/image", Image), ("right/image", Image), ("imu", Imu)):
            robot.publisher(topic, kind)
        mounted(robot, recorded.header)
        robot.listened()
        robot.heard(["left/image", "right/image", "imu"])
        robot.play(played)
        robot.until(
            lambda: any("calibration is of 640 x 480" in w for w in robot.messages_of("setup")),
            "size",
        )
        assert not robot.odom
