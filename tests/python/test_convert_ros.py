# SPDX-License-Identifier: MIT
"""Bags of ROS 1, ROS 2 and MCAP: what a robot recorded must come out."""

from __future__ import annotations

import io
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from bags import NS, Recorder
from converted import SHORT, Run, messages_of
from drives import clean
from numpy.typing import NDArray
from pelorus.converters import ros, ros_frames
from pelorus.converters.bag import Bag
from pelorus.converters.streams import Asked, Pictures
from pelorus.errors import PelorusError
from pelorus.io.foreign import ForeignFileError
from pelorus.io.recording import Recording
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Header, Imu, Process, Stereo, Truth, Twist
from PIL import Image
from rendered import BEGIN_NS, FRAMES, HEIGHT, SPEED_MPS, WIDTH, Scene
from rigs import IMU_NOISE, RADTAN, Cameras, camchain, write_yaml
from test_convert_csv import csv_files
from test_convert_euroc import assert_on_surfaces

RIGHT_LATE_NS = 1_000_000
DAMAGES = 60
FORMS = ["ros1", "sqlite3", "mcap", "lone mcap"]


def written(recorder: Recorder, folder: Path, form: str) -> Path:
    folder.mkdir(exist_ok=True)
    if form == "ros1":
        return recorder.write(folder / "drive.bag")
    path = recorder.write(folder / "drive", mcap="mcap" in form)
    return next(path.glob("*.mcap")) if form == "lone mcap" else path


@pytest.fixture
def pairs(kept: Callable[..., Any]) -> list[tuple[NDArray[np.uint8], NDArray[np.uint8]]]:
    """The scene's pictures."""
    found: list[tuple[NDArray[np.uint8], NDArray[np.uint8]]] = kept(
        "rendered raw pairs", lambda: [Scene().pair(k) for k in range(FRAMES)]
    )
    return found


def with_pictures(recorder: Recorder, pairs: list[Any]) -> Recorder:
    """On /cam0 and /cam1, the right ones a little later."""
    for t_ns, (left, right) in zip(Scene().t_ns, pairs, strict=True):
        recorder.image("/cam0/image_raw", t_ns, left, pad=24)
        recorder.image("/cam1/image_raw", t_ns + RIGHT_LATE_NS, right)
    return recorder


def with_odometry(recorder: Recorder) -> Recorder:
    R, p = Scene().body()
    for k, t_ns in enumerate(Scene().t_ns):
        v = (SPEED_MPS, 0.01 * k, 0.0)
        recorder.odometry("/odom", t_ns, v, (0, 0, 0.1 * k), Poses(R[k], p[k]))
    return recorder


@pytest.fixture
def kalibr(tmp_path: Path) -> Path:
    return write_yaml(tmp_path / "c.yaml", camchain(Scene().cameras, (WIDTH, HEIGHT)))


@pytest.mark.parametrize("form", FORMS)
def test_pictures_odometry_and_truth_of_a_bag_become_a_recording(
    form: str, pairs: list[Any], kalibr: Path, tmp_path: Path, pelorus: Run
) -> None:
    recorder = with_odometry(with_pictures(Recorder(1 if form == "ros1" else 2), pairs))
    bag, target = written(recorder, tmp_path, form), tmp_path / "out.plr"
    words = ("--calibration", kalibr, "--truth-topic", "/odom", "--twist-topic", "/odom")
    outcome = pelorus("convert", "ros", bag, target, *words, "--fix", "none")
    assert "/odom: twists of the frame 'base_link'" in outcome.out
    assert "left pictures are /cam0/image_raw, right ones /cam1/image_raw" in outcome.out
    twists = messages_of(target, Twist)
    assert [m.t_ns for m in twists] == Scene().t_ns
    assert np.allclose([m.v_B_mps[1] for m in twists], 0.01 * np.arange(FRAMES))
    assert np.allclose([m.w_B_radps[2] for m in twists], 0.1 * np.arange(FRAMES))
    assert [m.t_ns for m in messages_of(target, Stereo)] == Scene().t_ns
    assert np.allclose([m.p_WB_m for m in messages_of(target, Truth)], Scene().body().p)
    assert_on_surfaces(target)


