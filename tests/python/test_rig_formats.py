# SPDX-License-Identifier: MIT
"""Calibrations as other SLAM programs write them: all say the same of one pair of cameras."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from pelorus.converters.streams import RawTracks, Streams, Twists, recording
from pelorus.errors import PelorusError
from pelorus.io.foreign import ForeignFileError
from pelorus.io.tracks import Tracks, project
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.rig import read as rig_files
from pelorus.rig.lens import LensModel
from pelorus.rig.rig import Rig
from rigs import (
    IMU_NOISE,
    SIZE,
    Cameras,
    camchain,
    fisheye,
    matrix,
    opencv_matrices,
    opencv_text,
    points,
    write_yaml,
)
from scipy.spatial.transform import Rotation
from test_rig import assert_rectifies

Floats = NDArray[np.float64]
PLAIN = Cameras("none", coefficients=())
RECTIFIED = replace(
    PLAIN,
    right=PLAIN.left,
    T_RL=Poses(np.eye(3), np.array([-0.093, 0.0, 0.0])),
)
NOISE = {"gyro": 1.7e-4, "accel": 2e-3, "gyro_walk": 2e-5, "accel_walk": 3e-3}
DAMAGES = 60


def rows(M: Floats) -> str:
    """All numbers of a matrix."""
    return "[" + ", ".join(f"{float(x):.15g}" for x in np.ravel(M)) + "]"


def whole(T: Poses) -> Floats:
    return np.array(matrix(T))


def on_imu(cameras: Cameras) -> tuple[Poses, Poses]:
    """T_BL and T_BR."""
    T_BL = se3.inverse(cameras.T_LB)
    return T_BL, se3.compose(T_BL, se3.inverse(cameras.T_RL))


def opencv_object(name: str, M: Floats, tight: bool = False) -> str:
    """`tight`: as people write it by hand, without a blank behind the colon."""
    M = np.atleast_2d(M)
    colon = ":" if tight else ": "
    return (
        f"{name}: !!opencv-matrix\n   rows: {M.shape[0]}\n   cols: {M.shape[1]}\n   dt: d\n"
        f"   data{colon}{rows(M)}\n"
    )


# --- the programs ---------------------------------------------------------------------------------


def orb_imu() -> str:
    return (
        "IMU.NoiseGyro: 1.7e-04\nIMU.NoiseAcc: 2.0e-03\nIMU.GyroWalk: 2.e-05\nIMU.AccWalk: 3.e-03\n"
    )


def orb_camera(name: str, intrinsics: Any, D: Any, fish: bool) -> str:
    names = ("k1", "k2", "k3", "k4") if fish else ("k1", "k2", "p1", "p2")
    pairs = [*zip(("fx", "fy", "cx", "cy"), intrinsics, strict=True), *zip(names, D, strict=False)]
    return "".join(f"{name}.{key}: {value}\n" for key, value in pairs)


def orb3(cameras: Cameras, folder: Path) -> list[Path]:
    """ORB-SLAM3 from 1.0 on."""
    fish = cameras.model == "equidistant"
    text = '%YAML:1.0\nFile.version: "1.0"\nViewer.PointSize:2\n'
    text += f'Camera.type: "{"KannalaBrandt8" if fish else "PinHole"}"\n'
    text += orb_camera("Camera1", cameras.left, cameras.coefficients, fish)
    text += orb_camera("Camera2", cameras.right, cameras.coefficients, fish)
    text += f"Camera.width: {SIZE[0]}\nCamera.height: {SIZE[1]}\n"
    text += opencv_object("Stereo.T_c1_c2", whole(se3.inverse(cameras.T_RL)))
    text += opencv_object("IMU.T_b_c1", whole(on_imu(cameras)[0])) + orb_imu()
    (folder / "orb.yaml").write_text(text)
    return [folder / "orb.yaml"]


def orb_before(cameras: Cameras, folder: Path) -> list[Path]:
    """ORB-SLAM3 before: rectifying matrices, or a fisheye with Tlr."""
    text = "%YAML:1.0\n" + orb_imu() + f"Camera.width: {SIZE[0]}\nCamera.height: {SIZE[1]}\n"
    text += opencv_object("Tbc", whole(on_imu(cameras)[0]), tight=True)
    if cameras.model == "equidistant":
        text += 'Camera.type: "KannalaBrandt8"\nCamera.bf: 19.3\n'
        text += orb_camera("Camera", cameras.left, cameras.coefficients, True)
        text += orb_camera("Camera2", cameras.right, cameras.coefficients, True)
        text += opencv_object("Tlr", whole(se3.inverse(cameras.T_RL))[:3])
    else:
        left, right = infos(cameras)
        text += 'Camera.type: "PinHole"\n' + orb_camera("Camera", (435, 435, 367, 252), (), False)
        for side, info in (("LEFT", left), ("RIGHT", right)):
            text += f"{side}.width: {SIZE[0]}\n{side}.height: {SIZE[1]}\n"
            for key, M in info.items():
                text += opencv_object(f"{side}.{key}", M, tight=key == "D")
    (folder / "orb.yaml").write_text(text)
    return [folder / "orb.yaml"]


def K(intrinsics: tuple[float, ...]) -> Floats:
    fx, fy, cx, cy = intrinsics
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def infos(cameras: Cameras) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """K, D, R, P of both, as OpenCV makes them."""
    D = np.array([*cameras.coefficients, 0.0][:5])
    left, right = K(cameras.left), K(cameras.right)
    R1, R2, P1, P2, *_ = cv2.stereoRectify(
        left, D, right, D, SIZE, cameras.T_RL.R, cameras.T_RL.p[:, None]
    )
    return {"K": left, "D": D, "R": R1, "P": P1}, {"K": right, "D": D, "R": R2, "P": P2}


def vins(cameras: Cameras, folder: Path) -> list[Path]:
    """VINS-Fusion: the cameras' files are found by their names."""
    text = "%YAML:1.0\n\nimu: 1\nnum_of_cam: 2\nimage0_topic: /a\nimage1_topic: /b\ntd: 0.0125\n"
    text += 'cam0_calib: "left.yaml"\ncam1_calib: "right.yaml"\nacc_n: 0.1\ngyr_n: 0.01\n'
    for k, T in enumerate(on_imu(cameras)):
        text += opencv_object(f"body_T_cam{k}", whole(T))
    (folder / "config.yaml").write_text(text)
    for name, (fx, fy, cx, cy) in (("left", cameras.left), ("right", cameras.right)):
        D = cameras.coefficients
        file = f"%YAML:1.0\n---\ncamera_name: {name}\n"
        file += f"image_width: {SIZE[0]}\nimage_height: {SIZE[1]}\n"
        if cameras.model == "equidistant":
            numbers = dict(zip(("k2", "k3", "k4", "k5"), D, strict=True))
            numbers |= {"mu": fx, "mv": fy, "u0": cx, "v0": cy}
            file += "model_type: KANNALA_BRANDT\n" + block("projection_parameters", numbers)
        else:
            numbers = dict(zip(("k1", "k2", "p1", "p2"), D or (0, 0, 0, 0), strict=True))
            file += "model_type: PINHOLE\n" + block("distortion_parameters", numbers)
            file += block("projection_parameters", {"fx": fx, "fy": fy, "cx": cx, "cy": cy})
        (folder / f"{name}.yaml").write_text(file)
    return [folder / "config.yaml"]


