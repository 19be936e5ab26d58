# SPDX-License-Identifier: MIT
"""`pelorus live` without hardware: what it tells, keeps and sends, and how it ends."""

from __future__ import annotations

import json
import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from imu_drives import noisy
from live_cameras import Scripted, Step, plugged_in, single
from pelorus.commands.cli import main
from pelorus.errors import PelorusError
from pelorus.io.recording import Recording
from pelorus.live.camera import Measured, Picture
from pelorus.live.outputs import HealthLine, News, as_object
from pelorus.live.session import CAMERA_FROM_FLU, HERE, How, Intake, Session, on_camera
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.online.diagnosis import Level, Status
from pelorus.rig.read import Calibrated
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Config, Header, Imu, Pose, Stereo
from pelorus.wire.framing import messages_of
from pelorus.wire.settings import IDS
from rendered import SMALL
from room import Room
from scipy.spatial.transform import Rotation
from test_causes import apart_by

MS = 1_000_000
pytestmark = pytest.mark.usefixtures("built")


@pytest.fixture(scope="module")
def recording() -> Recording:
    """With an IMU, which stands for two seconds and then drives."""
    return simulate(Options(seed=4, duration_s=6.0, imu=SimulatedImu(imu_rate_hz=200.0))).recording


@pytest.fixture(scope="module")
def steps(recording: Recording) -> list[Measured]:
    return single(list(recording.messages()))


def camera(recording: Recording, steps: list[Step]) -> Scripted:
    return Scripted(Calibrated(recording.header), steps)


def same_bits(log: Path) -> bool:
    return main(["compare", str(log)]) == 0


def words(text: str) -> str:
    return " ".join(text.split())


# --- from a camera to a pose ----------------------------------------------------------------------