def test_an_imu_moves_the_body_if_nothing_else_does(
    pairs: list[Any], kalibr: Path, tmp_path: Path, pelorus: Run
) -> None:
    recorder = with_pictures(Recorder(), pairs)
    for k in range(200):
        recorder.imu("/imu", BEGIN_NS + k * 5_000_000, (1, 2, 9 + k / 100), (4, 5, 6))
    target = tmp_path / "out.plr"
    noise = write_yaml(tmp_path / "imu.yaml", {"gyroscope_noise_density": 0.003})
    words = ("--calibration", kalibr, "--calibration", noise)
    pelorus("convert", "ros", written(recorder, tmp_path, "mcap"), target, *words)
    header = messages_of(target, Header)[0]
    assert header.process is Process.IMU
    assert header.noise.gyro_noise == 0.003
    a = np.concatenate([m.a_B_mps2 for m in messages_of(target, Imu)])
    assert np.allclose(a[:, 2], 9 + np.arange(200) / 100)


def test_odometry_takes_its_turns_from_the_gyro_that_is_named(
    pairs: list[Any], kalibr: Path, tmp_path: Path, pelorus: Run
) -> None:
    recorder = with_odometry(with_pictures(Recorder(), pairs))
    for k in range(-20, 200):
        recorder.imu("/imu", BEGIN_NS + k * 5_000_000, (0, 0, 9.81), (0.1, 0.2, 0.3))
    bag, target = written(recorder, tmp_path, "mcap"), tmp_path / "out.plr"
    words = ("--calibration", kalibr, "--fix", "none", "--force")
    outcome = pelorus("convert", "ros", bag, target, *words)
    assert "/imu: not used; --imu-topic or --gyro-topic would use it" in outcome.out
    pelorus("convert", "ros", bag, target, *words, "--gyro-topic", "/imu")
    assert np.allclose([m.w_B_radps for m in messages_of(target, Twist)], [0.1, 0.2, 0.3])
    outcome = pelorus("convert", "ros", bag, target, "--imu-topic", "/imu", "--gyro-topic", "/imu",
                      "--force", "--calibration", kalibr, status=1)  # fmt: skip
    assert "--imu-topic and --gyro-topic: /imu is named twice" in outcome.err


def test_wheels_give_the_speed_and_with_a_track_width_the_turn(
    pairs: list[Any], kalibr: Path, tmp_path: Path, pelorus: Run
) -> None:
    recorder = with_pictures(Recorder(), pairs)
    for t_ns in Scene().t_ns:
        recorder.joints("/joints", t_ns, {"arm": 99.0, "left": 9.0, "right": 11.0})
    bag, target = written(recorder, tmp_path, "sqlite3"), tmp_path / "out.plr"
    words = ["--force", "--calibration", kalibr, "--joint-topic", "/joints", "--joint", "left"]
    words += ["--joint", "right", "--wheel-radius", "0.2"]
    pelorus("convert", "ros", bag, target, *words)
    twists, noise = messages_of(target, Twist), messages_of(target, Header)[0].noise
    assert np.allclose([m.v_B_mps for m in twists], [2.0, 0, 0])
    assert np.allclose([m.w_B_radps for m in twists], 0)
    assert noise.gyro_sigma_z_radps == 3.0
    pelorus("convert", "ros", bag, target, *words, "--track-width", "0.5")
    twists, noise = messages_of(target, Twist), messages_of(target, Header)[0].noise
    assert np.allclose([m.w_B_radps for m in twists], [0, 0, 0.8])
    assert noise.gyro_sigma_z_radps < 0 < noise.gyro_sigma_x_radps
    outcome = pelorus("convert", "ros", bag, target, *words, "--joint", "tail", status=1)
    assert "has the joints arm, left, right with 3 velocities; left, right, tail" in outcome.err


