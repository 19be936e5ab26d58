# SPDX-License-Identifier: MIT
"""A bag's frames: what /tf_static says of camera and gyro; and which topics are a pair."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bags import NS, Recorder
from converted import Run, messages_of
from drives import clean
from numpy.typing import NDArray
from pelorus.converters import ros_frames
from pelorus.converters.bag import Bag
from pelorus.errors import PelorusError
from pelorus.io.recording import Recording
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig.read import read_rig
from pelorus.wire.frames import Header
from rendered import HEIGHT, WIDTH, Scene
from rigs import camchain, write_yaml
from scipy.spatial.transform import Rotation
from test_convert_ros import written
from test_ros_world import DRIVE, odometry, of_cameras, twists_of, with_tracks

Floats = NDArray[np.float64]


@pytest.fixture
def drive() -> Recording:
    return clean(**DRIVE)


# --- frames ---------------------------------------------------------------------------------------


def links(drive: Recording, names: Iterable[str]) -> dict[tuple[str, str], Poses]:
    """base - mast - plate - the camera's optical frame, so that it is where the drive has it."""
    base, mast, plate, optical = names
    T_BM = Poses(Rotation.from_rotvec([0, 0, 0.4]).as_matrix(), np.array([0.2, -0.1, 0.6]))
    T_BP = Poses(Rotation.from_rotvec([0, -0.7, 0]).as_matrix(), np.array([-0.5, 0.0, 0.9]))
    T_BC = se3.inverse(drive.T_CB)
    return {
        (base, mast): T_BM,
        (plate, base): se3.inverse(T_BP),  # a tree whose root lies on the way
        (plate, optical): se3.compose(se3.inverse(T_BP), T_BC),
    }


NAMES = ("base_link", "mast", "plate", "left_optical")


def assert_on_body(target: Path, drive: Recording) -> None:
    header = messages_of(target, Header)[0]
    assert np.abs(header.R_CB - drive.header.R_CB).max() < 1e-9
    assert np.abs(header.t_CB_m - drive.header.t_CB_m).max() < 1e-9


@pytest.mark.parametrize("ros", [1, 2])
def test_tf_static_tells_where_the_camera_sits_and_the_chain_is_said(
    ros: int, drive: Recording, tmp_path: Path, pelorus: Run
) -> None:
    recorder = with_tracks(Recorder(ros), drive, "/left_optical" if ros == 1 else "left_optical")
    odometry(recorder, drive, drive.v_B_mps, drive.w_B_radps)
    for k in range(3):  # latched, and said again
        recorder.transforms("/tf_static", NS + k, links(drive, NAMES))
    bag = written(recorder, tmp_path, "ros1" if ros == 1 else "mcap")
    target = tmp_path / "out.plr"
    said = pelorus("convert", "ros", bag, target, *of_cameras(tmp_path, drive)).out
    assert "as /tf_static says: base_link - plate - left_optical" in said
    assert_on_body(target, drive)


def test_chains_that_lack_move_or_are_told_twice_end_in_a_sentence(
    drive: Recording, tmp_path: Path, pelorus: Run
) -> None:
    whole = links(drive, NAMES)
    turned = {("base_link", "plate"): Poses(np.eye(3), np.array([0.0, 0.0, 1.0]))}
    optical = {("left_optical", "left_optical_frame"): Poses(np.eye(3)[[1, 2, 0]], np.zeros(3))}
    cut = {pair: T for pair, T in whole.items() if pair != ("plate", "base_link")}
    parts: list[tuple[dict[Any, Any], dict[Any, Any], str]] = [
        (cut, {}, "no chain of transforms joins 'base_link' and 'left_optical': they end at "
                  "'base_link' and at 'plate'; --extrinsic FILE is expected"),
        (cut, whole, ""),
        (whole | optical, {}, "which has the optical frame left_optical_frame: in which does"),
        ({("gimbal", "left_optical"): whole["plate", "left_optical"]},
         {("base_link", "gimbal"): whole["base_link", "mast"]},
         "'base_link' to 'gimbal' moves (/tf), so it tells no mounting; --extrinsic FILE is "
         "expected"),
        ({("a", "b"): whole["base_link", "mast"]}, {}, "no transform of /tf_static has the frame "
         "'base_link'; --extrinsic FILE is expected, or --body-frame and --camera-frame, one "
         "of a, b"),
    ]  # fmt: skip
    target, calibration = tmp_path / "out.plr", of_cameras(tmp_path, drive)
    for k, (static, dynamic, said) in enumerate(parts):
        recorder = with_tracks(Recorder(), drive, "left_optical")
        odometry(recorder, drive, drive.v_B_mps, drive.w_B_radps)
        recorder.transforms("/tf_static", NS, static)
        for t in range(2 if dynamic else 0):
            moved = {pair: Poses(T.R, T.p + t * ("gimbal" in pair)) for pair, T in dynamic.items()}
            recorder.transforms("/tf", (1 + t) * NS, moved)
        bag = written(recorder, tmp_path / str(k), "mcap")
        outcome = pelorus("convert", "ros", bag, target, *calibration, status=1 if said else 0)
        assert said in outcome.err, outcome.err
    recorder = with_tracks(Recorder(), drive, "left_optical")
    odometry(recorder, drive, drive.v_B_mps, drive.w_B_radps)
    recorder.transforms("/tf_static", NS, whole)
    recorder.transforms("/tf_static", NS, {("base_link", "left_optical"): turned.popitem()[1]})
    bag = written(recorder, tmp_path / "twice", "mcap")
    outcome = pelorus("convert", "ros", bag, target, *calibration, status=1)
    assert "says twice, and differently, where 'left_optical' stands" in outcome.err