def block(name: str, numbers: dict[str, float]) -> str:
    return f"{name}:\n" + "".join(f"   {key}: {value!r}\n" for key, value in numbers.items())


def basalt(cameras: Cameras, folder: Path) -> list[Path]:
    def pose(T: Poses) -> dict[str, float]:
        q = Rotation.from_matrix(T.R).as_quat()
        return dict(zip(("px", "py", "pz", "qx", "qy", "qz", "qw"), [*T.p, *q], strict=True))

    kinds = {"equidistant": "kb4", "none": "pinhole", "radtan": "pinhole-radtan8"}
    names = {"equidistant": ("k1", "k2", "k3", "k4"), "none": ()}.get(
        cameras.model, ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    )
    each = []
    for intrinsics in (cameras.left, cameras.right):
        D = [*cameras.coefficients, 0.0, 0.0, 0.0, 0.0][: len(names)]
        numbers = dict(zip(("fx", "fy", "cx", "cy"), intrinsics, strict=True))
        numbers |= dict(zip(names, D, strict=True))
        each.append({"camera_type": kinds[cameras.model], "intrinsics": numbers})
    content = {
        "T_imu_cam": [pose(T) for T in on_imu(cameras)],
        "intrinsics": each,
        "resolution": [list(SIZE), list(SIZE)],
        "calib_accel_bias": [0.0] * 9,
        "calib_gyro_bias": [0.0] * 12,
        "imu_update_rate": 200.0,
        "accel_noise_std": [NOISE["accel"]] * 3,
        "gyro_noise_std": [NOISE["gyro"]] * 3,
        "accel_bias_std": [NOISE["accel_walk"]] * 3,
        "gyro_bias_std": [NOISE["gyro_walk"]] * 3,
        "cam_time_offset_ns": 12_500_000,
        "vignette": [],
    }
    (folder / "basalt.json").write_text(json.dumps({"value0": content}))
    return [folder / "basalt.json"]