# --- camera_info ----------------------------------------------------------------------------------


@pytest.mark.parametrize("ros", [1, 2])
def test_camera_info_of_raw_pictures_rectifies_them(
    ros: int, pairs: list[Any], tmp_path: Path, pelorus: Run
) -> None:
    cameras = Scene().cameras
    recorder = with_odometry(Recorder(ros))
    for t_ns, pair in zip(Scene().t_ns, pairs, strict=True):
        for side, picture in zip(("left", "right"), pair, strict=True):
            recorder.image(f"/stereo/{side}/image_raw", t_ns, picture)
    for side, info in zip(("left", "right"), infos_of(cameras), strict=True):
        recorder.camera_info(
            f"/stereo/{side}/camera_info", (WIDTH, HEIGHT), distortion_model="plumb_bob", **info
        )
    R_CB, t_CB = cameras.T_LB
    body = tmp_path / "body.json"
    body.write_text(f'{{"R_CB": {R_CB.tolist()}, "t_CB_m": {t_CB.tolist()}}}')
    target = tmp_path / "out.plr"
    bag = written(recorder, tmp_path, "ros1" if ros == 1 else "mcap")
    pelorus("convert", "ros", bag, target, "--extrinsic", body, "--truth-topic", "/odom",
                      "--twist-topic", "/odom", "--fix", "none")  # fmt: skip
    assert_on_surfaces(target)


def infos_of(cameras: Cameras) -> list[dict[str, NDArray[np.float64]]]:
    """K, D, R, P of the left and the right camera, as OpenCV makes them."""
    D = np.array([*RADTAN, 0.0])
    left, right = (
        np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        for fx, fy, cx, cy in (cameras.left, cameras.right)
    )
    T = cameras.T_RL
    R1, R2, P1, P2, *_ = cv2.stereoRectify(left, D, right, D, (WIDTH, HEIGHT), T.R, T.p[:, None])
    return [{"K": left, "D": D, "R": R1, "P": P1}, {"K": right, "D": D, "R": R2, "P": P2}]


@pytest.mark.parametrize("baseline_by_tf", [False, True])
def test_camera_info_and_tf_static_need_no_other_file(
    baseline_by_tf: bool, pairs: list[Any], tmp_path: Path, pelorus: Run
) -> None:
    """And with cameras that call themselves left and right the other way round."""
    cameras = Scene().cameras
    recorder = with_odometry(Recorder())
    T_BL = se3.inverse(cameras.T_LB)
    recorder.transforms(
        "/tf_static",
        NS,
        {
            ("base_link", "rig"): Poses(np.eye(3), T_BL.p),
            ("rig", "a"): Poses(T_BL.R, np.zeros(3)),
            ("a", "b"): se3.inverse(cameras.T_RL),
        },
    )
    names = ("left", "right") if baseline_by_tf else ("right", "left")
    for t_ns, pair in zip(Scene().t_ns, pairs, strict=True):
        for side, picture, frame in zip(names, pair, "ab", strict=True):
            recorder.image(f"/{side}/image_raw", t_ns, picture, frame=frame)
    for side, info in zip(names, infos_of(cameras), strict=True):
        if baseline_by_tf:
            info["P"][:, 3] = 0
        recorder.camera_info(
            f"/{side}/camera_info", (WIDTH, HEIGHT), distortion_model="plumb_bob", **info
        )
    bag, target = written(recorder, tmp_path, "mcap"), tmp_path / "out.plr"
    words = ("--truth-topic", "/odom", "--twist-topic", "/odom", "--fix", "none")
    said = pelorus("convert", "ros", bag, target, *words).out
    assert "the left camera sits on the body as /tf_static says: base_link - rig - a" in said
    assert ("the right camera stands as /tf_static says: a - b" in said) is baseline_by_tf
    assert ("/left/image_raw stands on the right: taken as" in said) is not baseline_by_tf
    assert_on_surfaces(target)
    imu = write_yaml(tmp_path / "imu.yaml", {"imu0": IMU_NOISE | {"time_offset": 0.0}})
    again = tmp_path / "again.plr"
    pelorus("convert", "ros", bag, again, *words, "--calibration", imu)
    one, other = (messages_of(path, Header)[0].camera for path in (again, target))
    assert vars(one) == vars(other)