def test_a_folder_as_a_camera_shows_a_pose_sends_it_and_keeps_a_log_that_replays(
    once: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = once("room-short", Room(SMALL, drive_s=2.2).write)
    log, listener = tmp_path / "out.plr", socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    listener.bind(("127.0.0.1", 0))
    files = [f"--calibration={folder / name}" for name in ("camchain.yaml", "imu.yaml")]
    to = f"127.0.0.1:{listener.getsockname()[1]}"
    how = ("--log", str(log), "--udp", to)
    assert main(["live", "--camera", "folder", str(folder), *files, *how]) == 0
    said = capsys.readouterr().out
    assert " good " in said
    poses = [m for m in messages_of(log) if isinstance(m, Pose)]
    assert len(poses) > 10
    told = json.loads(listener.recv(65536))
    assert len(told["covariance"]) == 36
    assert set(told) >= {"t_ns", "position_m", "orientation_xyzw", "velocity_mps", "health"}
    assert same_bits(log)


def test_numbers_and_words_of_a_settings_file_are_in_force(
    recording: Recording, tmp_path: Path
) -> None:
    source, log, conf = (tmp_path / name for name in ("in.plr", "out.plr", "rig.conf"))
    recording.write(source)
    conf.write_text("gyro-noise = 1.4e-3  # rad/s/sqrt(Hz)\nscene = may-move\n")
    how = ["--config", str(conf), "--log", str(log)]
    assert main(["live", "--camera", "plr", str(source), *how]) == 0
    in_force = [m for m in messages_of(log) if isinstance(m, Config)][-1].settings
    assert in_force[IDS["gyro-noise"]] == pytest.approx(1.4e-3)
    assert in_force[IDS["scene"]] == 1


def test_a_recording_as_a_camera_ends_where_the_truth_does(
    recording: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, log = tmp_path / "in.plr", tmp_path / "out.plr"
    recording.write(source)
    assert main(["live", "--camera", "plr", str(source), "--log", str(log)]) == 0
    assert " good " in capsys.readouterr().out
    assert same_bits(log)


def test_the_pose_is_that_of_the_mount_and_its_covariance_holds_the_error(
    recording: Recording, steps: list[Measured]
) -> None:
    mount = (0.3, -0.2, 0.1, 5.0, 20.0, -30.0)
    session = Session(camera(recording, []), How(mount, settings=recording.settings))
    told = [odom for one in steps for odom in session.take(one)]
    first, last = told[-10], told[-1]
    truth = dict(zip(recording.truth_t_ns.tolist(), range(len(recording.truth_t_ns)), strict=True))
    T_IB = on_camera(mount, recording.header)
    begin, end = (se3.compose(recording.truth.at(truth[odom.t_ns]), T_IB) for odom in (first, last))
    moved = se3.compose(se3.inverse(begin), end)
    found = se3.compose(se3.inverse(first.T_OB), last.T_OB)
    assert np.linalg.norm(moved.p) > 0.5
    assert found.p == pytest.approx(moved.p, abs=0.05)


def test_a_camera_that_looks_down_gives_a_base_that_does_not() -> None:
    """Pitch > 0 looks down; the base's x is level, and its origin is where the mount says."""
    R_CB = CAMERA_FROM_FLU.R  # a body forward, left, up that looks as the camera does
    head = Header(camera=None, R_CB=R_CB, t_CB_m=np.zeros(3))  # type: ignore[arg-type]
    T_IB = on_camera((0.2, 0.0, 0.1, 0.0, 30.0, 0.0), head)
    ahead = T_IB.R @ [1.0, 0, 0]  # the base's x in the body
    assert ahead == pytest.approx([np.cos(np.pi / 6), 0, np.sin(np.pi / 6)])
    of_camera = se3.apply(se3.inverse(T_IB), np.zeros(3))
    assert of_camera == pytest.approx([0.2, 0.0, 0.1])
    none = on_camera(HERE, head)
    assert pytest.approx(np.eye(3)) == none.R
    turned = on_camera((0.0, 0.0, 0.0, 0.0, 0.0, 90.0), head)  # looks to the left
    assert Rotation.from_matrix(turned.R).as_euler("ZYX", degrees=True)[0] == pytest.approx(-90)


# --- how it ends ----------------------------------------------------------------------------------


def test_ctrl_c_ends_it_in_order_with_a_whole_log(
    recording: Recording, steps: list[Measured], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = signal.getsignal(signal.SIGINT)
    half = len(steps) * 3 // 4
    interrupt: list[Step] = [lambda: os.kill(os.getpid(), signal.SIGINT)]
    used = plugged_in(monkeypatch, camera(recording, [*steps[:half], *interrupt, *steps[half:]]))
    used.recorded = True  # it waits for its reader, so that the signal comes where it stands
    log = tmp_path / "out.plr"
    assert main(["live", "--camera", "scripted", "--log", str(log)]) == 0
    assert used.closed
    kept = [m for m in messages_of(log) if isinstance(m, Stereo)]
    assert len(kept) == sum(isinstance(one, Stereo) for one in steps[:half])
    assert same_bits(log)
    assert signal.getsignal(signal.SIGINT) is before


def test_a_camera_that_dies_is_told_and_nothing_that_was_kept_is_lost(
    recording: Recording,
    steps: list[Measured],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def dies() -> None:
        raise PelorusError("the camera is lost: cable and power? start again")

    half = len(steps) * 3 // 4
    plugged_in(monkeypatch, camera(recording, [*steps[:half], dies]))
    log = tmp_path / "out.plr"
    assert main(["live", "--camera", "scripted", "--log", str(log)]) == 1
    assert "the camera is lost: cable and power? start again" in words(capsys.readouterr().err)
    kept = [m for m in messages_of(log) if isinstance(m, Stereo)]
    assert len(kept) == sum(isinstance(one, Stereo) for one in steps[:half])
    assert same_bits(log)


def test_a_camera_that_gives_nothing_is_not_waited_for_for_ever(recording: Recording) -> None:
    silent = Intake(camera(recording, [lambda: silent.stop.wait(60)]), silence_s=0.4)  # type: ignore[list-item]
    with pytest.raises(PelorusError, match=r"has given nothing for 0.4 s: is it still connected"):
        list(silent)


def test_a_full_disk_ends_the_log_and_not_the_drive(
    recording: Recording,
    steps: list[Measured],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    plugged_in(monkeypatch, camera(recording, [*steps]))
    assert main(["live", "--camera", "scripted", "--log", "/dev/full"]) == 1
    said = capsys.readouterr()
    assert " good " in said.out
    assert "the log /dev/full ends here: No space left" in words(said.err)


def test_a_log_that_is_there_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out.plr").write_bytes(b"precious")
    assert main(["live", "--camera", "plr", "in.plr", "--log", str(tmp_path / "out.plr")]) == 1
    assert "--force to overwrite it" in words(capsys.readouterr().err)


# --- never a pose that claims to be good ----------------------------------------------------------


def told(session: Session, steps: list[Measured]) -> list[str]:
    """Returns what it says in the end; no pose may have come."""
    assert [odom for one in steps for odom in session.take(one)] == []
    return [f"{one.name}: {one.message}; {one.do}" for one in session.diagnose()]


def test_swapped_cameras_give_no_pose_and_are_told(
    recording: Recording,
    steps: list[Measured],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    swapped: list[Step] = [
        Stereo(one.t_ns, one.ids, one.pixels[:, [2, 3, 0, 1]]) if isinstance(one, Stereo) else one
        for one in steps
    ]
    plugged_in(monkeypatch, camera(recording, swapped))
    assert main(["live", "--camera", "scripted"]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert "are left and right swapped?" in words(said.err)


def test_pictures_21_ms_apart_give_no_pose_and_the_gap_is_told(
    recording: Recording, steps: list[Measured]
) -> None:
    dark = np.zeros((400, 640), np.uint8)
    apart: list[Measured] = [one for one in steps if isinstance(one, Imu)]
    for one in steps:
        if isinstance(one, Stereo):
            apart += [Picture(one.t_ns, False, dark), Picture(one.t_ns + 21 * MS, True, dark)]
    said = told(Session(camera(recording, []), How()), sorted(apart, key=lambda one: one.t_ns))
    assert any("no partner within 2 ms, as a rule 21 ms apart; 0 pairs" in line for line in said)
    assert any("trigger the cameras together" in line for line in said)


@pytest.mark.parametrize("apart_ms", [0.0, 21.0])
def test_halves_that_were_taken_apart_under_one_stamp_are_found_by_their_rows(
    apart_ms: float,
) -> None:
    """Once they are, no pose is good; and cameras that are triggered together are not accused.
    At rest nothing shows, and nothing is wrong.
    """
    drive = noisy(7).recording
    drive = apart_by(drive, apart_ms * 1e-3) if apart_ms else drive
    session = Session(camera(drive, []), How(settings=drive.settings))
    healths = [
        (session.pipeline.together.found is not None, odom.estimate.health)
        for one in single(list(drive.messages()))
        for odom in session.take(one)
        if session.pipeline.together is not None
    ]
    found = [health for is_found, health in healths if is_found]
    if not apart_ms:
        assert not found
        assert healths[-1] == (False, 0)
        return
    assert len(found) > 15
    assert min(found) > 0
    said = [one.message for one in session.diagnose()]
    assert any("ms apart, the right one later: points move by" in line for line in said), said


def test_an_imu_alone_gives_no_pose_and_says_that_no_frames_come(
    recording: Recording, steps: list[Measured]
) -> None:
    said = told(Session(camera(recording, []), How()), [s for s in steps if isinstance(s, Imu)])
    assert any("no frames came" in line or "not started" in line for line in said), said


def test_frames_alone_give_no_pose_and_say_that_the_imu_lacks(
    recording: Recording, steps: list[Measured]
) -> None:
    session = Session(camera(recording, []), How())
    said = told(session, [s for s in steps if isinstance(s, Stereo)])
    assert said


def test_an_imu_in_g_gives_no_pose_and_the_factor_is_told(
    recording: Recording, steps: list[Measured]
) -> None:
    in_g: list[Measured] = [
        Imu(one.t_ns, one.a_B_mps2 / 9.80665, one.w_B_radps) if isinstance(one, Imu) else one
        for one in steps
    ]
    said = told(Session(camera(recording, []), How()), in_g)
    assert any("that is g: multiply its readings by 9.80665" in line for line in said)


def test_pairs_that_come_faster_than_they_are_followed_are_counted(recording: Recording) -> None:
    session = Session(camera(recording, []), How())
    dark = np.zeros((400, 640), np.uint8)
    for k in range(5):
        session.take(Picture(50 * k * MS, False, dark), too_slow=True)
        session.take(Picture(50 * k * MS, True, dark), too_slow=True)
    assert session.too_slow == 5
    assert any("5 pairs were left out" in one.message for one in session.diagnose())


# --- what is said ---------------------------------------------------------------------------------


def test_the_line_has_place_sigma_health_points_and_rate(
    recording: Recording, steps: list[Measured]
) -> None:
    session, line = Session(camera(recording, []), How()), HealthLine()
    lines = [line.of(odom) for one in steps for odom in session.take(one)]
    assert lines[0].startswith("0.0 s  x ")
    assert " m +-" in lines[-1]
    assert lines[-1].split("  ")[-3:-1][0] == "good"
    assert lines[-1].endswith(" Hz")


def test_news_is_said_once_until_it_passes() -> None:
    news, bad = News(), Status("sync", Level.WARN, "6 pictures had no partner", "trigger them")
    assert list(news.of([bad])) == ["sync: 6 pictures had no partner; trigger them"]
    later = Status("sync", Level.WARN, "60 pictures had no partner", "trigger them")
    assert list(news.of([later])) == []
    assert list(news.of([])) == []
    assert len(list(news.of([later]))) == 1


def test_json_of_a_pose_can_be_read_by_anybody(recording: Recording, steps: list[Measured]) -> None:
    session = Session(camera(recording, []), How())
    odom = [odom for one in steps for odom in session.take(one)][-1]
    found = json.loads(json.dumps(as_object(odom), allow_nan=False))
    assert found["health"] == "good"
    assert found["reasons"] == []
    R = Rotation.from_quat(found["orientation_xyzw"]).as_matrix()
    np.testing.assert_allclose(R, odom.T_OB.R, atol=1e-8)
    C = np.array(found["covariance"]).reshape(6, 6)
    np.testing.assert_allclose(
        C[:3, :3], odom.T_OB.R @ odom.covariance[:3, :3] @ odom.T_OB.R.T, rtol=1e-6, atol=1e-12
    )
    assert isinstance(odom.T_OB, Poses)