def test_frames_that_nobody_names_are_asked_for_and_may_be_given(
    drive: Recording, tmp_path: Path, pelorus: Run
) -> None:
    recorder = with_tracks(Recorder(), drive)
    odometry(recorder, drive, drive.v_B_mps, drive.w_B_radps, child="")
    recorder.transforms("/tf_static", NS, links(drive, NAMES))
    bag = written(recorder, tmp_path, "mcap")
    target, calibration = tmp_path / "out.plr", of_cameras(tmp_path, drive)
    said = pelorus("convert", "ros", bag, target, *calibration, status=1).err
    assert (
        "the left camera's messages do not name their frame; --camera-frame NAME is expected"
        in said
    )
    camera = ("--camera-frame", "left_optical", "--body-frame", "base_link")
    pelorus("convert", "ros", bag, target, *calibration, *camera)
    assert_on_body(target, drive)


def test_a_gyro_on_another_frame_is_turned_into_the_body(
    drive: Recording, tmp_path: Path, pelorus: Run
) -> None:
    R_BI = Rotation.from_rotvec([0.3, -1.2, 2.0]).as_matrix()
    recorder = with_tracks(Recorder(), drive, "left_optical")
    odometry(recorder, drive, drive.v_B_mps, drive.w_B_radps)
    for t in range(0, 14 * NS, 5_000_000):
        recorder.imu("/imu", NS // 2 + t, (0, 0, 9.8), R_BI.T @ (0.1, 0.2, 0.3), "imu_link")
    both = links(drive, NAMES) | {("base_link", "imu_link"): Poses(R_BI, np.ones(3))}
    recorder.transforms("/tf_static", NS, both)
    bag = written(recorder, tmp_path, "mcap")
    target, calibration = tmp_path / "out.plr", of_cameras(tmp_path, drive)
    said = pelorus("convert", "ros", bag, target, *calibration, "--gyro-topic", "/imu").out
    assert "its rates are turned into 'base_link' as /tf_static says: imu_link - base_link" in said
    assert np.allclose(twists_of(target)[:, 3:], [0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("topics", "swapped", "found"),
    [
        (("/zed/left/image", "/zed/right/image", "/zed/depth"), True, "/zed/left/image"),
        (("/Left/x", "/Left/x/compressed", "/Right/x", "/Right/x/compressed"), False, "/Left/x"),
        (("/cam0/image_raw/compressed", "/cam1/image_raw/compressed"), False, "/cam0/image_raw"),
        (("/d455/camera0/i", "/d455/camera1/i", "/d455/camera2/i"), False, "/d455/camera0/i"),
        (("/cam0/image_raw", "/cam1/image_raw"), True, "/cam1/image_raw"),
        (("/left/image_raw", "/right/image_raw", "/left/image_rect", "/right/image_rect"), False,
         "are expected (sensor_msgs/msg/Image, sensor_msgs/msg/CompressedImage), or "
         "--tracks-topic; "
         "pairs are /left/image_raw and /right/image_raw, /left/image_rect and /right/image_rect;"),
        (("/front", "/rear"), False, "which topics are the left and the right camera?"),
    ],
)  # fmt: skip
def test_two_topics_that_differ_in_the_cameras_word_alone_are_the_pair(
    topics: tuple[str, ...], swapped: bool, found: str, tmp_path: Path
) -> None:
    kalibr = write_yaml(tmp_path / "c.yaml", camchain(Scene().cameras, (WIDTH, HEIGHT)))
    recorder, grey = Recorder(), np.zeros((64, 80), np.uint8)
    for topic in topics:
        if topic.endswith("/compressed"):
            recorder.compressed(topic, NS, b"")
        else:
            recorder.image(topic, NS, grey)
    rig = replace(read_rig((kalibr,)), swapped=swapped, topics=())
    with Bag(written(recorder, tmp_path, "mcap")) as bag:
        try:
            outcome = ros_frames.chosen(bag, ros_frames.Cameras(), rig).left
        except PelorusError as error:
            outcome = str(error)
    assert found in outcome


@pytest.mark.parametrize(("apart_ms", "told"), [(0.4, False), (2.5, False), (-11.0, True)])
def test_pairs_that_are_some_ms_apart_are_remarked(apart_ms: float, told: bool) -> None:
    left = NS + np.arange(50) * 50_000_000
    words = ros_frames.apart_words(np.stack((left, left + round(apart_ms * 1e6)), axis=-1))
    assert bool(words) is told
    if told:
        assert "are 11 ms apart in the median, up to 11 ms, the left ones later" in words[0]