def test_the_frame_of_rectified_pictures_is_turned_as_camera_info_says(
    pairs: list[Any], tmp_path: Path, pelorus: Run
) -> None:
    """/tf_static has the camera as it was built, not the one that rectification makes of it."""
    cameras = Scene().cameras
    infos = infos_of(cameras)
    recorder = with_odometry(Recorder())
    recorder.transforms("/tf_static", NS, {("base_link", "a"): se3.inverse(cameras.T_LB)})
    for t_ns, pair in zip(Scene().t_ns, pairs, strict=True):
        for side, picture, info in zip(("left", "right"), pair, infos, strict=True):
            size = (WIDTH, HEIGHT)
            maps = cv2.initUndistortRectifyMap(
                info["K"], info["D"], info["R"], info["P"][:, :3], size, cv2.CV_32FC1
            )
            made = cv2.remap(picture, *maps, cv2.INTER_LINEAR)
            recorder.image(f"/{side}/image_rect", t_ns, np.asarray(made, np.uint8), frame="a")
    for side, info in zip(("left", "right"), infos, strict=True):
        recorder.camera_info(
            f"/{side}/camera_info", (WIDTH, HEIGHT), distortion_model="plumb_bob", **info
        )
    bag, target = written(recorder, tmp_path, "mcap"), tmp_path / "out.plr"
    words = ("--truth-topic", "/odom", "--twist-topic", "/odom", "--fix", "none")
    pelorus("convert", "ros", bag, target, *words)
    header = messages_of(target, Header)[0]
    assert np.abs(header.R_CB - infos[0]["R"] @ cameras.T_LB.R).max() < 1e-9
    assert_on_surfaces(target)


def test_pictures_that_are_rectified_have_the_camera_of_p(tmp_path: Path, pelorus: Run) -> None:
    """Packed ones, too; and their camera_info may have any name, if it is beside them or named."""
    recorder = with_odometry(Recorder())
    blobs = np.random.default_rng(1).uniform(0, 255, (240, 500)).astype(np.uint8)
    scene = cv2.GaussianBlur(blobs, (0, 0), 2)
    for k, t_ns in enumerate(Scene().t_ns):
        for side, shift in (("left", 50 + k), ("right", 60 + k)):
            packed = cv2.imencode(".png", scene[:, shift : shift + 320])[1].tobytes()
            recorder.compressed(f"/cam/{side}/image_rect/compressed", t_ns, packed)
    P = np.array([[250.0, 0, 160, 0], [0, 250, 120, 0], [0, 0, 1, 0]])
    infos = {"/cam/left/angaben": 0.0, "/others/right": -25.0}
    for topic, by_baseline in infos.items():
        P[0, 3] = by_baseline
        matrices = {"K": 9 * np.eye(3), "D": np.ones(5), "R": np.eye(3), "P": P}
        recorder.camera_info(topic, (320, 240), distortion_model="plumb_bob", **matrices)
    body = tmp_path / "body.json"
    body.write_text('{"R_CB": [[1,0,0],[0,1,0],[0,0,1]], "t_CB_m": [0, 0, 0]}')
    target = tmp_path / "out.plr"
    bag = written(recorder, tmp_path, "mcap")
    words = ("--extrinsic", body, "--fix", "none")
    assert "--right-info-topic" in pelorus("convert", "ros", bag, target, *words, status=1).err
    named = (*words, "--right-info-topic", "/others/right")
    pelorus("convert", "ros", bag, target, *named)
    camera, stereos = messages_of(target, Header)[0].camera, messages_of(target, Stereo)
    assert (camera.fx_px, camera.cx_px, camera.cy_px) == (250, 160, 120)
    assert camera.baseline_m == pytest.approx(0.1)
    pixels = np.concatenate([m.pixels for m in stereos])
    assert np.median(pixels[:, 0] - pixels[:, 2]) == pytest.approx(10, abs=0.05)