def okvis(cameras: Cameras, folder: Path) -> list[Path]:
    text = "%YAML:1.0\ncameras:\n"
    kinds = {"equidistant": "equidistant", "radtan": "radialtangential", "none": "none"}
    for T, (fx, fy, cx, cy) in zip(on_imu(cameras), (cameras.left, cameras.right), strict=True):
        text += (
            f"     - {{T_SC:\n        {rows(whole(T))},\n        image_dimension: {list(SIZE)},\n"
        )
        text += f"        distortion_coefficients: {list(cameras.coefficients)},\n"
        text += f"        distortion_type: {kinds[cameras.model]},\n"
        text += f"        focal_length: [{fx}, {fy}],\n        principal_point: [{cx}, {cy}]}}\n\n"
    text += "camera_params:\n    camera_rate: 20 # of frames\n    image_delay: -0.0125\n"
    text += "imu_params:\n    a_max: 176.0\n    sigma_g_c: 1.7e-4 # gyro\n    sigma_a_c: 2.0e-3\n"
    text += "    sigma_gw_c: 2.0e-5\n    sigma_aw_c: 3.0e-3\n"
    (folder / "okvis.yaml").write_text(text)
    return [folder / "okvis.yaml"]


def msckf(cameras: Cameras, folder: Path) -> list[Path]:
    """Kalibr's, with each matrix in one list, and where the body stands."""
    text = ""
    for name, camera in camchain(cameras, timeshift_cam_imu=0.0125).items():
        text += f"{name}:\n"
        for key, value in camera.items():
            flat = rows(np.array(value)) if key.startswith("T_") else value
            text += f"  {key}: {flat}\n"
    (folder / "chain.yaml").write_text(f"{text}T_imu_body:\n  {rows(np.eye(4))}\n")
    return [folder / "chain.yaml", write_yaml(folder / "imu.yaml", IMU_NOISE)]


def camera_info(cameras: Cameras, folder: Path) -> list[Path]:
    """The two files of camera_calibration."""
    paths = []
    keys = {"K": "camera_matrix", "D": "distortion_coefficients", "R": "rectification_matrix"}
    for side, info in zip(("left", "right"), infos(cameras), strict=True):
        text = f"image_width: {SIZE[0]}\nimage_height: {SIZE[1]}\ncamera_name: {side}\n"
        text += "distortion_model: plumb_bob\n"
        for key, value in info.items():
            M = np.atleast_2d(value)
            text += f"{keys.get(key, 'projection_matrix')}:\n  rows: {M.shape[0]}\n"
            text += f"  cols: {M.shape[1]}\n  data: {rows(M)}\n"
        (folder / f"{side}.yaml").write_text(text)
        paths.append(folder / f"{side}.yaml")
    return paths


