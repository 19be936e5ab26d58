# SPDX-License-Identifier: MIT
"""The node's part that needs no ROS: messages in, odometry and sentences out."""

from __future__ import annotations

import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from types import SimpleNamespace as Fields
from typing import Any

import numpy as np
import pytest
from pelorus.commands.cli import main
from pelorus.errors import PelorusError
from pelorus.online.diagnosis import Level, of_health
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.simulate import Options as Drive
from pelorus.simulate.simulate import simulate
from pelorus.wire.frames import Imu, Message, Stereo
from pelorus_ros import conventions
from pelorus_ros.estimator import Estimator
from pelorus_ros.parameters import Options, misspelt, table
from replay_drive import BIN
from robot_messages import (
    camera_info,
    driven,
    equipped,
    header,
    imu,
    options,
    tracks,
    transform,
    wheels,
)
from ruamel.yaml import YAML

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "ros2"


pytestmark = pytest.mark.usefixtures("built")


@pytest.fixture(scope="module")
def by_imu() -> tuple[Any, list[Message]]:
    drive = Drive(seed=6, duration_s=6.0, imu=SimulatedImu(imu_rate_hz=200.0))
    recording = simulate(drive).recording
    return recording.header, list(recording.messages())


@pytest.fixture(scope="module")
def by_wheels() -> tuple[Any, list[Message]]:
    recording = simulate(Drive(seed=6, duration_s=4.0)).recording
    return recording.header, list(recording.messages())


def words(estimator: Estimator, level: Level = Level.WARN) -> str:
    return "\n".join(
        f"{s.name}: {s.message}; {s.do}" for s in estimator.diagnose() if s.level >= level
    )


def test_tracks_and_an_imu_give_odometry_and_a_log_that_replays(
    by_imu: tuple[Any, list[Message]], tmp_path: Path
) -> None:
    head, messages = by_imu
    robot = equipped(Estimator(options(log=str(tmp_path / "drive.plr"))), head)
    told = driven(robot, messages)
    assert len(told) > 15
    assert not words(robot, Level.ERROR)
    assert len(robot.landmarks()) > 10
    robot.finish()
    assert main(["compare", str(tmp_path / "drive.plr")]) == 0


def test_wheels_in_place_of_an_imu_give_odometry_of_their_own_frame(
    by_wheels: tuple[Any, list[Message]],
) -> None:
    head, messages = by_wheels
    robot = Estimator(options(motion="wheels", base_frame="base_link"))
    told = driven(equipped(robot, head, "base_link"), messages)
    assert len(told) > 30
    np.testing.assert_array_equal(told[0].T_OB.R, np.eye(3))
    assert robot.child_frame == "base_link"


def test_wheels_beside_an_imu_are_used_in_the_imus_axes(
    by_imu: tuple[Any, list[Message]],
) -> None:
    head, messages = by_imu
    robot = equipped(Estimator(options(wheels_beside_imu=True, base_frame="base_link")), head)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # the base's x is the IMU's y
    robot.transforms(transform("base_link", "imu", turn.T, (0.0, 0, 0)))
    told = []
    for m in messages:
        told += driven(robot, [m])
        if isinstance(m, Stereo) and told:
            v_B = told[-1].estimate.velocity[:3]
            robot.wheels(wheels(m.t_ns + 1_000_000, turn.T @ v_B, (0, 0, 0)))
    assert len(told) > 15
    assert robot.odometry is not None
    assert robot.odometry.drive is not None
    assert not robot.odometry.drive.refused
    assert told[-1].velocity[:3] == pytest.approx(turn.T @ told[-1].estimate.velocity[:3], abs=1e-9)


def test_a_yaw_rate_of_wheels_tells_the_velocity_of_each(
    by_imu: tuple[Any, list[Message]], monkeypatch: pytest.MonkeyPatch
) -> None:
    head, messages = by_imu
    asked = options(wheels_beside_imu=True, base_frame="base_link", wheel_track_m=0.5)
    robot = equipped(Estimator(asked), head)
    robot.transforms(transform("base_link", "imu", np.eye(3), (0.0, 0, 0)))
    given = np.array([1.0, 0, 0]), np.array([0, 0, 0.4])
    kept: list[Any] = []

    def keep(one: Any) -> list[Any]:
        kept.append(one)
        return []

    for m in messages:
        driven(robot, [m])
        if isinstance(m, Stereo) and robot.odometry is not None:
            monkeypatch.setattr(robot.pipeline, "add", keep)
            robot.wheels(wheels(m.t_ns + 1_000_000, *given))
            break
    assert not robot.faults
    left, right = kept
    assert left.value[:3] == pytest.approx((1.0 - 0.4 * 0.25, 0, 0))
    assert right.value[:3] == pytest.approx((1.0 + 0.4 * 0.25, 0, 0))
    assert left.at_B_m - right.at_B_m == pytest.approx((0, 0.5, 0))
    assert left.sigma == pytest.approx(np.full(3, np.sqrt(2) * 0.05))
    with pytest.raises(PelorusError, match="parameter wheel_track_m: -1"):
        Options.of({name: value for name, (value, _) in table().items()} | {"wheel_track_m": -1.0})