# --- tracks ---------------------------------------------------------------------------------------


def tracked(recorder: Recorder, drive: Recording, topic: str, rays: bool) -> Recorder:
    camera, tracks, bounds = drive.header.camera, drive.tracks, drive.tracks.bounds()
    for k, t in enumerate(drive.frame_t_ns.tolist()):
        rows = slice(bounds[k], bounds[k + 1])
        pixels, id = tracks.pixels[rows], tracks.id[rows]
        if rays:
            middle = np.tile([camera.cx_px, camera.cy_px], 2)
            focal = np.tile([camera.fx_px, camera.fy_px], 2)
            numbers = np.column_stack((id, (pixels - middle) / focal))
            recorder.features(topic, t + NS, numbers)
        else:
            names = dict(zip(("uL", "vL", "uR", "vR"), pixels.T, strict=True))
            recorder.cloud(topic, t + NS, {"id": id, **names})
    for t, v, w in zip(drive.twist_t_ns.tolist(), drive.v_B_mps, drive.w_B_radps, strict=True):
        recorder.twist_stamped("/twist", t + NS, v, w)
    return recorder


@pytest.mark.parametrize(("ros", "rays"), [(1, True), (2, False), (2, True)])
def test_tracks_of_a_bag_arrive_as_they_are(
    ros: int, rays: bool, tmp_path: Path, pelorus: Run
) -> None:
    drive = clean(**SHORT)
    csv_files(tmp_path, drive)
    recorder = tracked(Recorder(ros), drive, "/tracks", rays)
    target = tmp_path / "out.plr"
    words = ("--tracks-topic", "/tracks", "--calibration", tmp_path / "camera.json")
    bag = written(recorder, tmp_path, "ros1" if ros == 1 else "sqlite3")
    pelorus("convert", "ros", bag, target, *words, "--fix", "none")
    frames, twists = messages_of(target, Stereo), messages_of(target, Twist)
    assert [m.t_ns for m in frames] == (drive.frame_t_ns + NS).tolist()
    assert np.array_equal(np.concatenate([m.ids for m in frames]), drive.tracks.id)
    pixels = np.concatenate([m.pixels for m in frames])
    assert np.abs(pixels - drive.tracks.pixels).max() < 1e-4
    assert np.array_equal([m.v_B_mps for m in twists], drive.v_B_mps)


# --- pictures -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("encoding", "made"),
    [
        ("mono8", lambda g: g),
        ("mono16", lambda g: g.astype("<u2") << 8),
        ("rgb8", lambda g: np.dstack([g] * 3)),
        ("bgra8", lambda g: np.dstack([g, g, g, 255 - g])),
        ("yuv422", lambda g: np.dstack([255 - g, g])),  # U Y V Y
        ("yuyv", lambda g: np.dstack([g, 255 - g])),
    ],
)
def test_a_picture_of_any_encoding_is_the_same_in_grey(
    encoding: str, made: Callable[[Any], Any]
) -> None:
    grey = np.random.default_rng(2).integers(0, 256, (80, 100)).astype(np.uint8)
    recorder = Recorder()
    recorder.image("/x", NS, made(grey), encoding, pad=4)
    assert np.array_equal(ros_frames.gray(Path("x"), recorder.found[0][3]), grey)
    content = io.BytesIO()
    Image.fromarray(grey).save(content, "PNG")
    recorder.compressed("/x", NS, content.getvalue())
    assert np.array_equal(ros_frames.gray(Path("x"), recorder.found[1][3]), grey)


def test_an_encoding_that_is_not_known_is_told() -> None:
    recorder = Recorder()
    recorder.image("/x", NS, np.zeros((80, 100), np.uint8), "32FC1")
    with pytest.raises(ForeignFileError, match="encoded as 32FC1; mono8, 8UC1"):
        ros_frames.gray(Path("x"), recorder.found[0][3])
    recorder.found[0][3].encoding = "rgb8"
    with pytest.raises(ForeignFileError, match="a picture of 100 x 80 has 8000 bytes"):
        ros_frames.gray(Path("x"), recorder.found[0][3])