def opencv_xml(cameras: Cameras, folder: Path) -> list[Path]:
    """The stereo calibration as cv::FileStorage itself writes it."""
    path = folder / "stereo.xml"
    storage = cv2.FileStorage(str(path), cv2.FileStorage_WRITE)
    for name, value in opencv_matrices(cameras).items():
        if isinstance(value, str):
            continue
        storage.write(name, np.atleast_2d(np.asarray(value, np.float64)))
    storage.release()
    end = "</opencv_storage>"
    size = f"<imageSize>\n  {SIZE[0]} {SIZE[1]}</imageSize>\n"  # as C++ writes a cv::Size
    path.write_text(path.read_text().replace(end, size + end))
    return [path]


def zed(cameras: Cameras, folder: Path) -> list[Path]:
    """Writes three resolutions, the pictures' one in the middle."""
    rx, cv, rz = Rotation.from_matrix(cameras.T_RL.R).as_rotvec()
    baseline, ty, tz = -1e3 * cameras.T_RL.p
    text = ""
    for size, scale in (("2K", 2.3), ("VGA", 1.0), ("HD", 1.9)):
        for side, intrinsics in (("LEFT", cameras.left), ("RIGHT", cameras.right)):
            k1, k2, p1, p2 = cameras.coefficients
            fx, fy, cx, cy = (scale * x for x in intrinsics)
            text += f"[{side}_CAM_{size}]\nfx={fx}\nfy={fy}\ncx={cx}\ncy={cy}\n"
            text += f"k1={k1}\nk2={k2}\np1={p1}\np2={p2}\nk3=0\n\n"
    text += f"[STEREO]\nBaseline={baseline}\nTY={ty}\nTZ={tz}\n"
    text += "".join(f"CV_{s}={cv}\nRX_{s}={rx}\nRZ_{s}={rz}\n" for s in ("2K", "VGA", "HD"))
    (folder / "SN1.conf").write_text(text)
    return [folder / "SN1.conf"]


Writer = Callable[[Cameras, Path], list[Path]]
WITH_BODY: list[Writer] = [orb3, orb_before, vins, basalt, okvis, msckf]
WITHOUT: list[Writer] = [camera_info, opencv_xml, zed]


@pytest.mark.parametrize("cameras", [Cameras(), fisheye()], ids=["radtan", "fisheye"])
@pytest.mark.parametrize("written", WITH_BODY)
def test_the_files_of_other_programs_say_what_their_cameras_are(
    written: Writer, cameras: Cameras, tmp_path: Path
) -> None:
    rig = rig_files.read_rig(written(cameras, tmp_path))
    assert_rectifies(rig, cameras)
    assert (rig.left.width_px, rig.left.height_px) == SIZE
    if written not in (orb3, orb_before):
        assert rig.offset_s == pytest.approx(0.0125)
    noise = rig.imu.noise
    if written is vins:
        assert noise.gyro_noise < 0
        assert "acc_n, gyr_n are sigmas of single readings: not used" in rig.imu.remarks[0]
        assert rig.topics == ("/a", "/b")
    else:
        assert (noise.gyro_noise, noise.accel_noise) == pytest.approx((1.7e-4, 2e-3))
        assert (noise.gyro_walk, noise.accel_walk) == pytest.approx((2e-5, 3e-3))