def test_an_imu_in_g_is_told_and_gives_no_pose(by_imu: tuple[Any, list[Message]]) -> None:
    head, messages = by_imu
    in_g = [
        Imu(m.t_ns, m.a_B_mps2 / 9.80665, m.w_B_radps, m.period_ns) if isinstance(m, Imu) else m
        for m in messages
    ]
    robot = equipped(Estimator(options()), head)
    assert driven(robot, in_g) == []
    assert "set the parameter accel_scale to 9.80665" in words(robot, Level.ERROR)
    scaled = equipped(Estimator(options(accel_scale=9.80665)), head)
    assert len(driven(scaled, in_g)) > 15


def test_swapped_cameras_are_told_and_give_no_pose(by_imu: tuple[Any, list[Message]]) -> None:
    head, messages = by_imu
    swapped = [
        Stereo(m.t_ns, m.ids, m.pixels[:, [2, 3, 0, 1]]) if isinstance(m, Stereo) else m
        for m in messages
    ]
    robot = equipped(Estimator(options()), head)
    assert driven(robot, swapped) == []
    assert "are left and right swapped?" in words(robot, Level.ERROR)
    robot.reset()
    assert not robot.blocked


def test_frames_that_tf_does_not_know_are_named_and_the_parameters_that_help(
    by_imu: tuple[Any, list[Message]],
) -> None:
    head, messages = by_imu
    robot = equipped(Estimator(options(base_frame="base_link")), head)
    assert driven(robot, messages[:40]) == []
    said = words(robot, Level.ERROR)
    assert "/tf_static does not say where 'base_link' stands" in said
    assert "known frames: camera, imu" in said
    assert "T_base_imu" in said


def test_what_is_waited_for_is_told(by_imu: tuple[Any, list[Message]]) -> None:
    head, messages = by_imu
    robot = Estimator(options())
    assert "nothing came on tracks, imu (never)" in words(robot, Level.ERROR)
    assert driven(robot, messages[:20]) == []
    assert "left/camera_info and right/camera_info" in words(robot, Level.ERROR)
    for side in ("left", "right"):
        robot.camera_info(side, camera_info(head.camera, side == "right"))
    assert driven(robot, messages[20:40]) == []
    assert "/tf_static does not say where" in words(robot, Level.ERROR)


def test_a_camera_that_dies_is_lost_and_its_topic_is_named(
    by_imu: tuple[Any, list[Message]],
) -> None:
    head, messages = by_imu
    robot = equipped(Estimator(options()), head)
    dies = next(m.t_ns for m in messages if isinstance(m, Imu)) + 4 * 10**9
    seeing = [m for m in messages if isinstance(m, Imu) or getattr(m, "t_ns", 0) < dies]
    half = next(k for k, m in enumerate(seeing) if getattr(m, "t_ns", 0) >= dies)
    driven(robot, seeing[:half])
    robot.diagnose()
    driven(robot, seeing[half:])
    said = words(robot, Level.ERROR)
    assert "nothing came on tracks (any more)" in said
    assert "lost: no frames came" in said


def test_messages_that_do_not_fit_are_told_and_the_node_goes_on(
    by_imu: tuple[Any, list[Message]],
) -> None:
    head, messages = by_imu
    robot = equipped(Estimator(options()), head)
    bad = tracks(next(m for m in messages if isinstance(m, Stereo)))
    bad.left_u = bad.left_u[:3]
    driven(robot, messages[:50])
    robot.tracks(bad)
    assert "left_v, right_u and right_v differ in length" in words(robot)
    assert len(driven(robot, messages[50:])) > 15


def test_readings_that_are_no_number_do_no_harm(by_imu: tuple[Any, list[Message]]) -> None:
    head, messages = by_imu
    robot = equipped(Estimator(options()), head)
    told = []
    for k, m in enumerate(messages):
        told += driven(robot, [m])
        if k % 40 == 20 and isinstance(m, Imu):
            robot.imu(imu(m.t_ns + 1_000_000, (np.nan, 0, np.inf), (0, 0, 0)))
    assert len(told) > 15
    assert all(np.isfinite(odom.T_OB.p).all() for odom in told)
    assert "NaN or infinite" in next(
        s.values["refused"] for s in robot.diagnose() if s.name == "estimate"
    )