# --- bad input ------------------------------------------------------------------------------------


def test_a_topic_that_is_not_there_is_answered_with_those_that_are(
    pairs: list[Any], kalibr: Path, tmp_path: Path, pelorus: Run
) -> None:
    bag = written(with_odometry(with_pictures(Recorder(), pairs)), tmp_path, "mcap")
    target, given = tmp_path / "out.plr", ("--calibration", kalibr)
    for words, said in (
        ((*given, "--imu-topic", "/imu0"), "has no topic /imu0; there are:"),
        ((*given, "--imu-topic", "/odom"), "/odom holds 6 messages of nav_msgs/msg/Odometry; some"),
        ((*given, "--left-topic", "/l", "--right-topic", "/r"), "has no topic /l; there are:"),
        ((), "which topics of sensor_msgs/msg/CameraInfo are the cameras'? --left-info-topic"),
        ((*given, "--truth-topic", "/odom"), "what moves the body? 0 topics hold twists"),
        ((*given, "--pair-within", "0.5"), "0 have one of the 6 of /cam1/image_raw within 0.5"),
        ((*given, "--joint", "left"), "wheels: --joint-topic TOPIC, --joint NAME (once or more)"),
        ((*given, "--tracks-topic", "/odom"), "holds no tracks: lacks id, uL, vL, uR, vR"),
    ):
        outcome = pelorus("convert", "ros", bag, target, *words, status=1)
        assert said in outcome.err, outcome.err
        if "there are:" in said:
            assert "/cam0/image_raw  sensor_msgs/msg/Image  6 messages, 9.98 Hz" in outcome.err
        assert not list(tmp_path.glob("out*"))


def test_a_bag_that_lacks_many_partners_is_refused_as_a_folder_is(
    pairs: list[Any], kalibr: Path, tmp_path: Path, pelorus: Run
) -> None:
    recorder = Recorder()
    for k, (t_ns, (left, right)) in enumerate(zip(Scene().t_ns, pairs, strict=True)):
        recorder.image("/cam0/image_raw", t_ns, left)
        if k % 2 == 0:
            recorder.image("/cam1/image_raw", t_ns, right)
    bag, target = written(with_odometry(recorder), tmp_path, "mcap"), tmp_path / "out.plr"
    outcome = pelorus("convert", "ros", bag, target, "--calibration", kalibr, status=1)
    assert "of 6 pictures of /cam0/image_raw 3 have one of the 3 of /cam1/image_raw" in outcome.err
    assert not target.exists()


def test_pictures_of_another_size_in_mid_bag_are_told(
    pairs: list[Any], kalibr: Path, tmp_path: Path, pelorus: Run
) -> None:
    for side, where in ((0, "cam0"), (1, "cam1")):
        changed = [list(pair) for pair in pairs]
        changed[3][side] = changed[3][side][:200].copy()
        recorder = with_odometry(with_pictures(Recorder(), changed))
        bag = written(recorder, tmp_path / f"{side}", "sqlite3")
        outcome = pelorus(
            "convert", "ros", bag, tmp_path / "out.plr", "--calibration", kalibr, status=1
        )
        assert f"{where}/image_raw: has {WIDTH} x 200 pixels; {WIDTH} x {HEIGHT}" in outcome.err
        assert not list(tmp_path.glob("out*"))