@pytest.mark.parametrize("written", WITHOUT)
def test_files_without_a_body_say_the_rest(written: Writer, tmp_path: Path) -> None:
    cameras = Cameras()
    rig = rig_files.read_rig(written(cameras, tmp_path))
    with pytest.raises(ForeignFileError, match="does not say where the camera sits on the body"):
        rig_files.of_rig(rig, "x")
    if written is zed:
        assert rig.sizes == [(2208, 1242), (1280, 720), (672, 376)]
        assert rig.of_size(672, 376).left.intrinsics == pytest.approx(cameras.left)
        rig = rig.of_size(672, 376)
    assert_rectifies(rig.on_body(cameras.T_LB), cameras)


def test_tracks_are_of_the_resolution_that_holds_their_pixels(tmp_path: Path) -> None:
    cameras = Cameras()
    q_L = points()
    q_L = q_L[(cameras.see(q_L).reshape(-1, 2, 2) < [672, 376]).all(axis=(1, 2))]
    tracks = Tracks(1, np.zeros(len(q_L), np.intp), np.arange(len(q_L)), cameras.see(q_L))
    rig = rig_files.read_rig(zed(cameras, tmp_path)).on_body(cameras.T_LB)
    calibrated = rig_files.of_rig(rig, "x")
    t_ns = np.array([10**9])
    twists = Twists(Path("t"), np.array([0, 2 * 10**9]), *np.zeros((2, 2, 3)))
    made = recording(Streams(calibrated, RawTracks(Path("s"), t_ns, tracks), twists))
    s_B = se3.apply(se3.inverse(cameras.T_LB), q_L)
    due = project(made.header.camera, se3.apply(made.T_CB, s_B))
    assert np.abs(made.tracks.pixels - due).max() < 1e-3
    beyond = replace(tracks, pixels=tracks.pixels + 3000)
    with pytest.raises(ForeignFileError, match="beyond every resolution"):
        recording(Streams(calibrated, RawTracks(Path("s"), t_ns, beyond), twists))


def rectified(cameras: Cameras, folder: Path, before: bool) -> list[Path]:
    camera, b = ("Camera", -cameras.T_RL.p[0]) if before else ("Camera1", -cameras.T_RL.p[0])
    text = "%YAML:1.0\n" + ("" if before else 'Camera.type: "Rectified"\n')
    text += orb_camera(camera, cameras.left, (0, 0, 0, 0) if before else (), False)
    text += f"Camera.bf: {b * cameras.left[0]}\n" if before else f"Stereo.b: {b}\n"
    text += f"Camera.width: {SIZE[0]}\nCamera.height: {SIZE[1]}\n"
    text += opencv_object("Tbc" if before else "IMU.T_b_c1", whole(on_imu(cameras)[0]))
    (folder / "orb.yaml").write_text(text)
    return [folder / "orb.yaml"]


@pytest.mark.parametrize("before", [False, True])
def test_a_rectified_pair_is_taken_as_it_is(before: bool, tmp_path: Path) -> None:
    """To the bit: its pixels are those of the HEADER's camera."""
    found = rig_files.read(rectified(RECTIFIED, tmp_path, before), "x")
    camera = found.header.camera
    assert found.rig is None
    assert (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px) == RECTIFIED.left
    assert camera.baseline_m == pytest.approx(0.093)
    rig = rig_files.read_rig(rectified(RECTIFIED, tmp_path, before))
    assert_rectifies(rig, RECTIFIED)


def test_camera_info_of_pictures_that_are_rectified_is_its_p(tmp_path: Path) -> None:
    paths = camera_info(Cameras(), tmp_path)
    P = infos(Cameras())[1]["P"]
    for order in (paths, paths[::-1]):
        rig = rig_files.read_rig(order, LensModel.NONE)
        assert rig.is_rectified
        assert rig.left.intrinsics == pytest.approx((P[0, 0], P[1, 1], P[0, 2], P[1, 2]))
        assert np.linalg.norm(rig.T_RL.p) == pytest.approx(-P[0, 3] / P[0, 0])


# --- mistakes -------------------------------------------------------------------------------------


