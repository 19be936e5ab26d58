# SPDX-License-Identifier: MIT
"""The adapters of `pelorus live`, each against a fake of its SDK; their calibrations."""

from __future__ import annotations

import json
import sys
import threading
from itertools import count, islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from live_cameras import Oak, RealSense
from pelorus.commands.cli import main
from pelorus.errors import PelorusError
from pelorus.live import oak, realsense, v4l2
from pelorus.live.camera import Asked, Force, OtherClock, Picture, Rate, open_camera
from pelorus.math.se3 import Poses
from pelorus.rig.lens import Lens, LensModel
from pelorus.wire.frames import Imu
from rigs import Cameras, camchain, write_yaml
from scipy.spatial.transform import Rotation
from test_rig_several import depthai

MS = 1_000_000


def eeprom(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(depthai(Cameras(), folder)[0].read_text())
    return found


# --- OAK ------------------------------------------------------------------------------------------


def test_an_oak_gives_pictures_and_readings_and_its_eeprom_calibrates_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = Oak(eeprom(tmp_path))
    monkeypatch.setitem(sys.modules, "depthai", device.module())
    width, height = oak.rig_of(device.eeprom).sizes[0]
    camera = open_camera("oak", Asked(size=(width // 2, height // 2), rate_hz=15))
    given = list(islice(camera.measured(), 10))
    assert [type(one) for one in given[:2]] == [Force, Rate]
    assert [one.t_ns for one in given[:4]] == [0, 1 * MS, 5 * MS, 6 * MS]
    pictures = [one for one in given if isinstance(one, Picture)]
    assert {(one.is_right, int(one.pixels[0, 0])) for one in pictures} == {(False, 10), (True, 20)}
    assert pictures[0].t_ns == 86400 * 10**9 + 7000
    assert (1, (width // 2, height // 2), "gray8", 15) in device.asked
    rig = camera.calibrated.rig
    assert rig is not None
    whole = oak.rig_of(device.eeprom)
    assert rig.left.intrinsics[0] == pytest.approx(whole.left.intrinsics[0] / 2)
    assert rig.left.intrinsics[2] == pytest.approx((whole.left.intrinsics[2] + 0.5) / 2 - 0.5)
    camera.close()
    assert device.closed


def test_an_oak_whose_cable_is_pulled_is_told_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = Oak(eeprom(tmp_path), lives=2)
    monkeypatch.setitem(sys.modules, "depthai", device.module())
    camera = open_camera("oak", Asked(size=oak.rig_of(device.eeprom).sizes[0]))
    with pytest.raises(PelorusError, match=r"the OAK is lost \(X_LINK_ERROR\): cable and power"):
        list(camera.measured())


def test_an_oak_that_does_not_know_its_imu_asks_for_the_extrinsic_and_lets_the_device_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (path,) = depthai(Cameras(), tmp_path, knows_imu=False)
    device = Oak(json.loads(path.read_text()))
    monkeypatch.setitem(sys.modules, "depthai", device.module())
    size = oak.rig_of(device.eeprom).sizes[0]
    with pytest.raises(
        PelorusError, match=r"does not say where the camera sits on the body.*--extr"
    ):
        open_camera("oak", Asked(size=size))
    assert device.closed


def test_an_oak_of_pictures_of_another_shape_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "depthai", Oak(eeprom(tmp_path)).module())
    with pytest.raises(PelorusError, match="a size of the same shape is expected"):
        open_camera("oak", Asked(size=(640, 123)))


# --- RealSense ------------------------------------------------------------------------------------


def test_a_realsense_gives_both_sides_and_the_imu_by_the_factorys_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    turn = Rotation.from_rotvec([0.1, 0.2, -0.3]).as_matrix()
    device = RealSense(Poses(turn, np.array([-0.005, -0.005, 0.012])))
    device.frames = [
        device.motion("accel", 1_700_000_000_000.25, (0.0, -9.8, 0.1)),
        device.motion("gyro", 1_700_000_000_000.5, (0.1, 0.2, 0.3)),
        device.pair(1_700_000_000_001.0),
    ]
    monkeypatch.setitem(sys.modules, "pyrealsense2", device.module())
    camera = open_camera("realsense", Asked())
    force, rate, left, right = islice(camera.measured(), 4)
    assert isinstance(force, Force)
    assert abs(force.t_ns - 1_700_000_000_000_250_000) < 1000  # it tells ms, in a double
    assert force.a_B_mps2.tolist() == [0.0, -9.8, 0.1]
    assert isinstance(rate, Rate)
    assert isinstance(left, Picture)
    assert isinstance(right, Picture)
    assert (left.is_right, right.is_right) == (False, True)
    assert (int(left.pixels[0, 0]), int(right.pixels[0, 0])) == (20, 40)
    header = camera.calibrated.header
    assert camera.calibrated.rig is None  # rectified by the device
    assert header.camera.fx_px == 390.0
    assert header.camera.baseline_m == pytest.approx(0.05)
    np.testing.assert_allclose(header.R_CB, turn, atol=1e-12)
    np.testing.assert_allclose(header.t_CB_m, device.T_LB.p, atol=1e-12)
    assert device.options == {"emitter": 0, "global": 1}
    assert "rs-imu-calibration" in camera.remarks[-1]
    camera.close()
    camera.close()
    assert list(camera.measured()) == []


def test_a_realsense_that_is_not_there_is_told_with_what_to_look_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    device = RealSense(Poses(np.eye(3), np.zeros(3)))
    device.absent = True
    monkeypatch.setitem(sys.modules, "pyrealsense2", device.module())
    with pytest.raises(PelorusError, match=r"No device connected.*plugged in at USB 3, a D435i"):
        open_camera("realsense", Asked())


def test_lenses_of_librealsense_that_are_not_known_are_refused() -> None:
    bent = RealSense(Poses(np.eye(3), np.zeros(3)))._profile("infrared", 1)
    given = bent.as_video_stream_profile().get_intrinsics()
    given.coeffs = [0.1, 0.0, 0.0, 0.0, 0.0]
    assert realsense.lens_of(given).model is LensModel.RADTAN
    given.model = "distortion.ftheta"
    with pytest.raises(PelorusError, match=r"distortion\.ftheta is not known: give --calibration"):
        realsense.lens_of(given)


@pytest.mark.parametrize(
    ("kind", "package", "extra"),
    [("oak", "depthai", "oak"), ("realsense", "pyrealsense2", "realsense")],
)
def test_an_sdk_that_is_not_installed_is_named_with_its_extra(
    kind: str, package: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(PelorusError, match=rf"needs {package}, which is missing.*\[{extra}\]"):
        open_camera(kind, Asked())


# --- V4L2 -----------------------------------------------------------------------------------------


class Capture:
    """A camera of three pictures, side by side."""

    def __init__(self, size: tuple[int, int], ends: bool = True) -> None:
        self.size, self.left, self._ends = size, 3, ends
        self.was: dict[int, float] = {}
        self.set = self.was.__setitem__

    def read(self) -> tuple[bool, Any]:
        self.left -= 1
        if self.left < 0 and not self._ends:
            threading.Event().wait()  # in a thread that ends with the program
        both = np.zeros((self.size[1], 2 * self.size[0], 3), np.uint8)
        both[:, self.size[0] :] = 200
        return self.left >= 0, both

    def get(self, what: int) -> float:
        return 1000.0 - self.left if what == cv2.CAP_PROP_POS_MSEC else 0.0

    def release(self) -> None:
        pass


class Lines:
    """A serial port with an IMU's lines."""

    def __init__(self, *pieces: bytes) -> None:
        self._pieces = [*pieces]

    def exchange(self, outgoing: bytes, wait_s: float, stall_s: float) -> bytes:
        del outgoing, wait_s, stall_s
        return self._pieces.pop(0) if self._pieces else b""

    def close(self) -> None:
        pass


def usb(folder: Path, *pieces: bytes, ends: bool = True) -> v4l2.V4l2:
    cameras, size = Cameras(), (752, 480)
    file = write_yaml(folder / "chain.yaml", camchain(cameras, size))
    asked = Asked("/dev/video7", size, 30, (file,))
    return v4l2.V4l2(asked, Capture(size, ends), Lines(*pieces), count(0, MS).__next__)


def test_a_usb_camera_gives_halves_with_the_kernels_stamps_then_says_that_it_is_gone(
    tmp_path: Path,
) -> None:
    measured = usb(tmp_path, b"0 0 9.81 0.1 0.2 0.3\n").measured()
    given = list(islice(measured, 7))
    with pytest.raises(PelorusError, match="/dev/video7: gives no pictures any more"):
        next(measured)
    pictures = [one for one in given if isinstance(one, Picture)]
    assert [(one.is_right, int(one.pixels[0, 0])) for one in pictures[:2]] == [
        (False, 0),
        (True, 200),
    ]
    assert pictures[0].pixels.shape == (480, 752)
    assert [one.t_ns for one in pictures[::2]] == [998 * MS, 999 * MS, 1000 * MS]
    assert sum(isinstance(one, Imu) for one in given) == 1


def test_lines_of_an_imu_are_read_in_pieces_and_others_are_counted() -> None:
    lines = v4l2.LineImu()
    assert list(lines.readings(b"0,0,9.8", 10 * MS)) == []
    (one,) = lines.readings(b"1,0.1,0.2,0.3\nboot ok\n\n1 2 3\n", 11 * MS)
    assert one.t_ns == 11 * MS
    assert one.a_B_mps2.tolist() == [[0.0, 0.0, 9.81]]
    assert (lines.good, lines.bad) == (1, 2)
    both = list(lines.readings(b"0 0 9.81 0 0 0\n" * 2, 21 * MS))
    assert [one.t_ns for one in both] == [16 * MS, 21 * MS]
    assert [*lines.readings(b"nan 0 9.81 0 0 0\n", 22 * MS)] == []


def test_times_of_an_imus_own_clock_are_brought_to_the_hosts() -> None:
    lines = v4l2.LineImu()
    chance = np.random.default_rng(1)
    found: list[Imu] = []
    for k in range(400):
        own_s, late_ns = 3.0 + 0.005 * k, round(chance.exponential(4 * MS))
        line = f"{own_s:.6f} 0 0 9.81 0 0 0\n".encode()
        found += lines.readings(line, 10**12 + 5 * MS * k + MS + late_ns)
    steps = np.diff([one.t_ns for one in found][100:])
    assert abs(steps - 5 * MS).max() < 0.2 * MS


def test_another_clock_is_told_by_what_came_with_the_least_delay() -> None:
    clock = OtherClock()
    assert clock.at(5) is None
    for stamp, host in ((100, 1100), (200, 1230), (300, 1310)):
        clock.heard(stamp * MS, host * MS)
    assert clock.at(2000 * MS) == pytest.approx(1000 * MS, abs=0.1 * MS)
    assert clock.to_host(400 * MS) == pytest.approx(1400 * MS, abs=0.1 * MS)


def test_a_port_without_readings_is_told_with_the_form_of_a_line(tmp_path: Path) -> None:
    camera = usb(tmp_path, *[b"$GPGGA,1\n" * 30] * 3, ends=False)
    with pytest.raises(PelorusError, match="its lines are no readings; `ax ay az wx wy wz`"):
        list(camera.measured())


# --- all ------------------------------------------------------------------------------------------


def test_a_lens_is_scaled_with_its_picture_by_the_pixels_middles() -> None:
    lens = Lens(LensModel.NONE, (400.0, 410.0, 319.5, 199.5), (), 640, 400)
    half = lens.scaled(320, 200)
    assert half.intrinsics == (200.0, 205.0, 159.5, 99.5)
    with pytest.raises(ValueError, match="no scaled 640 x 400"):
        lens.scaled(320, 240)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--camera", "kinect"), "oak, realsense, v4l2, folder, plr are possible"),
        (("--camera", "folder"), "its name is missing"),
        (("--camera", "plr", "/no/such.plr"), "there is no such file"),
        (("--camera", "v4l2"), "needs --imu DEVICE"),
        (
            ("--camera", "v4l2", "/dev/no-such", "--imu", "/dev/x"),
            "is no camera that can be opened",
        ),
        (("--camera", "oak", "--size", "640"), "WIDTHxHEIGHT in px is expected"),
        (("--camera", "plr", "--log", "/no/such/d.plr"), "there is no folder"),
        (("--camera", "plr", "--origin", "1", "2", "3"), "needs --mavlink PORT"),
    ],
)
def test_what_cannot_be_opened_is_told_with_what_can(
    words: tuple[str, ...], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["live", *words]) == 1
    assert says in " ".join(capsys.readouterr().err.split())