def test_headers_without_a_time_are_told_and_the_arrival_taken_instead(
    pairs: list[Any], kalibr: Path, tmp_path: Path, pelorus: Run
) -> None:
    recorder = with_pictures(Recorder(), pairs)
    for t_ns in Scene().t_ns:
        recorder.twist_stamped("/twist", 0, (1, 0, 0), (0, 0, 0))
        topic, kind, _, message = recorder.found.pop()
        recorder.found.append((topic, kind, t_ns, message))
    bag, target = written(recorder, tmp_path, "mcap"), tmp_path / "out.plr"
    outcome = pelorus("convert", "ros", bag, target, "--calibration", kalibr, status=1)
    assert (
        "/twist: 6 of 6 headers have no time; times in header.stamp are expected, or --stamps"
        in (outcome.err)
    )
    words = ("--calibration", kalibr, "--stamps", "log", "--fix", "none")
    pelorus("convert", "ros", bag, target, *words)
    assert [m.t_ns for m in messages_of(target, Twist)] == Scene().t_ns


def test_what_is_no_bag_is_told_and_a_cut_one_too(
    pairs: list[Any], kalibr: Path, tmp_path: Path, pelorus: Run
) -> None:
    whole = written(with_odometry(with_pictures(Recorder(1), pairs)), tmp_path, "ros1")
    content = whole.read_bytes()
    for name, bytes_, said in (
        ("cut.bag", content[: len(content) // 2], "cannot be read as a bag: "),
        ("empty.bag", b"", "cannot be read as a bag: "),
        ("words.mcap", b"no bag\n" * 100, "cannot be read as a bag: "),
        ("zeros.db3", bytes(5000), "cannot be read as a bag: "),
        ("x.txt", b"1 2 3\n", "cannot be read as a bag: "),
    ):
        path = tmp_path / name
        path.write_bytes(bytes_)
        outcome = pelorus(
            "convert", "ros", path, tmp_path / "out.plr", "--calibration", kalibr, status=1
        )
        assert f"{path}: {said}" in outcome.err
        assert "rosbag reindex" in outcome.err
    outcome = pelorus("convert", "ros", tmp_path / "nix", tmp_path / "out.plr", status=1)
    assert "nix: there is no such file or folder" in outcome.err
    (tmp_path / "folder").mkdir()
    outcome = pelorus("convert", "ros", tmp_path / "folder", tmp_path / "out.plr", status=1)
    assert "is a folder without metadata.yaml; a ROS 1 bag (.bag)" in outcome.err
    assert not list(tmp_path.glob("out*"))


@pytest.mark.parametrize("form", ["ros1", "sqlite3", "lone mcap"])
def test_damage_anywhere_in_a_bag_is_refused_or_read_and_never_something_else(
    form: str, kalibr: Path, tmp_path: Path
) -> None:
    recorder = Recorder(1 if form == "ros1" else 2)
    for k in range(6):
        recorder.twist_stamped("/twist", (k + 1) * NS, (1, 0, 0), (0, 0, 0))
        for topic in ("/cam0/image_raw", "/cam1/image_raw"):
            recorder.image(topic, (k + 1) * NS, np.zeros((64, 80), np.uint8))
    path = written(recorder, tmp_path, form)
    path = next(path.glob("*.db3")) if path.is_dir() else path
    content, chance, refused = path.read_bytes(), random.Random(1), 0
    damaged = tmp_path / f"damaged{path.suffix}"
    for _ in range(DAMAGES):
        harmed = bytearray(content)
        for _ in range(3):
            harmed[chance.randrange(len(harmed))] = chance.randrange(256)
        harmed[chance.randrange(3000) - 3000] ^= 255
        damaged.write_bytes(harmed[: chance.randrange(1, 4 * len(harmed))])
        try:
            with Bag(damaged) as bag:
                found = ros.read(bag, ros.Topics(ros_frames.Cameras()), Asked((kalibr,)))
                assert isinstance(found.frames, Pictures)
                list(found.frames.read())
        except PelorusError:
            refused += 1
    assert refused > DAMAGES // 8


def test_a_bag_is_closed_again(tmp_path: Path) -> None:
    bag = written(with_odometry(Recorder()), tmp_path, "mcap")
    with Bag(bag) as opened:
        assert len(list(opened.messages(["/odom"]))) == FRAMES
    with pytest.raises(ForeignFileError, match="not open"):
        list(opened.messages(["/odom"]))