@pytest.mark.parametrize("written", [*WITH_BODY, *WITHOUT])
def test_a_number_that_is_wrong_or_lacks_is_told_by_its_file(
    written: Writer, tmp_path: Path
) -> None:
    chance = random.Random(2)
    refused: list[str] = []
    for _ in range(DAMAGES):
        paths = written(Cameras(), tmp_path)
        path = chance.choice(paths)
        words = path.read_text()
        numbers = list(re.finditer(r"-?\d+\.\d+(e-?\d+)?", words))
        one = chance.choice(numbers)
        wrong = chance.choice(["nan", "x", "1e300", "[]", "", "{}", '"', "\n", "-1e12"])
        path.write_text(words[: one.start()] + wrong + words[one.end() :])
        try:
            rig = rig_files.read_rig(paths).on_body(Cameras().T_LB)
            rig.rectification().pixels(Cameras().see(points(3)))
        except PelorusError as error:
            refused.append(str(error))
    assert all(str(tmp_path) in words for words in refused)
    assert len(refused) > DAMAGES // 2


def said(paths: list[Path]) -> str:
    with pytest.raises(PelorusError) as caught:
        rig_files.read(paths, "x")
    return str(caught.value)


def changed(paths: list[Path], old: str, new: str) -> list[Path]:
    words = paths[0].read_text()
    assert old in words
    paths[0].write_text(words.replace(old, new))
    return paths


def test_what_lacks_of_a_pair_is_said(tmp_path: Path) -> None:
    c, d = Cameras(), tmp_path
    assert "num_of_cam: 2 is expected" in said(
        changed(vins(c, d), "num_of_cam: 2", "num_of_cam: 1")
    )
    vins(c, d)
    assert "VINS-Fusion's configuration (body_T_cam0, cam0_calib) is expected" in said(
        [d / "left.yaml"]
    )
    (d / "right.yaml").unlink()
    assert "right.yaml: cannot be read" in said([d / "config.yaml"])
    assert "1 files of cameras; 2 of camera_info of ROS are expected" in said(camera_info(c, d)[:1])
    assert "neither camera has a baseline" in said([camera_info(c, d)[0]] * 2)
    assert "model_type is 'SCARAMUZZA'" in said(
        [vins(c, d)[0], *changed([d / "left.yaml"], "PINHOLE", "SCARAMUZZA"), d / "right.yaml"]
    )
    assert "is of one camera" in said(changed(orb3(c, d), "Stereo.T_c1_c2", "Other"))
    both = changed(rectified(RECTIFIED, d, True), "Camera.k1: 0", "Camera.k1: -0.3")
    assert "has a baseline alone, and a distortion (Camera.k1)" in said(both)
    assert "files of one are expected" in said([*orb3(c, d), *camera_info(c, d)])
    assert "is no XML" in said(changed(opencv_xml(c, d), "</opencv_storage>", ""))
    assert "is XML of html" in said([_written(d / "x.xml", "<html></html>")])
    assert "lacks rx" in said(changed(zed(c, d), "RX_2K", "RX_4K"))
    assert "camera_type is 'ftheta'" in said(changed(basalt(c, d), "pinhole-radtan8", "ftheta"))


def _written(path: Path, words: str) -> Path:
    path.write_text(words)
    return path


def test_opencv_files_may_call_the_cameras_left_and_right(tmp_path: Path) -> None:
    cameras = Cameras()
    matrices = opencv_matrices(cameras)
    for a, b in (("L", "R"), ("_left", "_right"), ("_1", "_2")):
        names = {"K1": f"K{a}", "K2": f"K{b}", "D1": f"D{a}", "D2": f"D{b}"}
        text = opencv_text(**{names.get(key, key): value for key, value in matrices.items()})
        rig: Rig = rig_files.read_rig([_written(tmp_path / "s.yml", text)])
        assert_rectifies(rig.on_body(cameras.T_LB), cameras)