def test_a_pose_from_rviz_places_the_robot(by_imu: tuple[Any, list[Message]]) -> None:
    head, messages = by_imu
    robot = equipped(Estimator(options()), head)
    place = Fields(position=Fields(x=7.0, y=-3.0, z=0.0), orientation=Fields(x=0, y=0, z=0, w=1))
    both = Fields(pose=place, covariance=np.diag([0.25, 0.25, 0, 0, 0, 0.07]))
    robot.initial_pose(Fields(header=header(0, "map"), pose=both))
    told = driven(robot, messages)
    assert told[0].T_OB.p == pytest.approx([7, -3, 0], abs=0.6)
    assert told[0].covariance[0, 0] == pytest.approx(0.25, rel=0.5)
    assert told[0].covariance[5, 5] == pytest.approx(0.07, rel=0.2)


def test_a_known_map_holds_what_wheels_lose(tmp_path: Path) -> None:
    """Tracks by ids of an earlier run: its landmarks, and where in its world the robot starts."""
    recording = simulate(Drive(seed=6, duration_s=20.0, landmarks=240)).recording
    truth, messages = recording.truth, list(recording.messages())
    first, mapped = tmp_path / "first.plr", tmp_path / "map.plr"
    recording.write(first)
    command = [BIN / "pelorus-replay", first, "--mode", "mapping", "--slots", "256", "--quiet"]
    subprocess.run([*map(str, command), "--out", str(mapped)], check=True, capture_output=True)
    usual = options(
        motion="wheels",
        base_frame="base_link",
        initial_pose=[*truth.p[0], *conventions.quaternion(truth.R[0])],
        settings=["bias-velocity-sigma=0.03", "bias-gyro-sigma=0.004"],  # as they are drawn
    )
    off = []
    for known in ("", str(mapped)):
        robot = Estimator(replace(usual, known_map=known))
        last = driven(equipped(robot, recording.header, "base_link"), messages)[-1]
        at = np.searchsorted(recording.truth_t_ns, last.estimate.t_ns)
        off.append(np.linalg.norm(last.T_OB.p - truth.p[at]))
        assert off[-1] < 4 * np.sqrt(np.trace(last.covariance[:3, :3]))
    assert off[1] < 0.1 < off[0]


# --- parameters -----------------------------------------------------------------------------------


def test_a_misspelt_parameter_is_told_with_the_one_that_was_meant() -> None:
    said = misspelt(["base_frme", "use_sim_time", "odom_frame"])
    assert said == ["there is no parameter base_frme; did you mean base_frame?"]


def test_every_parameter_has_a_description_and_a_default_that_is_possible() -> None:
    for name, (default, about) in table().items():
        assert default is not None, name
        assert len(about) > 10, name
    assert Options.of({name: default for name, (default, _) in table().items()}) == Options()


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("motion", "imus", "one of 'imu', 'gyro_accel', 'wheels' is possible"),
        ("T_cam_imu", [1.0] * 12, "12 numbers; 16 are expected"),
        ("settings", ["pixel-sgma=1"], "no setting pixel-sgma: is pixel-sigma "),
        ("settings", ["pixel-sigma"], "name=value is expected"),
        ("settings", ["pixel-sigma=1e9"], "0.001 to 1000 px are possible"),
        ("log", "/no/such/drive.plr", "there is no such folder"),
        ("known_map", "map.plr", "give tracks_type, and tracks whose ids are the map's"),
        ("sync_matching_threshold_ms", -1.0, "0 or more is possible"),
    ],
)
def test_a_value_that_is_impossible_is_told_with_what_is(name: str, value: Any, says: str) -> None:
    values = {key: default for key, (default, _) in table().items()}
    with pytest.raises(PelorusError, match=says.replace("(", r"\(")):
        Options.of(values | {name: value})


def test_health_says_why_and_what_to_do() -> None:
    status = of_health(2, (1 << 0) | (1 << 17))
    assert status.level is Level.ERROR
    assert status.do
    assert of_health(0, 0).level is Level.OK


# --- the example ----------------------------------------------------------------------------------


class Kept:
    """Stands for a class of ROS' launch: keeps what it is made of."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named


def test_example_starts_the_node_with_parameters_and_topics_that_it_has(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    modules = {"launch": {"LaunchDescription": Kept}, "launch_ros.actions": {"Node": Kept}}
    for name, classes in (*modules.items(), ("launch_ros", {})):
        module = ModuleType(name)
        vars(module).update(classes)
        monkeypatch.setitem(sys.modules, name, module)
    found = runpy.run_path(str(EXAMPLE / "robot.launch.py"))
    (node,) = found["generate_launch_description"]().given[0]
    file, more = node.named["parameters"]
    given = YAML(typ="safe").load(Path(file))["pelorus"]["ros__parameters"] | more
    assert misspelt(given) == []
    assert Options.of({name: default for name, (default, _) in table().items()} | given).rectified
    topics = {*Estimator(Options()).topics(), "left/camera_info", "right/camera_info"}
    assert {source for source, _ in node.named["remappings"]} == topics
